"""What Crazyswarm and Crazyswarm2 write as tables.

The states that Crazyswarm2's simulator records (`timestamp,x,y,z,qw,qx,qy,qz`, or an archive of t, pos, quat); the
tracked positions that its system tests take from a bag (`# t, x, y, z`); and topics of Crazyswarm under ROS 1 as
`rostopic echo -p` prints them from a bag (`%time,field...`, in nanoseconds): the pose that the vehicle estimated, a
transform of the tracking, and log blocks, whose `field.values0` ... have no names. Logs of the micro-SD card are of
the format `usd`.
"""

from collections.abc import Sequence
from pathlib import Path

from ivl.errors import ConfigError
from ivl.flight import bitcraze, streams
from ivl.flight import table as border
from ivl.flight.log import Format, Given, Log
from ivl.flight.streams import Stream
from ivl.flight.table import Rule, rules

_TIMES = {"timestamp": 1.0, "t": 1.0, "# t": 1.0, "%time": 1e-9}
"""Seconds in a unit of the clock, by the name of its column."""
_STATE = (
    rules("p", "xyz", "m", "{}"),
    rules("q", "xyzw", "", "q{}"),
    [Rule(f"p_{axis}_m", f"pos_{i}") for i, axis in enumerate("xyz", 1)],
    [Rule(f"q_{axis}", f"quat_{i}") for i, axis in enumerate("wxyz", 1)],
)
_TRACKED = (rules("track_p", "xyz", "m", "{}"),)
_TOPIC = (
    rules("p", "xyz", "m", "field.pose.position.{}"),
    rules("q", "xyzw", "", "field.pose.orientation.{}"),
    rules("track_p", "xyz", "m", "field.transforms0.transform.translation.{}"),
    rules("track_q", "xyzw", "", "field.transforms0.transform.rotation.{}"),
)
_GROUPS = {"timestamp": _STATE, "t": _STATE, "# t": _TRACKED, "%time": _TOPIC}
_FRAMES = (
    "World and body as Crazyswarm has them: world z up; body x forward, y left, z up; quaternion body to world. "
    "PoseStamped is the vehicle's estimate, tf the tracking. Values of a log block have the names that --map gave them."
)
_CLOCK = "The time of the table, from the first sample of each flight on: "


def load(paths: Sequence[Path], given: Given) -> Log:
    """Read tables; those of one folder are topics of one recording."""
    flights, files, clock = bitcraze.by_folder(paths, (".csv", ".npz"), _stream, given)
    return Log(flights, files, _FRAMES, _CLOCK + clock)


FORMAT = Format("crazyswarm", "tables of Crazyswarm and Crazyswarm2: recorded states, tf, topics of a bag", load)


def _stream(path: Path, given: Given) -> Stream:
    table = border.read_npz(path) if path.suffix == ".npz" else border.read_csv(path)
    time = next((name for name in _TIMES if name in table.columns), None)
    if time is None:
        found = border.shorten(", ".join(table.columns), 100)
        raise ConfigError(f"{path}: no column of times (known: {', '.join(_TIMES)}); there are {found}")
    t_s = border.clock(table, time, _TIMES[time])
    return streams.make(path.stem, table, t_s, _GROUPS[time], given)

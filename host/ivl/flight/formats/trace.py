"""The simulator's own time series (`ivl rollout --trace`, .csv or .npz): the truth, as estimate and as track."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ivl.flight import table as border
from ivl.flight.log import Format, Given, Log, with_rules
from ivl.flight.phases import plane, trigger
from ivl.flight.store import Flight, make_flight
from ivl.flight.table import Rule, Table

_STUCK = 2


def _vector(stem: str, axes: str, suffix: str, variable: str) -> list[Rule]:
    end = f"_{suffix}" if suffix else ""
    return [Rule(f"{stem}_{axis}{end}", f"{variable}_{i}", needed=True) for i, axis in enumerate(axes, 1)]


_RULES = (
    *_vector("p", "xyz", "m", "p_WB_m"),
    *_vector("v", "xyz", "mps", "v_WB_mps"),
    *_vector("q", "xyzw", "", "q_WB"),
    *_vector("w", "xyz", "radps", "w_B_radps"),
    *_vector("track_p", "xyz", "m", "p_WB_m"),
    *_vector("track_q", "xyzw", "", "q_WB"),
    *_vector("thrust", "1234", "N", "thrust_cmd_N"),
    Rule("d_ceil_m", "d_sensed_m", nothing=0.0),
    Rule("rrev_per_s", "rrev_per_s", nothing=0.0),
    Rule("of_y_radps", "of_y_radps", nothing=0.0),
    Rule("phase", "phase", needed=True),
)
_NEEDED = ["t_s", "d_ceil_m", "body_contact", *(f"foot_state_{i}" for i in range(1, 5)), *(r.variable for r in _RULES)]
_FRAMES = "Those of the simulator, which are those of the schema."
_CLOCK = "Time of the simulation, from the first row on."
_NOTES = ("Position, attitude, velocity and rates are the truth, as estimate and as track.",)


def load(paths: Sequence[Path], given: Given) -> Log:
    """Read traces, one flight each."""
    return Log([_flight(path, given) for path in paths], paths, _FRAMES, _CLOCK, notes=_NOTES)


FORMAT = Format("trace", "time series of `ivl rollout --trace`, .csv or .npz", load)


def _flight(path: Path, given: Given) -> Flight:
    table = border.read_npz(path) if path.suffix == ".npz" else border.read_csv(path)
    table.need(_NEEDED, "format trace")
    t_s = border.clock(table, "t_s", 1.0)
    columns = border.samples(table, with_rules(_RULES, given, table))
    first, columns["triggered"] = trigger(columns["phase"])
    info: dict[str, Any] = {
        "label": path.stem,
        "source": path.name,
        "h_plane_m": plane(columns["p_z_m"] + columns["d_ceil_m"]),
        "h_surface_m": plane(columns["p_z_m"] + table.numbers("d_ceil_m", needed=True)),
        "n_legs": sum(_last(table, f"foot_state_{i}") == _STUCK for i in range(1, 5)),
        "body_contact": float(_last(table, "body_contact") != 0),
        "judged_by": "simulator",
    }
    if first is not None:
        info |= {"t_trigger_s": t_s[first] - t_s[0], "trigger_age_s": 0.0}
    return make_flight(info, {"t_s": t_s - t_s[0], **columns})


def _last(table: Table, name: str) -> float:
    return float(table.numbers(name, needed=True)[-1])

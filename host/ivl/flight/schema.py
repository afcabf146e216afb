"""The neutral schema of recorded flights: every column once, with unit, frame and meaning.

Frames: W world, z up, x along the approach; B body, x forward, y left, z up. SI units, radians, seconds. Quaternions
turn body vectors into world vectors. NaN stands for "not in the log"; a column of which a log has nothing is left out
of the file and named in the manifest.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes:
        name: With its unit.
        unit: As in the name, "1" if dimensionless.
        doc: What it is, in one line.
        kind: "f8" numbers (NaN: unknown), "i4" whole numbers, "str" text ("": unknown), "bool".
    """

    name: str
    unit: str
    doc: str
    kind: str = "f8"


def _vector(stem: str, axes: str, unit: str, suffix: str, doc: str) -> list[Column]:
    """One column for each component."""
    end = f"_{suffix}" if suffix else ""
    return [Column(f"{stem}_{axis}{end}", unit, f"{doc}, {axis}") for axis in axes]


def _table(*groups: list[Column]) -> Mapping[str, Column]:
    return MappingProxyType({column.name: column for group in groups for column in group})


SAMPLES = _table(
    [Column("flight", "1", "number of the flight in the table of flights", "i4")],
    [Column("t_s", "s", "time on the flight's own clock, rising; 0 at its first sample")],
    _vector("p", "xyz", "m", "m", "position of the body origin in W as the vehicle estimated it"),
    _vector("v", "xyz", "m/s", "mps", "velocity in W as the vehicle estimated it"),
    _vector("q", "xyzw", "1", "", "attitude as the vehicle estimated it"),
    _vector("w", "xyz", "rad/s", "radps", "angular rate in B, gyro"),
    _vector("f", "xyz", "m/s^2", "mps2", "specific force in B, accelerometer: +g along z at rest and upright"),
    _vector("track_p", "xyz", "m", "m", "position of the body in W as the tracking system gave it"),
    _vector("track_q", "xyzw", "1", "", "attitude as the tracking system gave it"),
    _vector("set_p", "xyz", "m", "m", "position set-point in W"),
    _vector("set_v", "xyz", "m/s", "mps", "velocity set-point in W"),
    [
        Column("d_ceil_m", "m", "distance of the body origin from the plane of the cues, as logged"),
        Column("rrev_per_s", "1/s", "RREV as logged"),
        Column("of_x_radps", "rad/s", "optical flow about body x as logged, -v_y / d"),
        Column("of_y_radps", "rad/s", "optical flow about body y as logged, -v_x / d"),
        Column("triggered", "1", "1 from the trigger on, 0 before"),
        Column("phase", "1", "phase of the flight core, numbers of ivl_types.h"),
        Column("thrust_cmd_N", "N", "collective thrust that the controller asked for"),
        Column("battery_V", "V", "battery voltage under load"),
    ],
    _vector(
        "moment_cmd",
        "xyz",
        "N m",
        "Nm",
        "moment about body axes that the controller asked for; nose-up is negative about y",
    ),
    _vector("thrust", "1234", "N", "N", "thrust commanded to a motor"),
    _vector("pwm", "1234", "1", "norm", "duty cycle of a motor, 0 .. 1"),
    _vector("rotor", "1234", "rad/s", "radps", "rotor speed as measured"),
)
"""One row a sample, in the order of time; the rows of a flight are one row group of the file."""

FLIGHTS = _table(
    [
        Column("flight", "1", "number of the flight, 0 .. n - 1, in the order flown", "i4"),
        Column("label", "1", "what the log calls it", "str"),
        Column("source", "1", "name of the file that it was read from", "str"),
        Column("threshold_per_s", "1/s", "policy that was flown: trigger threshold, if it has a constant one"),
        Column("moment_Nmm", "N mm", "policy that was flown: nose-up moment of the flip, magnitude"),
        Column("form", "1", "form of the policy that was flown; nothing: a constant threshold and moment", "str"),
        Column("theta", "1", "its parameters in the units of the form, with spaces between them", "str"),
        Column("speed_mps", "m/s", "approach speed that was asked for"),
        Column("angle_deg", "deg", "approach angle above the horizontal that was asked for"),
        Column("h_plane_m", "m", "height of the plane that the vehicle computed its cues for, in W"),
        Column("h_surface_m", "m", "height of the ceiling's surface in W, where it was measured"),
        Column("t_trigger_s", "s", "time of the first sample after the trigger; NaN: it did not trigger"),
        Column("trigger_age_s", "s", "how long before that sample the trigger fired, as far as the log can tell"),
        Column(
            "n_legs",
            "1",
            "feet on the ceiling at the end: 4 stands for three or four where the judge pooled them, 2 for one or two",
        ),
        Column("body_contact", "1", "1 if body or propellers touched the ceiling"),
        Column("reward", "1", "return that the learner was given"),
        Column("judged_by", "1", "who judged the outcome: operator, tracking, simulator, a reward class ...", "str"),
        Column(
            "usable", "1", "false: the log itself says that this is no valid flight, or its data are broken", "bool"
        ),
        Column("note", "1", "why it is not usable, and what else a reader must know", "str"),
    ],
)
"""One row a flight: what was asked, and what came of it with who judged it."""


def markdown() -> str:
    """Both tables as they stand in docs/FLIGHT_DATA.md."""
    parts = []
    for title, table in (("### A sample", SAMPLES), ("### A flight", FLIGHTS)):
        rows = [f"| `{c.name}` | {_UNITS.get(c.kind, c.unit)} | {c.doc} |" for c in table.values()]
        parts.append("\n".join([title, "", "| column | unit | what it is |", "|---|---|---|", *rows]))
    return "\n\n".join(parts) + "\n"


_UNITS = {"str": "text", "bool": "yes, no", "i4": "number"}

POSE = tuple(n for stem in ("p", "v", "q", "w") for n in SAMPLES if n.startswith(f"{stem}_"))
"""What the flight core needs at least: position, velocity, attitude, rates."""

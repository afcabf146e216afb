"""Random landings flown by both engines, and how far apart they end up."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from engine import Array, Engine, Flight, Steps

import ivl
from ivl import model
from ivl.world import Trace

GEAR_SETS = ("table1", "as_simulated")
AFTER_S = (0.02, 0.05, 0.1)  # instants after the impact at which the motion is compared
ARGUMENTS = ("speed_mps", "angle_deg", "rrev_c_per_s", "moment_y_Nmm", "stream")
VARIANTS = 32  # of a landing, to tell whether its outcome hangs on a hair
VARIANT_SHARE = 1.0e-3  # by which they differ

RECORD = np.dtype(
    [
        ("set", "i4"), ("gear", "i4"), ("speed_mps", "f8"), ("angle_deg", "f8"), ("rrev_c_per_s", "f8"),
        ("moment_y_Nmm", "f8"), ("stream", "i4"), ("n_legs", "i4"), ("n_legs_mj", "i4"), ("same_order", "?"),
        ("hit", "?"), ("hit_mj", "?"),
        ("plate", "?"), ("plate_mj", "?"), ("plate_first", "?"), ("dt_impact_s", "f8"), ("dtheta_impact_deg", "f8"),
        ("dp_m", "f8", len(AFTER_S)), ("da_deg", "f8", len(AFTER_S)), ("clean", "?", len(AFTER_S)),
    ]
)  # fmt: skip


@dataclass(frozen=True)
class Landing:
    """What is flown: the arguments of `World.trace` and the world they are for."""

    gear_set: str
    gear: str
    speed_mps: float
    angle_deg: float
    rrev_c_per_s: float
    moment_y_Nmm: float
    stream: int

    def arguments(self) -> dict[str, Any]:
        """For `World.trace`."""
        return {name: getattr(self, name) for name in ARGUMENTS}


def draw(
    n: int,
    seed: int,
    speeds_mps: tuple[float, float] = (0.5, 4.0),
    angles_deg: tuple[float, float] = (20.0, 90.0),
    moments_Nmm: tuple[float, float] = (3.0, 11.0),
) -> list[Landing]:
    """`n` landings, uniform over ranges, those of the paper unless told, and over the twelve gears."""
    rng = np.random.default_rng(seed)
    gears = [(s, g) for s in GEAR_SETS for g in model.list_gears(s)]
    result = []
    for i in range(n):
        speed, angle = rng.uniform(*speeds_mps), rng.uniform(*angles_deg)
        rrev, moment = rng.uniform(2.0, 7.0), rng.uniform(*moments_Nmm)
        result.append(Landing(*gears[i % len(gears)], speed, angle, rrev, moment, stream=i))
    return result


def split(landings: Sequence[Landing], **overrides: float) -> tuple[list[Landing], list[Landing]]:
    """Those that touch the surface and those that do not, in order, as the project's simulator has it."""
    hits = np.zeros(len(landings), dtype=bool)
    for key in {(a.gear_set, a.gear) for a in landings}:
        chosen = [i for i, a in enumerate(landings) if (a.gear_set, a.gear) == key]
        columns = [[getattr(landings[i], name) for i in chosen] for name in ARGUMENTS]
        out = ivl.World("habas2021", key[1], key[0], **overrides).rollouts(*columns[:4], stream=columns[4])
        hits[chosen] = np.isfinite(out.t_impact_s)
    return [a for a, hit in zip(landings, hits, strict=True) if hit], [
        a for a, hit in zip(landings, hits, strict=True) if not hit
    ]


def compare(
    landings: Sequence[Landing],
    plates: str = "native",
    steps: Steps | None = None,
    threads: int = 2,
    **overrides: float,
) -> np.recarray[Any, Any]:
    """Fly each landing in both engines; one record of `RECORD` each, in order.

    Args:
        landings: What to fly.
        plates: Contact of the plates in MuJoCo, see `Engine`.
        steps: How MuJoCo integrates.
        threads: Worker threads; each has engines of its own.
        overrides: Parameters of the worlds by dotted name.
    """
    parts = [list(range(i, len(landings), threads)) for i in range(threads)]
    records = np.zeros(len(landings), dtype=RECORD)

    def work(part: list[int]) -> None:
        engines: dict[tuple[str, str], tuple[ivl.World, Engine]] = {}
        for i in part:
            key = (landings[i].gear_set, landings[i].gear)
            if key not in engines:
                world = ivl.World("habas2021", key[1], key[0], **overrides)
                engines[key] = (world, Engine(world, plates))
            world, engine = engines[key]
            trace = world.trace(**landings[i].arguments())
            records[i] = _record(landings[i], trace, engine.fly(trace, steps))

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, parts))
    return records.view(np.recarray)


def undecided(landing: Landing, seed: int = 0, **overrides: float) -> float:
    """Share of close variants of a landing that stick another number of feet than the most frequent one.

    Speed, moment and angle vary by 0.1 %: a landing that answers differently then has no outcome to agree on.
    """
    world = ivl.World("habas2021", landing.gear, landing.gear_set, **overrides)
    rng = np.random.default_rng(seed)
    factor = 1.0 + VARIANT_SHARE * rng.uniform(-1.0, 1.0, (3, VARIANTS))
    out = world.rollouts(
        landing.speed_mps * factor[0],
        np.minimum(landing.angle_deg * factor[1], 90.0 if landing.angle_deg <= 90.0 else 180.0),
        landing.rrev_c_per_s,
        landing.moment_y_Nmm * factor[2],
        stream=landing.stream,
    )
    return 1.0 - float(np.bincount(out.n_legs).max()) / VARIANTS


def rotation_deg(a_xyzw: Array, b_xyzw: Array) -> Array:
    """Angle between two attitudes, degrees; arrays of quaternions, shape (..., 4)."""
    # the chord keeps its digits at small angles, unlike the arc cosine of the product
    chord = np.minimum(np.linalg.norm(a_xyzw - b_xyzw, axis=-1), np.linalg.norm(a_xyzw + b_xyzw, axis=-1))
    return np.degrees(4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))


def _record(landing: Landing, trace: Trace, flight: Flight) -> tuple[Any, ...]:
    out, rows = trace.outcome, trace.rows
    hit = bool(np.isfinite(out.t_impact_s))
    at = [_row_after(out.t_impact_s, dt, len(rows)) for dt in AFTER_S] if hit else [0] * len(AFTER_S)
    plate = bool(out.body_contact or out.base_contact)
    first = bool(plate and _feet_at_impact(trace) == 0)
    return (
        GEAR_SETS.index(landing.gear_set), model.list_gears(landing.gear_set).index(landing.gear),
        landing.speed_mps, landing.angle_deg, landing.rrev_c_per_s, landing.moment_y_Nmm, landing.stream,
        int(out.n_legs), flight.n_legs, tuple(out.leg_order) == flight.leg_order,
        hit, bool(np.isfinite(flight.t_impact_s)), plate, flight.body_contact or flight.base_contact, first,
        flight.t_impact_s - out.t_impact_s, flight.theta_impact_deg - out.theta_impact_deg,
        np.linalg.norm(flight.p_m[at] - rows.p_WB_m[at], axis=1) if hit else [np.nan] * len(AFTER_S),
        rotation_deg(flight.q_xyzw[at], rows.q_WB[at]) if hit else [np.nan] * len(AFTER_S),
        [not flight.t_plate_s < flight.t_s[i] for i in at],
    )  # fmt: skip


def _row_after(t_impact_s: float, dt_s: float, n_rows: int) -> int:
    return min(int(np.ceil((t_impact_s + dt_s) / 0.002)), n_rows - 1)


def _feet_at_impact(trace: Trace) -> int:
    row = min(int(trace.outcome.t_impact_s / 0.002) + 1, len(trace.rows) - 1)
    return int((trace.rows.foot_state[row] == 2).sum())

"""What an importer is told, and what it hands over: the two sides of every module in `formats`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from ivl.errors import ConfigError
from ivl.flight.schema import POSE, SAMPLES
from ivl.flight.store import Flight, FloatArray
from ivl.flight.table import Rule, Table

GAP_S = 1.0
"""A pause of the clock that is longer than this ends a flight."""
LAST, ALL = "last", "all"

_FROZEN_S, _FROZEN_M = 0.15, 0.1


@dataclass(frozen=True)
class Given:
    """What the person who imports says about the flights; None, "" or empty: nothing.

    Attributes:
        licence: Terms under which the data may be passed on.
        threshold_per_s: Policy, where the log does not say; 1/s.
        moment_Nmm: Policy, where the log does not say; N mm.
        speed_mps: Approach speed, where the log does not say; m/s.
        angle_deg: Approach angle, where the log does not say; degrees.
        h_plane_m: Height of the plane of the cues, where the log does not say; m.
        h_surface_m: Height of the ceiling's surface, m.
        outcomes: Feet that hold at the end of each flight, in the order of the table; None: as the log says.
        judged_by: Who says so.
        attempts: "last" of each rollout, or "all".
        rules: Columns that a log calls otherwise.
    """

    licence: str = ""
    threshold_per_s: float | None = None
    moment_Nmm: float | None = None
    speed_mps: float | None = None
    angle_deg: float | None = None
    h_plane_m: float | None = None
    h_surface_m: float | None = None
    outcomes: Sequence[int | None] = ()
    judged_by: str = ""
    attempts: str = LAST
    rules: Sequence[Rule] = ()


@dataclass(frozen=True)
class Log:
    """What an importer made of its files.

    Attributes:
        flights: In the order flown.
        files: What was read.
        frames: How the log's frames and signs were turned into those of the schema.
        clock: What the times are, and at which rate samples came.
        absent: Why columns are not there, by name; for the others nobody needs to be told.
        notes: What else a reader must know, one sentence each.
    """

    flights: Sequence[Flight]
    files: Sequence[Path]
    frames: str
    clock: str
    absent: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Format:
    """One kind of log.

    Attributes:
        name: As it is written behind `--format`.
        doc: What it is, in one line.
        load: Reads the files; raises ConfigError with one line for whatever is wrong with them.
    """

    name: str
    doc: str
    load: Callable[[Sequence[Path], Given], Log]


def with_rules(rules: Sequence[Rule], given: Given, table: Table) -> list[Rule]:
    """The rules of a format for the columns that a table has, with those of the person in front.

    Raises:
        ConfigError: A column that the person named is not there.
    """
    for rule in given.rules:
        table.need([rule.variable], "--map")
    own = {rule.target for rule in given.rules}
    return [*given.rules, *(r for r in rules if r.target not in own and r.variable in table.columns)]


def fresh_only(columns: dict[str, FloatArray]) -> None:
    """Forget tracked poses that only repeat the one before: the tracking saw nothing new there."""
    names = [name for name in columns if name.startswith("track_")]
    if names:
        pose = np.stack([columns[name] for name in names], axis=1)
        repeated = np.zeros(len(pose), dtype=bool)
        repeated[1:] = (pose[1:] == pose[:-1]).all(axis=1)
        for name in names:
            columns[name] = np.where(repeated, np.nan, columns[name])


def frozen_from(flight: Flight) -> float | None:
    """When the vehicle's own state stopped in the log while the tracking saw it move, s; None: it did not."""
    names = [name for name in POSE if flight.has(name)]
    if not names or not flight.has("track_p_x_m"):
        return None
    t_s, track = flight["t_s"], flight.stack("track_p", "xyz", "m")
    changed = (np.diff(np.stack([flight[name] for name in names]), axis=1) != 0).any(axis=0)
    edges = np.flatnonzero(np.concatenate([[True], changed, [True]]))
    for first, end in pairwise(edges):
        seen = track[first:end][np.isfinite(track[first:end]).all(axis=1)]
        if t_s[end - 1] - t_s[first] >= _FROZEN_S and len(seen) and np.ptp(seen, axis=0).max() >= _FROZEN_M:
            return float(t_s[first])
    return None


def parse_rule(text: str) -> Rule:
    """A rule as people write it: COLUMN=VARIABLE or COLUMN=VARIABLE*FACTOR.

    Raises:
        ConfigError: It is none, or the schema has no such column.
    """
    target, equals, rest = text.partition("=")
    variable, star, factor = rest.rpartition("*")
    if not star:
        variable, factor = rest, "1"
    try:
        scale = float(factor)
    except ValueError:
        scale = float("nan")
    if not equals or not variable or not np.isfinite(scale):
        raise ConfigError(f"--map {text}: expected COLUMN=VARIABLE or COLUMN=VARIABLE*FACTOR")
    if target not in SAMPLES or target in ("flight", "t_s"):
        raise ConfigError(f"--map {text}: {target}: no such column in the schema of flights")
    return Rule(target, variable, scale)

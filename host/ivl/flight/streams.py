"""Several streams of samples on one clock, each with its own rate, become one table of samples, cut into flights.

The rows are those of the fastest stream with a part of the vehicle's pose. What moves is interpolated on them;
commands, phases and what the vehicle computed hold their last value.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ivl.errors import ConfigError
from ivl.flight.log import GAP_S, Given, fresh_only
from ivl.flight.phases import APPROACH, READY
from ivl.flight.schema import POSE
from ivl.flight.store import FloatArray
from ivl.flight.table import IntArray, Rule, Table, is_folder, samples, shorten

_SMOOTH = ("p_", "v_", "q_", "w_", "f_", "track_", "rotor_", "battery_")
_STATE_S, _TRACK_S, _PERIODS = 0.25, 0.05, 3
"""Neighbours further apart than this, and than so many usual periods, are not interpolated between."""
N_SAMPLES_MIN = 10
"""A piece with fewer samples is no flight."""


@dataclass(frozen=True)
class Stream:
    """Samples of one log block, event or topic.

    Attributes:
        source: File that it comes from.
        name: What the log calls the stream.
        t_s: Its times on the common clock, rising.
        columns: Columns of the schema, and others that the importer needs, by name.
        variables: Everything that it has, as the log names it, also with the name of the stream in front.
    """

    source: Path
    name: str
    t_s: FloatArray
    columns: Mapping[str, FloatArray]
    variables: frozenset[str]

    def overlaps(self, other: "Stream") -> bool:
        """True if both have samples in the same span of time."""
        return bool(self.t_s[0] <= other.t_s[-1] and other.t_s[0] <= self.t_s[-1])

    def period_s(self) -> float:
        """Usual time between two samples, s."""
        return float(np.median(np.diff(self.t_s))) if len(self.t_s) > 1 else float("nan")


@dataclass(frozen=True)
class Merged:
    """Samples on common rows.

    Attributes:
        t_s: Times, rising.
        columns: Columns by name.
        sources: File that each row comes from.
        clock: What was done, in words.
    """

    t_s: FloatArray
    columns: Mapping[str, FloatArray]
    sources: Sequence[Path]
    clock: str


def files_of(path: Path, suffixes: Sequence[str]) -> list[Path]:
    """The file itself, or the files of a folder in the order of their names.

    Raises:
        ConfigError: The folder has none, or cannot be read.
    """
    if not is_folder(path):
        return [path]
    try:
        files = sorted(file for file in path.iterdir() if file.suffix in suffixes and not file.name.startswith("."))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    if not files:
        raise ConfigError(f"{path}: no {' or '.join(suffixes)} file in this folder")
    return files


def make(name: str, table: Table, t_s: FloatArray, groups: Sequence[Sequence[Rule]], given: Given) -> Stream:
    """What one log block, event or topic has.

    Args:
        name: What the log calls the stream.
        table: Its variables.
        t_s: Its times.
        groups: Rules of the format, in the order of preference; a group belongs together.
        given: Says how variables are called that the format does not know; "NAME:variable" means this stream alone.

    Raises:
        ConfigError: A cell is no number, not finite, or beyond all reason.
    """
    own = [replace(rule, variable=rule.variable.removeprefix(f"{name}:")) for rule in given.rules]
    chosen = {rule.target: rule for rule in own if rule.variable in table.columns}
    for whole in (True, False):
        for group in groups:
            there = [rule for rule in group if rule.variable in table.columns]
            taken = whole and any(rule.target in chosen for rule in group)
            parts = not whole and not group[0].target.startswith(("q_", "track_q_"))
            if there and not taken and (len(there) == len(group) or parts):
                chosen = {rule.target: rule for rule in there} | chosen
    variables = [*table.columns, *(f"{name}:{column}" for column in table.columns)]
    columns = samples(table, list(chosen.values()))
    fresh_only(columns)
    return Stream(table.path, name, t_s, columns, frozenset(variables))


def known(found: Sequence[Stream], given: Given, where: str) -> list[Stream]:
    """The streams in which something is known.

    Raises:
        ConfigError: That is none, or a variable that the person named is nowhere.
    """
    variables = {name for stream in found for name in stream.variables}
    there = shorten(", ".join(sorted(name for name in variables if ":" not in name)), 100)
    for rule in given.rules:
        if rule.variable not in variables:
            raise ConfigError(f"{where}: variable {rule.variable} is missing for --map; there are {there}")
    result = [stream for stream in found if stream.columns]
    if not result:
        raise ConfigError(f"{where}: no variable that is known; there are {there} (--map can name them)")
    return result


def recordings(streams: Sequence[Stream]) -> list[list[Stream]]:
    """Sort streams into recordings: two with the same columns at the same time belong to different ones."""
    result: list[list[Stream]] = []
    for stream in streams:
        for members in result:
            if not any(set(stream.columns) == set(m.columns) and stream.overlaps(m) for m in members):
                members.append(stream)
                break
        else:
            result.append([stream])
    return result


def merge(streams: Sequence[Stream]) -> Merged:
    """Streams of one recording on common rows."""
    parts = {name: _providers(streams, name) for stream in streams for name in stream.columns}
    candidates = [name for name in parts if name in POSE] or list(parts)
    base = parts[max(candidates, key=lambda name: sum(len(s.t_s) for s in parts[name]))]
    t_s = np.concatenate([s.t_s for s in base])
    columns = {}
    for name, members in parts.items():
        t_own_s = np.concatenate([s.t_s for s in members])
        values = np.concatenate([_continuous(s, name) for s in members])
        if members == base:
            columns[name] = np.concatenate([s.columns[name] for s in base])
        elif name.startswith(_SMOOTH):
            columns[name] = _between(t_s, t_own_s, values, _TRACK_S if name.startswith("track_") else _STATE_S)
        else:
            columns[name] = _held(t_s, t_own_s, values)
    for stem in ("q", "track_q"):
        _normalise(columns, [f"{stem}_{axis}" for axis in "xyzw"])
    sources = [s.source for s in base for _ in range(len(s.t_s))]
    return Merged(t_s, columns, sources, _words(streams, base))


def _words(streams: Sequence[Stream], base: Sequence[Stream]) -> str:
    rates = ", ".join(f"{s.name} every {1000 * s.period_s():.3g} ms" for s in streams)
    if len(streams) == len(base):
        return rates
    return f"{rates}; the rows are those of {base[0].name}; of the others, motion is interpolated and the rest held"


def _continuous(stream: Stream, name: str) -> FloatArray:
    """A column; one of a quaternion without changes of sign, so that it can be interpolated."""
    stem, axis = name[:-1], name[-1]
    if stem not in ("q_", "track_q_") or any(f"{stem}{a}" not in stream.columns for a in "xyzw"):
        return stream.columns[name]
    q = np.stack([stream.columns[f"{stem}{a}"] for a in "xyzw"], axis=1)
    known = np.flatnonzero(np.isfinite(q).all(axis=1))
    turns = np.where((q[known][1:] * q[known][:-1]).sum(axis=1) < 0, -1.0, 1.0)
    sign = np.ones(len(q))
    sign[known] = np.concatenate([[1.0], np.cumprod(turns)])[: len(known)]
    return q[:, "xyzw".index(axis)] * sign


def _normalise(columns: dict[str, FloatArray], names: Sequence[str]) -> None:
    if all(name in columns for name in names):
        norm = np.sqrt(sum(columns[name] ** 2 for name in names))
        for name in names:
            columns[name] = columns[name] / np.where(norm > 0, norm, np.nan)


def _between(t_s: FloatArray, t_own_s: FloatArray, values: FloatArray, gap_s: float) -> FloatArray:
    """Values between their neighbours in time; NaN outside, and where the neighbours are too far apart."""
    known = np.isfinite(values)
    t_own_s, values = t_own_s[known], values[known]
    if len(values) < 2:
        return np.full(len(t_s), np.nan)
    after = np.clip(np.searchsorted(t_own_s, t_s), 1, len(t_own_s) - 1)
    gap_s = max(gap_s, _PERIODS * float(np.median(np.diff(t_own_s))))
    near = (t_own_s[after] - t_own_s[after - 1] <= gap_s) & (t_s >= t_own_s[0]) & (t_s <= t_own_s[-1])
    return np.where(near, np.interp(t_s, t_own_s, values), np.nan)


def _providers(streams: Sequence[Stream], name: str) -> list[Stream]:
    """Streams that have a column, one after the other in time; of two at the same time that with more samples."""
    chosen: list[Stream] = []
    for stream in sorted((s for s in streams if name in s.columns), key=lambda s: -len(s.t_s)):
        if not any(stream.overlaps(other) for other in chosen):
            chosen.append(stream)
    return sorted(chosen, key=lambda s: float(s.t_s[0]))


def _held(t_s: FloatArray, t_own_s: FloatArray, values: FloatArray) -> FloatArray:
    """The last value at or before each time; NaN if there is none, or if it is older than `GAP_S`."""
    index = np.searchsorted(t_own_s, t_s, side="right") - 1
    known = index >= 0
    age_s = t_s - t_own_s[np.maximum(index, 0)]
    return np.where(known & (age_s <= GAP_S), values[np.maximum(index, 0)], np.nan)


def flights(merged: Merged) -> Iterator[IntArray]:
    """Rows of each flight, in the order flown.

    Rows without a whole pose (as far as the log has one) are left out. A flight ends with a pause of the clock, and
    where the flight core begins its next landing: at READY, or when it is back before a flip; without phases at a new
    policy.
    """
    pose = [merged.columns[name] for name in POSE if name in merged.columns]
    rows = np.flatnonzero(np.isfinite(pose).all(axis=0)) if pose else np.arange(len(merged.t_s))
    if not len(rows):
        return
    starts = np.diff(merged.t_s[rows]) > GAP_S
    phase = merged.columns.get("phase")
    if phase is not None:
        before, now = phase[rows][:-1], phase[rows][1:]
        starts |= ((now == READY) & (before != READY)) | ((now <= APPROACH) & (before > APPROACH))
    elif "ivl.policy_seq" in merged.columns:
        policy = merged.columns["ivl.policy_seq"][rows]
        starts |= (np.diff(policy) != 0) & np.isfinite(np.diff(policy))
    edges = np.flatnonzero(np.concatenate([[True], starts, [True]]))
    pieces = [rows[first:end] for first, end in pairwise(edges)]
    flown = [piece for piece in pieces if phase is not None and (phase[piece] >= APPROACH).any()]
    yield from (piece for piece in flown or pieces if len(piece) >= N_SAMPLES_MIN)

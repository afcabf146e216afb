"""Several streams of samples on one clock, each with its own rate, become one table of samples, cut into flights.

The rows are those of the fastest stream with a part of the vehicle's pose; the others hold their last value.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from ivl.errors import ConfigError
from ivl.flight.log import GAP_S, Given
from ivl.flight.phases import APPROACH, READY
from ivl.flight.schema import POSE
from ivl.flight.store import FloatArray
from ivl.flight.table import IntArray, Rule, Table, samples, shorten

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
        ConfigError: The folder has none.
    """
    if not path.is_dir():
        return [path]
    files = sorted(file for file in path.iterdir() if file.suffix in suffixes and not file.name.startswith("."))
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
    return Stream(table.path, name, t_s, samples(table, list(chosen.values())), frozenset(variables))


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
    """Streams of one recording on common rows; a value is held for at most `GAP_S`."""
    parts = {name: _providers(streams, name) for stream in streams for name in stream.columns}
    candidates = [name for name in parts if name in POSE] or list(parts)
    base = parts[max(candidates, key=lambda name: sum(len(s.t_s) for s in parts[name]))]
    t_s = np.concatenate([s.t_s for s in base])
    columns = {}
    for name, members in parts.items():
        t_own_s = np.concatenate([s.t_s for s in members])
        columns[name] = _held(t_s, t_own_s, np.concatenate([s.columns[name] for s in members]))
    sources = [s.source for s in base for _ in range(len(s.t_s))]
    rates = ", ".join(f"{s.name} every {1000 * s.period_s():.3g} ms" for s in streams)
    held = f"; the rows are those of {base[0].name}, the others hold their last value" if len(streams) > 1 else ""
    return Merged(t_s, columns, sources, rates + held)


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
    where the flight core begins its next landing: at READY, or without phases at a new policy.
    """
    pose = [merged.columns[name] for name in POSE if name in merged.columns]
    rows = np.flatnonzero(np.isfinite(pose).all(axis=0)) if pose else np.arange(len(merged.t_s))
    if not len(rows):
        return
    starts = np.diff(merged.t_s[rows]) > GAP_S
    phase = merged.columns.get("phase")
    if phase is not None:
        starts |= (phase[rows][1:] == READY) & (phase[rows][:-1] != READY)
    elif "ivl.policy_seq" in merged.columns:
        policy = merged.columns["ivl.policy_seq"][rows]
        starts |= (np.diff(policy) != 0) & np.isfinite(np.diff(policy))
    edges = np.flatnonzero(np.concatenate([[True], starts, [True]]))
    pieces = [rows[first:end] for first, end in pairwise(edges)]
    flown = [piece for piece in pieces if phase is not None and (phase[piece] >= APPROACH).any()]
    yield from (piece for piece in flown or pieces if len(piece) >= N_SAMPLES_MIN)

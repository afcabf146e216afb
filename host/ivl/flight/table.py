"""The border for foreign tables: whatever a file holds, it ends in checked numbers or in one line of text.

That line names the file, the place (line of a text file, row of a binary one), the column, and what is wrong there.
All importers read their files through this module, so that each kind of damage is found in one place.
"""

import csv
import io
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl.errors import ConfigError
from ivl.flight.schema import SAMPLES

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.intp]
Values = Sequence[str] | FloatArray

LIMITS = {
    "s": 1e11, "m": 1e4, "m/s": 1e4, "rad/s": 1e6, "m/s^2": 1e5, "1/s": 1e6, "N": 1e4, "N m": 1e4, "V": 1e4, "1": 1e6,
}  # fmt: skip
"""Largest magnitude of a number by its unit. No vehicle comes near; a number beyond it is damage."""
_HUGE = 1e30
"""No number of any log is larger, whatever its unit."""
_NORM_SLACK = 0.1
_SHOWN = 40
_NPZ_BYTES_MAX = 2**30
_NPZ_ERRORS = (ValueError, OSError, EOFError, LookupError, TypeError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""What numpy and zipfile raise for damaged archives; NotImplementedError is a RuntimeError."""
_MAGIC = {
    b"\x1f\x8b": "is compressed (gzip): unpack it first",
    b"PK": "is a ZIP archive, not text",
    b"\xff\xfe": "is UTF-16 text: save it as UTF-8",
    b"\xfe\xff": "is UTF-16 text: save it as UTF-8",
}


@dataclass(frozen=True)
class Rule:
    """How a column of a log becomes one of the schema.

    Attributes:
        target: Column of the schema.
        variable: Column of the log.
        scale: Factor from the log's unit and sign to the schema's.
        needed: Every sample must have a number; otherwise an empty cell or "nan" stands for "unknown".
        nothing: Number of the log that stands for "unknown".
    """

    target: str
    variable: str
    scale: float = 1.0
    needed: bool = False
    nothing: float | None = None


def rules(
    stem: str, axes: str, suffix: str, pattern: str, scale: float | Sequence[float] = 1.0, needed: bool = False
) -> list[Rule]:
    """Rules for the components of a vector: `rules("v", "xyz", "mps", "stateEstimate.v{}")`."""
    scales = [scale] * len(axes) if isinstance(scale, float) else scale
    end = f"_{suffix}" if suffix else ""
    return [Rule(f"{stem}_{a}{end}", pattern.format(a), s, needed) for a, s in zip(axes, scales, strict=True)]


@dataclass(frozen=True)
class Table:
    """Columns of one file, not yet checked.

    Attributes:
        path: The file.
        columns: Text or numbers by name, all of the same length.
        places: Where each row stands in the file, counted from 1.
        place: What is counted: "line" of a text file, "row" of a binary one.
    """

    path: Path
    columns: Mapping[str, Values]
    places: IntArray
    place: str = "line"

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.places)

    def fault(self, row: int, column: str, what: str) -> ConfigError:
        """The error for one cell."""
        return ConfigError(f"{self.path}: {self.place} {self.places[row]}: {shorten(column)}: {what}")

    def take(self, rows: IntArray | slice) -> "Table":
        """Some of the rows."""
        index = np.arange(len(self))[rows]
        columns: dict[str, Values] = {
            name: values[index] if isinstance(values, np.ndarray) else [values[i] for i in index]
            for name, values in self.columns.items()
        }
        return Table(self.path, columns, self.places[index], self.place)

    def need(self, names: Sequence[str], what: str) -> None:
        """Refuse a table that lacks a column.

        Args:
            names: Columns that must be there.
            what: What they are needed for.

        Raises:
            ConfigError: A column is missing; the message tells what is there.
        """
        for name in names:
            if name not in self.columns:
                found = shorten(", ".join(self.columns), 100)
                raise ConfigError(f"{self.path}: column {name} is missing for {what}; there are {found}")

    def text(self, name: str) -> list[str]:
        """A column as text."""
        return [str(value) for value in self.columns[name]]

    def numbers(self, name: str, needed: bool = False) -> FloatArray:
        """A column as numbers; an empty cell is NaN.

        Args:
            name: Column of the log.
            needed: Refuse empty cells and NaN.

        Raises:
            ConfigError: A cell is no number, is infinite, or is unknown where a number is needed.
        """
        values = self.columns[name]
        numbers = values.astype(np.float64) if isinstance(values, np.ndarray) else self._parse(name, values)
        bad = ~(np.abs(numbers) <= _HUGE) & (needed | ~np.isnan(numbers))
        if bad.any():
            row = int(np.argmax(bad))
            cell = shorten(str(values[row]).strip())
            raise self.fault(row, name, f"value {cell} where a number must be" if cell else "is empty")
        return numbers

    def _parse(self, name: str, cells: Sequence[str]) -> FloatArray:
        filled = [cell or "nan" for cell in cells]
        try:
            numbers = np.array(filled, dtype=np.float64)
        except ValueError:
            numbers = None
        if numbers is None or any("_" in cell for cell in filled):
            row = next(i for i, cell in enumerate(filled) if not _is_number(cell))
            raise self.fault(row, name, f"value '{shorten(cells[row])}' is no number")
        return numbers


def shorten(text: str, n: int = _SHOWN) -> str:
    """Text of a message: in one line, cut off where it is long."""
    text = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return text if len(text) <= n else text[: n - 3] + "..."


def is_folder(path: Path) -> bool:
    """Whether this is a folder; what cannot be looked at is none."""
    try:
        return path.is_dir()
    except OSError:
        return False


def read_bytes(path: Path) -> bytes:
    """The content of a file.

    Raises:
        ConfigError: There is none, it is a folder, it cannot be read, or it is empty.
    """
    if is_folder(path):
        raise ConfigError(f"{path}: is a folder, this format reads files")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    if not data:
        raise ConfigError(f"{path}: is empty")
    return data


def read_text(path: Path) -> str:
    """The content of a text file in UTF-8, with or without a byte-order mark.

    Raises:
        ConfigError: As `read_bytes`; or it is no text.
    """
    data = read_bytes(path)
    for magic, what in _MAGIC.items():
        if data.startswith(magic):
            raise ConfigError(f"{path}: {what}")
    if b"\0" in data:
        raise ConfigError(f"{path}: line {data[: data.index(0)].count(10) + 1}: is binary, not text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ConfigError(f"{path}: line {line}: byte {data[error.start]:#04x} is no UTF-8 text") from error


def read_rows(path: Path) -> list[tuple[int, list[str]]]:
    """Rows of a comma-separated file with their line numbers; cells without blanks around them.

    Raises:
        ConfigError: As `read_text`; or a quotation mark is never closed.
    """
    reader = csv.reader(io.StringIO(read_text(path), newline=""), strict=True)
    rows = []
    try:
        for row in reader:
            rows.append((reader.line_num, [cell.strip() for cell in row]))
    except csv.Error as error:
        raise ConfigError(f"{path}: line {reader.line_num}: {error}") from error
    return rows


def header_of(path: Path, row: tuple[int, list[str]]) -> list[str]:
    """Column names.

    Raises:
        ConfigError: A name is empty or given twice.
    """
    line, names = row
    for i, name in enumerate(names):
        if not name:
            raise ConfigError(f"{path}: line {line}: column {i + 1} has no name")
        if name in names[:i]:
            raise ConfigError(f"{path}: line {line}: column {shorten(name)} is there twice")
    return names


def make_table(path: Path, names: Sequence[str], rows: Sequence[tuple[int, list[str]]]) -> Table:
    """A table of text.

    Raises:
        ConfigError: A row has another number of fields than the header, or there is no row.
    """
    for line, row in rows:
        if len(row) != len(names):
            raise ConfigError(f"{path}: line {line}: {len(row)} fields, the header has {len(names)}")
    if not rows:
        raise ConfigError(f"{path}: has a header, but no data")
    columns = dict(zip(names, ([*cells] for cells in zip(*(row for _, row in rows), strict=True)), strict=True))
    return Table(path, columns, np.array([line for line, _ in rows], dtype=np.intp))


def read_csv(path: Path) -> Table:
    """A file with one header line; blank lines are skipped.

    Raises:
        ConfigError: As `read_rows`, `header_of` and `make_table`.
    """
    rows = [(line, row) for line, row in read_rows(path) if any(row)]
    if not rows:
        raise ConfigError(f"{path}: is empty")
    return make_table(path, header_of(path, rows[0]), rows[1:])


def read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an archive, whatever they are; nothing in it is run.

    Raises:
        ConfigError: It is no archive of numpy arrays, or it is too large.
    """
    data = read_bytes(path)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > _NPZ_BYTES_MAX:
            raise ConfigError(f"{path}: unpacks to {size} bytes (allowed {_NPZ_BYTES_MAX})")
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except _NPZ_ERRORS as error:
        raise ConfigError(f"{path}: is no archive of numpy arrays: {shorten(str(error), 100)}") from error


def read_npz(path: Path) -> Table:
    """An archive of numpy arrays; vectors become a column for each component: "pos_1", "pos_2" ...

    Raises:
        ConfigError: It is none, it is too large, or its arrays are no numbers of one length.
    """
    return _of_arrays(path, read_arrays(path))


def _of_arrays(path: Path, arrays: Mapping[str, npt.NDArray[Any]]) -> Table:
    columns: dict[str, Values] = {}
    lengths = {name: array.shape[0] if array.ndim else -1 for name, array in arrays.items()}
    n = next(iter(lengths.values()), 0)
    for name, array in arrays.items():
        if array.dtype.kind not in "iufb" or array.ndim not in (1, 2) or lengths[name] != n:
            raise ConfigError(f"{path}: {name}: is no column of {n} numbers, but {array.dtype} of shape {array.shape}")
        parts = array.reshape(n, -1) if n else array.reshape(0, 1)
        for i in range(parts.shape[1]):
            columns[name if array.ndim == 1 else f"{name}_{i + 1}"] = parts[:, i].astype(np.float64)
    if not n:
        raise ConfigError(f"{path}: holds no data")
    return Table(path, columns, np.arange(1, n + 1), "row")


def clock(table: Table, name: str, scale: float) -> FloatArray:
    """Times in seconds, rising strictly.

    Raises:
        ConfigError: A time is missing, or not later than the one before.
    """
    t_s = table.numbers(name, needed=True) * scale
    _limit(table, t_s, "s", name)
    late = np.flatnonzero(np.diff(t_s) <= 0)
    if len(late):
        row = int(late[0]) + 1
        before, now = (f"{t_s[i] / scale:.10g}" for i in (row - 1, row))
        raise table.fault(row, name, f"time {now} twice" if before == now else f"time {now} after {before}")
    return t_s


def samples(table: Table, rules: Sequence[Rule]) -> dict[str, FloatArray]:
    """Columns of the schema, in its units; quaternions have the length 1.

    Raises:
        ConfigError: A number is missing, not finite, or beyond all reason; or a quaternion is none.
    """
    result = {}
    for rule in rules:
        values = table.numbers(rule.variable, rule.needed)
        if rule.nothing is not None:
            values = np.where(values == rule.nothing, np.nan, values)
        values = values * rule.scale
        _limit(table, values, SAMPLES[rule.target].unit, rule.variable)
        result[rule.target] = values
    for stem in ("q", "track_q"):
        names = [f"{stem}_{axis}" for axis in "xyzw"]
        if all(name in result for name in names):
            _normalise(table, result, names, next(r.variable for r in rules if r.target == names[3]))
    return result


def _limit(table: Table, values: FloatArray, unit: str, name: str) -> None:
    huge = np.abs(values) > LIMITS[unit]
    if huge.any():
        row = int(np.argmax(huge))
        raise table.fault(
            row, name, f"value {shorten(str(table.columns[name][row]))} is beyond {LIMITS[unit]:g} {unit}"
        )


def _normalise(table: Table, columns: dict[str, FloatArray], names: Sequence[str], variable: str) -> None:
    norm = np.sqrt(sum(columns[name] ** 2 for name in names))
    bad = np.abs(norm - 1.0) > _NORM_SLACK
    if bad.any():
        row = int(np.argmax(bad))
        raise table.fault(row, variable, f"quaternion of length {norm[row]:.3g}, it must be 1")
    for name in names:
        columns[name] = columns[name] / norm


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell

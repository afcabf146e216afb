"""A folder of recorded flights.

manifest.json     what this is: source, licence, frames, clock, site, what is absent
flights.parquet   one row a flight: policy, approach, outcome and who judged it
samples.parquet   the time series, one row group a flight

flights = store.read(Path("flights/july"))
for flight in flights:
    print(flight.label, flight.info["n_legs"], flight["p_z_m"].max())
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import optional
from ivl.errors import ConfigError
from ivl.flight.schema import FLIGHTS, SAMPLES, SCHEMA_VERSION, Column

FloatArray = npt.NDArray[np.float64]

MANIFEST, FLIGHTS_FILE, SAMPLES_FILE = "manifest.json", "flights.parquet", "samples.parquet"
_TYPES = {"f8": "float64", "i4": "int32", "str": "string", "bool": "bool_"}
"""Names of Arrow's types. Arrow is loaded when a file is read or written, which most users of this module never do."""
_LINE = 200
_MANIFEST_FIELDS = ("format", "source", "licence", "frames", "clock", "absent", "notes")


@dataclass(frozen=True)
class Manifest:
    """What is known about all flights of a folder.

    Attributes:
        format: Name of the importer.
        source: Files that were read, as {"file": name, "sha256": digest}.
        licence: Terms under which the data may be passed on; "not stated" if nobody said.
        frames: How the log's frames and signs were turned into those of the schema.
        clock: What the times are, and at which rate samples came.
        absent: Columns of which the log has nothing, with the reason.
        notes: What else a reader must know, one sentence each.
    """

    format: str
    source: Sequence[Mapping[str, str]]
    licence: str
    frames: str
    clock: str
    absent: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Flight:
    """One recorded flight.

    Attributes:
        info: Row of the table of flights, by column name; NaN, "" where unknown.
        samples: Columns of the time series by name, each of shape (n_samples,); NaN where the log has nothing.
    """

    info: Mapping[str, Any]
    samples: Mapping[str, FloatArray]

    def __getitem__(self, column: str) -> FloatArray:
        """One column, shape (n_samples,)."""
        return self.samples[column]

    def __len__(self) -> int:
        """Number of samples."""
        return len(self.samples["t_s"])

    @property
    def label(self) -> str:
        """What the log calls it."""
        return str(self.info["label"])

    def has(self, *columns: str) -> bool:
        """True if the log has at least one number in each of these columns."""
        return all(bool(np.isfinite(self.samples[name]).any()) for name in columns)

    def stack(self, stem: str, axes: str, suffix: str = "") -> FloatArray:
        """Components side by side, shape (n_samples, n_axes): `stack("p", "xyz", "m")`."""
        end = f"_{suffix}" if suffix else ""
        return np.stack([self.samples[f"{stem}_{axis}{end}"] for axis in axes], axis=1)


@dataclass(frozen=True)
class Flights:
    """Flights of one folder, in the order flown."""

    manifest: Manifest
    flights: tuple[Flight, ...]

    def __iter__(self) -> Iterator[Flight]:
        """The flights in order."""
        return iter(self.flights)

    def __len__(self) -> int:
        """Number of flights."""
        return len(self.flights)

    def __getitem__(self, index: int) -> Flight:
        """One flight."""
        return self.flights[index]

    def usable(self) -> "Flights":
        """Only the flights that the log does not call invalid."""
        return Flights(self.manifest, tuple(f for f in self.flights if f.info["usable"]))


def make_flight(info: Mapping[str, Any], samples: Mapping[str, npt.ArrayLike]) -> Flight:
    """A flight with every column of the schema; what is not given is unknown.

    Raises:
        ConfigError: An unknown column, columns of different length, or times that are not finite and rising.
    """
    for given, table in ((info, FLIGHTS), (samples, SAMPLES)):
        unknown = sorted(set(given) - set(table))
        if unknown:
            raise ConfigError(f"flight {info.get('label', '?')}: {unknown[0]}: no such column in the schema of flights")
    columns = {name: np.asarray(values, dtype=np.float64) for name, values in samples.items() if name != "flight"}
    label = str(info.get("label", ""))
    n = len(columns["t_s"]) if "t_s" in columns else 0
    for name, values in columns.items():
        if values.shape != (n,):
            raise ConfigError(f"flight {label}: {name}: {values.shape} values where t_s has ({n},)")
    if not n or not np.isfinite(columns["t_s"]).all() or (np.diff(columns["t_s"]) <= 0).any():
        raise ConfigError(f"flight {label}: t_s: times must be finite and rising, from the first sample on")
    whole = {name: columns.get(name, np.full(n, np.nan)) for name in SAMPLES if name != "flight"}
    return Flight({name: _known(info.get(name), column) for name, column in FLIGHTS.items()}, whole)


def _known(value: Any, column: Column) -> Any:
    unknown = {"f8": float("nan"), "i4": 0, "str": "", "bool": True}[column.kind]
    if value is None:
        return unknown
    return {"f8": float, "i4": int, "str": str, "bool": bool}[column.kind](value)


def check_new(folder: Path) -> None:
    """Refuse a folder that holds something, before the work is done.

    Raises:
        ConfigError: The folder is not empty, or is a file.
    """
    try:
        if folder.is_symlink() or (folder.exists() and (not folder.is_dir() or any(folder.iterdir()))):
            raise ConfigError(f"{folder}: is there already: name a new folder")
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be written: {error.strerror or error}") from error


def write(folder: Path, flights: Flights) -> None:
    """Write a folder of flights: whole, or not at all.

    Raises:
        ConfigError: The folder holds something already, or cannot be written.
    """
    check_new(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent) as name:
            part = Path(name) / "flights"
            part.mkdir()
            _write_files(part, flights)
            part.rename(folder)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot be written: {error.strerror or error}") from error


def _write_files(folder: Path, flights: Flights) -> None:
    present = [n for n in SAMPLES if n == "flight" or any(f.has(n) for f in flights)]
    schema = _schema({name: SAMPLES[name] for name in present})
    pa, pq = _arrow()
    with pq.ParquetWriter(folder / SAMPLES_FILE, schema, compression="zstd") as writer:
        for number, flight in enumerate(flights):
            data = {n: np.full(len(flight), number, np.int32) if n == "flight" else flight[n] for n in present}
            writer.write_table(pa.table(data, schema=schema), row_group_size=len(flight))
    rows = [{**flight.info, "flight": number} for number, flight in enumerate(flights)]
    pq.write_table(pa.Table.from_pylist(rows, schema=_schema(FLIGHTS)), folder / FLIGHTS_FILE, compression="zstd")
    known = {name: getattr(flights.manifest, name) for name in _MANIFEST_FIELDS}
    manifest = {"schema_version": SCHEMA_VERSION, "n_flights": len(flights), **known, "units": _units(present)}
    (folder / MANIFEST).write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")


def read(folder: Path) -> Flights:
    """Read a folder of flights.

    Raises:
        ConfigError: It is none, or of another version, or damaged: one line that names the file.
    """
    path = folder / MANIFEST
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ConfigError(
            f"{folder}: no {MANIFEST}: this is no folder of flights (`ivl flight import` makes one)"
        ) from error
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: cannot be read: {_line(error)}") from error
    version = data.get("schema_version") if isinstance(data, dict) else None
    if version != SCHEMA_VERSION:
        raise ConfigError(f"{path}: schema_version: value {version!r}, this package reads {SCHEMA_VERSION}")
    manifest = _manifest(path, data)
    infos = _table(folder / FLIGHTS_FILE, FLIGHTS, FLIGHTS).to_pylist()
    samples = _table(folder / SAMPLES_FILE, SAMPLES, ("flight", "t_s"))
    if [info["flight"] for info in infos] != list(range(len(infos))):
        raise ConfigError(f"{folder / FLIGHTS_FILE}: flights are not numbered 0 .. {len(infos) - 1}")
    return Flights(manifest, tuple(_flights(infos, samples, folder / SAMPLES_FILE)))


def _manifest(path: Path, data: Mapping[str, Any]) -> Manifest:
    kinds = {"source": list, "absent": dict, "notes": list}
    for name in _MANIFEST_FIELDS:
        if not isinstance(data.get(name), kinds.get(name, str)):
            raise ConfigError(f"{path}: {name}: is missing or of another kind")
    if not all(isinstance(source, dict) for source in data["source"]):
        raise ConfigError(f"{path}: source: a file is no object")
    return Manifest(**{name: data[name] for name in _MANIFEST_FIELDS})


def _table(path: Path, known: Mapping[str, Column], needed: Iterable[str]) -> Any:
    """A Parquet file whose columns are of the schema; those of `needed` are there."""
    pa, pq = _arrow()
    try:
        table = pq.ParquetFile(path).read()
        table.validate(full=True)
    except (OSError, ValueError, pa.ArrowException) as error:
        raise ConfigError(f"{path}: cannot be read: {_line(error)}") from error
    for name in needed:
        if name not in table.column_names:
            raise ConfigError(f"{path}: column {name} is missing")
    for name in table.column_names:
        if name not in known or table.schema.field(name).type != getattr(pa, _TYPES[known[name].kind])():
            raise ConfigError(f"{path}: column {name} is none of version {SCHEMA_VERSION}, or of another type")
    return table


def _flights(infos: Sequence[Mapping[str, Any]], table: Any, path: Path) -> Iterator[Flight]:
    numbers = table.column("flight").to_numpy()
    if (np.diff(numbers) < 0).any():
        raise ConfigError(f"{path}: the flights are not in order")
    for info in infos:
        first, end = np.searchsorted(numbers, [info["flight"], info["flight"] + 1])
        part = table.slice(int(first), int(end - first))
        columns = {name: part.column(name).to_numpy() for name in part.column_names if name != "flight"}
        try:
            yield make_flight(info, columns)
        except ConfigError as error:
            raise ConfigError(f"{path}: {error}") from error


def _arrow() -> tuple[Any, Any]:
    """Arrow and its Parquet.

    Raises:
        MissingError: They are not installed.
    """
    return optional.needed("pyarrow", "flight"), optional.needed("pyarrow.parquet", "flight")


def _line(error: BaseException) -> str:
    """What an error says, in one line of reasonable length."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= _LINE else text[: _LINE - 3] + "..."


def _schema(columns: Mapping[str, Column]) -> Any:
    pa, _ = _arrow()
    fields = [
        pa.field(c.name, getattr(pa, _TYPES[c.kind])(), nullable=False, metadata={"unit": c.unit, "doc": c.doc})
        for c in columns.values()
    ]
    return pa.schema(fields, metadata={"ivl_schema_version": str(SCHEMA_VERSION)})


def _units(present: Sequence[str]) -> dict[str, str]:
    return {name: SAMPLES[name].unit for name in present} | {name: c.unit for name, c in FLIGHTS.items()}

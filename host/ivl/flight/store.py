"""A folder of recorded flights.

manifest.json     what this is: source, licence, frames, clock, site, what is absent
flights.parquet   one row a flight: policy, approach, outcome and who judged it
samples.parquet   the time series, one row group a flight

flights = store.read(Path("flights/july"))
for flight in flights:
    print(flight.label, flight.info["n_legs"], flight["p_z_m"].max())
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa  # type: ignore[import-untyped]
import pyarrow.parquet as pq  # type: ignore[import-untyped]

from ivl.errors import ConfigError
from ivl.flight.schema import FLIGHTS, SAMPLES, SCHEMA_VERSION, Column

FloatArray = npt.NDArray[np.float64]

MANIFEST, FLIGHTS_FILE, SAMPLES_FILE = "manifest.json", "flights.parquet", "samples.parquet"
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


def write(folder: Path, flights: Flights) -> None:
    """Write a folder of flights: whole, or not at all.

    Raises:
        ConfigError: The folder holds something already, or cannot be written.
    """
    try:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"{folder}: is there already: name a new folder")
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
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    version = data.get("schema_version") if isinstance(data, dict) else None
    if version != SCHEMA_VERSION:
        raise ConfigError(f"{path}: schema_version: value {version!r}, this package reads {SCHEMA_VERSION}")
    try:
        manifest = Manifest(**{name: data[name] for name in _MANIFEST_FIELDS})
        infos = pq.read_table(folder / FLIGHTS_FILE, schema=_schema(FLIGHTS)).to_pylist()
        table = pq.read_table(folder / SAMPLES_FILE)
    except (OSError, KeyError, TypeError, pa.ArrowException) as error:
        raise ConfigError(f"{folder}: damaged or not written by this package: {error}") from error
    return Flights(manifest, tuple(_flight(info, table, folder) for info in infos))


def _flight(info: Mapping[str, Any], table: pa.Table, folder: Path) -> Flight:
    numbers = table.column("flight").to_numpy()
    rows = np.flatnonzero(numbers == info["flight"])
    if not len(rows):
        raise ConfigError(f"{folder / SAMPLES_FILE}: flight {info['flight']} ({info['label']}) has no samples")
    part = table.slice(int(rows[0]), len(rows))
    return make_flight(info, {name: part.column(name).to_numpy() for name in part.column_names if name != "flight"})


def _schema(columns: Mapping[str, Column]) -> pa.Schema:
    types = {"f8": pa.float64(), "i4": pa.int32(), "str": pa.string(), "bool": pa.bool_()}
    fields = [
        pa.field(c.name, types[c.kind], nullable=False, metadata={"unit": c.unit, "doc": c.doc})
        for c in columns.values()
    ]
    return pa.schema(fields, metadata={"ivl_schema_version": str(SCHEMA_VERSION)})


def _units(present: Sequence[str]) -> dict[str, str]:
    return {name: SAMPLES[name].unit for name in present} | {name: c.unit for name, c in FLIGHTS.items()}

"""The time series of a rollout as a file: CSV for everything, NPZ for numpy."""

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.errors import ConfigError

SUFFIXES = (".csv", ".npz")


def check_suffix(path: Path) -> None:
    """Refuse a path whose kind is unknown, before anything is flown."""
    if path.suffix not in SUFFIXES:
        raise ConfigError(f"--trace {path}: unknown kind of file (allowed {', '.join(SUFFIXES)})")


def columns(rows: npt.NDArray[np.void]) -> dict[str, npt.NDArray[Any]]:
    """Every element of every field as a column of its own, by name; elements of vectors are numbered from 1."""
    result = {}
    for name in rows.dtype.names or ():
        data = rows[name].reshape(len(rows), -1)
        scalar = not rows.dtype[name].shape
        for i in range(data.shape[1]):
            result[name if scalar else f"{name}_{i + 1}"] = data[:, i]
    return result


def write(path: Path, rows: npt.NDArray[np.void]) -> None:
    """Write a trace (`Trace.rows`); the kind of file follows from the suffix. CSV numbers read back exactly.

    Raises:
        ConfigError: Unknown suffix, or the file cannot be written.
    """
    check_suffix(path)
    table = columns(rows)
    try:
        if path.suffix == ".npz":
            np.savez_compressed(path, **table)  # type: ignore[arg-type]  # one keyword has a type of its own
            return
        with path.open("w", encoding="utf-8") as file:
            file.write(",".join(table) + "\n")
            for values in zip(*(column.tolist() for column in table.values()), strict=True):
                file.write(",".join(map(repr, values)) + "\n")
    except OSError as error:
        raise ConfigError(f"--trace {path}: cannot be written: {error}") from error


def read(path: Path) -> np.recarray[Any, Any]:
    """The rows of a trace as `write` wrote them, a record array of the library's trace table.

    Raises:
        ConfigError: The file cannot be read, or a column is missing or no number.
    """
    check_suffix(path)
    table = read_columns(path)
    dtype = native.library().trace_dtype
    rows = np.zeros(len(next(iter(table.values()), ())), dtype=dtype)
    for name, target in columns(rows).items():
        if name not in table:
            raise ConfigError(f"{path}: column {name} is missing: this is no trace of `ivl rollout --trace`")
        target[:] = table[name]
    return rows.view(np.recarray)


def read_columns(path: Path) -> dict[str, npt.NDArray[np.float64]]:
    """Every column of a file with one header line (.csv) or of named arrays (.npz).

    Raises:
        ConfigError: The file cannot be read, or holds something else than numbers.
    """
    try:
        if path.suffix == ".npz":
            with np.load(path) as archive:
                return {name: archive[name].astype(np.float64) for name in archive.files}
        with path.open(encoding="utf-8") as file:
            names = file.readline().strip().split(",")
            values = np.loadtxt(file, delimiter=",", ndmin=2, dtype=np.float64)
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    if values.shape[1] != len(names):
        raise ConfigError(f"{path}: {len(names)} column names, but {values.shape[1]} numbers in a row")
    return dict(zip(names, values.T, strict=True))

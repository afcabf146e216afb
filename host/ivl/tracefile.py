"""The time series of a rollout as a file: CSV for everything, NPZ for numpy.

What is read may come from anybody, and passes the border for foreign tables (`ivl.flight.table`).
"""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ivl import files, native
from ivl.errors import ConfigError
from ivl.flight import table as border

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
        with files.replacing(path) as part:
            _write(part, table)
    except OSError as error:
        raise ConfigError(f"--trace {path}: cannot be written: {files.reason(error)}") from error


def _write(path: Path, table: dict[str, npt.NDArray[Any]]) -> None:
    if path.suffix == ".npz":
        with path.open("wb") as archive:
            np.savez_compressed(archive, **table)  # type: ignore[arg-type]  # one keyword has a type of its own
        return
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(table) + "\n")
        for values in zip(*(column.tolist() for column in table.values()), strict=True):
            file.write(",".join(map(repr, values)) + "\n")


NEEDED = ("t_s", *(f"{name}_{i + 1}" for name, n in (("p_WB_m", 3), ("v_WB_mps", 3), ("q_WB", 4)) for i in range(n)))
"""Columns of a trace in which every row has a number; elsewhere NaN stands for what is not known."""


def read(path: Path) -> np.recarray[Any, Any]:
    """The rows of a trace as `write` wrote them, a record array of the library's trace table.

    Raises:
        ConfigError: The file cannot be read, a column is missing, a cell is no number, is empty where it is needed, or
            is not whole where it counts; or times do not rise.
    """
    return rows_of(read_table(path))


def rows_of(table: border.Table) -> np.recarray[Any, Any]:
    """The rows of a table that was read (errors as `read`)."""
    dtype = native.library().trace_dtype
    rows = np.zeros(len(table), dtype=dtype)
    for name, target in columns(rows).items():
        table.need([name], "a trace of `ivl rollout --trace`")
        values = table.numbers(name, name in NEEDED)
        if target.dtype.kind in "iu":
            whole = np.iinfo(target.dtype)
            bad = ~((values >= whole.min) & (values <= whole.max) & (values == np.floor(values)))
            if bad.any():
                row = int(np.argmax(bad))
                raise table.fault(
                    row, name, f"value {values[row]:g} is no whole number within {whole.min} .. {whole.max}"
                )
        target[:] = values
    border.clock(table, "t_s", 1.0)
    return rows.view(np.recarray)


def read_table(path: Path) -> border.Table:
    """A file with one header line (.csv) or of named arrays (.npz), its cells not yet checked.

    Raises:
        ConfigError: The file cannot be read, or is no table.
    """
    check_suffix(path)
    return border.read_npz(path) if path.suffix == ".npz" else border.read_csv(path)

"""The time series of a rollout as a file: CSV for everything, NPZ for numpy."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

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

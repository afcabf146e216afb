import csv
from pathlib import Path

import numpy as np
import pytest

import ivl
from ivl import tracefile
from ivl.errors import ConfigError


@pytest.fixture(scope="module")
def rows(world: ivl.World) -> np.ndarray:
    return world.trace(2.5, 90.0, 4.8, 8.0, period_s=0.02).rows


def test_csv_reads_back_exactly(rows: np.ndarray, tmp_path: Path) -> None:
    tracefile.write(tmp_path / "t.csv", rows)
    with (tmp_path / "t.csv").open() as file:
        table = list(csv.DictReader(file))
    assert len(table) == len(rows)
    assert [float(row["t_s"]) for row in table] == rows["t_s"].tolist()
    assert [float(row["q_WB_4"]) for row in table] == rows["q_WB"][:, 3].tolist()
    assert [int(row["foot_state_2"]) for row in table] == rows["foot_state"][:, 1].tolist()


def test_npz_reads_back_exactly(rows: np.ndarray, tmp_path: Path) -> None:
    tracefile.write(tmp_path / "t.npz", rows)
    with np.load(tmp_path / "t.npz") as table:
        assert (table["t_s"] == rows["t_s"]).all()
        assert (table["foot_W_m_12"] == rows["foot_W_m"][:, 11]).all()
        assert set(table.files) == set(tracefile.columns(rows))


def test_another_kind_of_file_is_refused(rows: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"unknown kind of file \(allowed \.csv, \.npz\)"):
        tracefile.write(tmp_path / "t.txt", rows)


@pytest.mark.parametrize("name", ["t.csv", "t.npz"])
def test_a_place_that_cannot_be_written_is_named(rows: np.ndarray, tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match="cannot be written"):
        tracefile.write(tmp_path / "missing" / name, rows)

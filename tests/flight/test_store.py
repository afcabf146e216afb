"""A folder of flights: what is written is what is read, and whatever else is there is refused in one line."""

import contextlib
import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logs import Truth, habas_rows, habas_text

from ivl import cli
from ivl.errors import ConfigError
from ivl.flight import importer, store
from ivl.flight.log import Given
from ivl.flight.schema import FLIGHTS, SAMPLES, SCHEMA_VERSION
from ivl.flight.store import Flight, Flights, Manifest, make_flight


@pytest.fixture
def flights(truth: Truth) -> Flights:
    first = make_flight(
        {"label": "a", "source": "a.csv", "n_legs": 4, "judged_by": "me", "threshold_per_s": 4.8, "note": "x"},
        truth.columns,
    )
    second = make_flight({"label": "b", "usable": False}, {"t_s": [0.0, 0.5, 2.0], "p_z_m": [1.0, np.nan, 3.0]})
    manifest = Manifest("test", [{"file": "a.csv", "sha256": "00"}], "MIT", "as they are", "100 Hz", {"x": "y"}, ["n."])
    return Flights(manifest, (first, second))


@pytest.fixture
def folder(flights: Flights, tmp_path: Path) -> Path:
    store.write(tmp_path / "flights", flights)
    return tmp_path / "flights"


def equal(left: Flight, right: Flight) -> bool:
    same = [np.array_equal(left[name], right[name], equal_nan=True) for name in SAMPLES if name != "flight"]
    known = {name: value for name, value in left.info.items() if value == value and name != "flight"}
    other = {name: value for name, value in right.info.items() if value == value and name != "flight"}
    return all(same) and known == other


def test_round_trip(flights: Flights, folder: Path) -> None:
    found = store.read(folder)
    assert found.manifest == flights.manifest
    assert len(found) == 2
    assert all(equal(mine, known) for mine, known in zip(found, flights, strict=True))
    assert [f.label for f in found.usable()] == ["a"]
    assert np.isnan(found[1]["v_x_mps"]).all(), "a column of which a flight has nothing is unknown"
    assert not found[1].has("v_x_mps")


def test_one_row_group_a_flight_and_only_columns_with_numbers(flights: Flights, folder: Path) -> None:
    file = pq.ParquetFile(folder / store.SAMPLES_FILE)
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [len(f) for f in flights]
    assert set(file.schema_arrow.names) == {"flight", *(n for n in SAMPLES if n != "flight" and flights[0].has(n))}
    field = file.schema_arrow.field("w_y_radps")
    assert field.metadata == {b"unit": b"rad/s", b"doc": SAMPLES["w_y_radps"].doc.encode()}


def test_manifest_of_an_import(truth: Truth, tmp_path: Path) -> None:
    import hashlib

    path = tmp_path / "july.csv"
    path.write_bytes(habas_text(habas_rows(truth)).encode())
    store.write(tmp_path / "out", importer.run([path], "habas2021", Given(licence="CC-BY")))
    data = json.loads((tmp_path / "out" / store.MANIFEST).read_text())
    assert data["schema_version"] == SCHEMA_VERSION
    assert data["n_flights"] == 1
    assert data["format"] == "habas2021"
    assert data["source"] == [{"file": "july.csv", "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}]
    assert data["licence"] == "CC-BY"
    assert set(data["absent"]) == {
        name for name in SAMPLES if name not in ("flight", "t_s") and name not in data["units"]
    }
    assert data["absent"]["d_ceil_m"] == "not logged; h_plane_m - p_z_m"
    assert data["absent"]["phase"] == "not in the log"
    assert data["units"]["p_x_m"] == "m"
    assert "every 10 ms" in data["clock"]


@pytest.mark.parametrize(
    ("info", "samples", "text"),
    [
        ({"label": "a", "colour": 1}, {"t_s": [0.0]}, "flight a: colour: no such column in the schema of flights"),
        ({"label": "a"}, {"t_s": [0.0], "x": [0.0]}, "flight a: x: no such column in the schema of flights"),
        ({"label": "a"}, {"t_s": [0.0, 1.0], "p_x_m": [0.0]}, "flight a: p_x_m: (1,) values where t_s has (2,)"),
        ({"label": "a"}, {"t_s": [0.0, 0.0]}, "flight a: t_s: times must be finite and rising"),
        ({"label": "a"}, {"t_s": [0.0, np.nan]}, "flight a: t_s: times must be finite and rising"),
        ({"label": "a"}, {"t_s": []}, "flight a: t_s: times must be finite and rising"),
        ({"label": "a"}, {}, "flight a: t_s: times must be finite and rising"),
    ],
)
def test_what_is_no_flight(info: dict[str, Any], samples: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError) as refused:
        make_flight(info, samples)
    assert str(refused.value).startswith(text)


# ---- writing


def test_folder_that_is_there_is_left_alone(flights: Flights, folder: Path, tmp_path: Path) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(ConfigError, match="is there already: name a new folder"):
        store.write(folder, flights)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    (tmp_path / "file").write_text("x")
    with pytest.raises(ConfigError, match="is there already"):
        store.write(tmp_path / "file", flights)
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(ConfigError, match="is there already"):
        store.write(tmp_path / "link", flights)


def test_empty_folder_and_new_parents_are_taken(flights: Flights, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    store.write(tmp_path / "empty", flights)
    store.write(tmp_path / "a" / "b" / "c", flights)
    assert len(store.read(tmp_path / "empty")) == len(store.read(tmp_path / "a" / "b" / "c")) == 2


def test_failure_while_writing_leaves_nothing(
    flights: Flights, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pyarrow.parquet.write_table", full)
    with pytest.raises(ConfigError, match=r"out: cannot be written: No space left on device"):
        store.write(tmp_path / "out", flights)
    assert list(tmp_path.iterdir()) == []


def test_interrupted_import_leaves_nothing(truth: Truth, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "july.csv"
    path.write_bytes(habas_text(habas_rows(truth)).encode())

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("pyarrow.parquet.write_table", interrupt)
    out = str(tmp_path / "out")
    assert cli.run(["flight", "import", str(path), "--format", "habas2021", "--out", out]) == 130
    assert list(tmp_path.iterdir()) == [path]


def test_killed_import_leaves_no_folder_of_that_name(truth: Truth, tmp_path: Path) -> None:
    path = tmp_path / "july.csv"
    path.write_bytes(habas_text(habas_rows(truth)).encode())
    program = (
        "import os, signal, sys; from ivl import cli; import pyarrow.parquet; "
        "pyarrow.parquet.write_table = lambda *_, **__: os.kill(os.getpid(), signal.SIGKILL); cli.run(sys.argv[1:])"
    )
    words = ["flight", "import", str(path), "--format", "habas2021", "--out", str(tmp_path / "out")]
    assert subprocess.run([sys.executable, "-c", program, *words], check=False).returncode == -signal.SIGKILL
    assert not (tmp_path / "out").exists()
    assert cli.run(words) == 0
    assert len(store.read(tmp_path / "out")) == 1


# ---- reading what is damaged


def damaged(folder: Path, change: Callable[[], None]) -> str:
    change()
    with pytest.raises(ConfigError) as refused:
        store.read(folder)
    text = str(refused.value)
    assert str(folder) in text
    assert "\n" not in text
    return text.replace(str(folder), "F")


def test_no_folder_of_flights(tmp_path: Path) -> None:
    assert "this is no folder of flights" in damaged(tmp_path, lambda: None)
    with pytest.raises(ConfigError, match="this is no folder of flights"):
        store.read(tmp_path / "nowhere")


@pytest.mark.parametrize("version", [0, SCHEMA_VERSION + 1, "1", None])
def test_other_version(folder: Path, version: Any) -> None:
    path = folder / store.MANIFEST
    data = json.loads(path.read_text())
    data["schema_version"] = version
    text = damaged(folder, lambda: path.write_text(json.dumps(data)) and None)
    assert text == f"F/manifest.json: schema_version: value {version!r}, this package reads {SCHEMA_VERSION}"


@pytest.mark.parametrize("text", ["", "{", "[]", "1", '"x"', "{}", "[" * 100_000, "\0"])
def test_damaged_manifest(folder: Path, text: str) -> None:
    assert damaged(folder, lambda: (folder / store.MANIFEST).write_text(text) and None).startswith("F/manifest.json: ")


@pytest.mark.parametrize("name", ["format", "source", "licence", "frames", "clock", "absent", "notes"])
def test_manifest_without_a_field(folder: Path, name: str) -> None:
    path = folder / store.MANIFEST
    data = json.loads(path.read_text())
    del data[name]
    assert damaged(folder, lambda: path.write_text(json.dumps(data)) and None) == (
        f"F/manifest.json: {name}: is missing or of another kind"
    )


@pytest.mark.parametrize("name", [store.FLIGHTS_FILE, store.SAMPLES_FILE])
@pytest.mark.parametrize("kind", ["gone", "empty", "text", "cut", "folder"])
def test_damaged_parquet(folder: Path, name: str, kind: str) -> None:
    path = folder / name
    data = path.read_bytes()

    def change() -> None:
        path.unlink()
        if kind == "folder":
            path.mkdir()
        elif kind != "gone":
            path.write_bytes({"empty": b"", "text": b"a,b\n1,2\n", "cut": data[: len(data) // 2]}[kind])

    assert damaged(folder, change).startswith(f"F/{name}: cannot be read: ")


def test_parquet_of_another_kind(folder: Path) -> None:
    path = folder / store.SAMPLES_FILE
    table = pq.read_table(path)

    def write(changed: pa.Table) -> Callable[[], None]:
        return lambda: pq.write_table(changed, path)

    column = pa.array(["x"] * len(table))
    assert damaged(folder, write(table.append_column("colour", column))) == (
        f"F/{path.name}: column colour is none of version 1, or of another type"
    )
    changed = table.set_column(table.column_names.index("p_z_m"), "p_z_m", column)
    assert "column p_z_m is none of version 1" in damaged(folder, write(changed))
    assert damaged(folder, write(table.drop_columns(["t_s"]))) == f"F/{path.name}: column t_s is missing"
    assert "the flights are not in order" in damaged(folder, write(table.take(list(range(len(table)))[::-1])))
    assert "flight b: t_s: times must be" in damaged(folder, write(table.slice(0, len(table) - 3)))


def test_flights_that_are_not_numbered(folder: Path) -> None:
    path = folder / store.FLIGHTS_FILE
    table = pq.read_table(path)
    assert "flights are not numbered 0 .. 0" in damaged(folder, lambda: pq.write_table(table.slice(1), path))


@settings(max_examples=200)
@given(
    at=st.integers(0, 10**6), value=st.integers(0, 255), name=st.sampled_from([store.FLIGHTS_FILE, store.SAMPLES_FILE])
)
def test_flipped_byte_is_refused_or_harmless(
    at: int, value: int, name: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("flights") / "out"
    samples = {"t_s": [0.0, 0.5, 2.0], "p_z_m": [1.0, 2.0, 3.0]}
    manifest = Manifest("test", [], "MIT", "", "")
    store.write(folder, Flights(manifest, (make_flight({"label": "a"}, samples), make_flight({"label": "b"}, samples))))
    data = bytearray((folder / name).read_bytes())
    data[at % len(data)] = value
    (folder / name).write_bytes(bytes(data))
    with contextlib.suppress(ConfigError):
        store.read(folder)


def test_columns_of_the_schema_are_told_in_units() -> None:
    suffix = {"m": "_m", "m/s": "_mps", "rad/s": "_radps", "m/s^2": "_mps2", "1/s": "_per_s", "N": "_N", "V": "_V"}
    suffix |= {"N m": "_Nm", "N mm": "_Nmm", "deg": "_deg", "s": "_s"}
    for name, column in (SAMPLES | FLIGHTS).items():
        assert column.name == name
        assert column.doc
        if column.unit != "1":
            assert name.endswith(suffix[column.unit]), name

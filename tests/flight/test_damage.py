"""Damaged files: a good result, or one line that names file, place and column, and exit code 2; never a traceback."""

import gzip
import os
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logs import Truth, cfclient_text, habas_rows, habas_text, recording_text, simulated, states_text, usd_bytes
from test_formats import BLOCKS

import ivl
from ivl import cli, tracefile
from ivl.errors import ConfigError
from ivl.flight import importer, store
from ivl.flight.log import Given

Refused = Callable[..., str]


@dataclass(frozen=True)
class Form:
    """How a format is written, and where its columns are.

    Attributes:
        text: Writes the log.
        time: Column of the clock.
        needed: A column in which each sample must have a number.
        norm: The w of the quaternion.
        first: Line of the first sample.
    """

    text: Callable[[Truth], str]
    time: str
    needed: str
    norm: str
    first: int = 2


def trace_text(_: Truth) -> str:
    path = Path(os.environ["IVL_TEST_TRACE"])
    return path.read_text()


FORMS = {
    "habas2021": Form(lambda truth: habas_text(habas_rows(truth), end="\n"), "t", "wy", "qw", 3),
    "ivl": Form(recording_text, "t_s", "w_y_B_radps", "q_WB_w"),
    "trace": Form(trace_text, "t_s", "w_B_radps_2", "q_WB_4"),
    "cfclient": Form(
        lambda truth: cfclient_text(truth, [*BLOCKS["motion"], *BLOCKS["attitude"]]),
        "Timestamp", "stateEstimate.vz", "stateEstimate.qw",
    ),
    "crazyswarm": Form(states_text, "timestamp", "z", "qw"),
}  # fmt: skip


@pytest.fixture(scope="session", autouse=True)
def _trace(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """One trace of the simulator for all tests."""
    path = tmp_path_factory.mktemp("trace") / "trace.csv"
    tracefile.write(
        path, ivl.World("habas2021", "wide_short", "as_simulated").trace(2.5, 90, 4.8, 8, period_s=0.02).rows
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("IVL_TEST_TRACE", str(path))
        yield


def each_form(test: Any) -> Any:
    return pytest.mark.parametrize("form", list(FORMS))(test)


def edit(text: str, line: int, column: str, value: str) -> str:
    """The text with another cell."""
    lines = text.splitlines()
    at = lines[0].split(",").index(column)
    cells = lines[line - 1].split(",")
    cells[at] = value
    lines[line - 1] = ",".join(cells)
    return "\n".join(lines) + "\n"


# ---- what is no damage


@each_form
@pytest.mark.parametrize("change", ["bom", "crlf", "no last line end", "blank lines", "blanks around cells"])
def test_harmless_differences(truth: Truth, tmp_path: Path, form: str, change: str) -> None:
    text = FORMS[form].text(truth)
    path = tmp_path / "a.csv"
    path.write_text(text)
    known = importer.run([path], form, Given())
    data = {
        "bom": b"\xef\xbb\xbf" + text.encode(),
        "crlf": text.replace("\n", "\r\n").encode(),
        "no last line end": text.rstrip("\n").encode(),
        "blank lines": text.replace("\n", "\n\n").encode(),
        "blanks around cells": text.replace(",", " , ").encode(),
    }[change]
    path.write_bytes(data)
    found = importer.run([path], form, Given())
    assert len(found) == len(known)
    for name, values in known[0].samples.items():
        assert np.array_equal(found[0][name], values, equal_nan=True)


def test_clock_that_begins_before_zero(truth: Truth, tmp_path: Path) -> None:
    """Some logs count from the trigger."""
    shifted = Truth({**truth.columns, "t_s": truth["t_s"] - 0.5})
    path = tmp_path / "a.csv"
    path.write_text(recording_text(shifted))
    (flight,) = importer.run([path], "ivl", Given())
    assert flight["t_s"] == pytest.approx(truth["t_s"])


# ---- damage of the text


@each_form
def test_no_file(refused: Refused, tmp_path: Path, form: str) -> None:
    assert refused(tmp_path / "a.csv", form=form) == f"{tmp_path}/a.csv: cannot be read: No such file or directory"


@each_form
def test_name_that_no_file_can_have(refused: Refused, tmp_path: Path, form: str) -> None:
    path = tmp_path / ("a" * 300)
    assert refused(path, form=form) == f"{path}: cannot be read: File name too long"


@each_form
def test_folder_in_place_of_a_file(refused: Refused, tmp_path: Path, form: str) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    assert refused(folder, form=form).startswith(f"{folder}: ")


@each_form
@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "is empty"),
        (b"\n\n", "is empty"),
        (b"\xef\xbb\xbf", "is empty"),
        (gzip.compress(b"a,b\n1,2\n"), "is compressed (gzip): unpack it first"),
        (b"PK\x03\x04", "is a ZIP archive, not text"),
        ("t,x\n".encode("utf-16"), "is UTF-16 text: save it as UTF-8"),
        (b"a,b\n1,2\n\0\0", "line 3: is binary, not text"),
        (b"a,b\n1,\xff\n", "line 2: byte 0xff is no UTF-8 text"),
        (b'a,"b\n1,2\n', "line 3: unexpected end of data"),
        (b"a,,b\n1,2,3\n", "line 1: column 2 has no name"),
        (b"a,b,a\n1,2,3\n", "line 1: column a is there twice"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_no_table(refused: Refused, tmp_path: Path, form: str, data: bytes, text: str) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(data)
    found = refused(path, form=form)
    assert found.startswith(f"{path}: ")
    assert text in found or "unexpected end of data" in found


@each_form
def test_header_alone(refused: Refused, truth: Truth, tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(FORMS[form].text(truth).splitlines()[0] + "\n")
    assert refused(path, form=form) == f"{path}: has a header, but no data"


@pytest.mark.parametrize("form", ["habas2021", "ivl", "trace", "cfclient"])
def test_missing_column(refused: Refused, truth: Truth, tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.csv"
    name = FORMS[form].time
    text = FORMS[form].text(truth)
    lines = text.splitlines()
    path.write_text("\n".join([lines[0].replace(name, "other", 1), *lines[1:]]))
    assert refused(path, form=form).startswith(f"{path}: column {name} is missing for ")


@each_form
def test_another_format_is_named(refused: Refused, tmp_path: Path, form: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("when,what\n1,2\n3,4\n")
    found = refused(path, form=form)
    assert found.startswith(f"{path}: ")
    assert "when, what" in found


def test_unknown_format_is_refused_with_those_that_there_are(refused: Refused, tmp_path: Path) -> None:
    found = refused(tmp_path / "a.csv", form="excel")
    assert found == "--format excel: no such format (allowed habas2021, ivl, trace, cfclient, crazyswarm, usd)"


@each_form
@pytest.mark.parametrize("change", [1, -1])
def test_wrong_number_of_fields(refused: Refused, truth: Truth, tmp_path: Path, form: str, change: int) -> None:
    lines = FORMS[form].text(truth).splitlines()
    n = len(lines[0].split(","))
    lines[11] = ",".join([*lines[11].split(","), "1"][: n + change])
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    assert refused(path, form=form) == f"{path}: line 12: {n + change} fields, the header has {n}"


@each_form
@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("", "is empty"),
        ("nan", "value nan where a number must be"),
        ("inf", "value inf where a number must be"),
        ("-inf", "value -inf where a number must be"),
        ("1e999", "value 1e999 where a number must be"),
        ("abc", "value 'abc' is no number"),
        ("1_000", "value '1_000' is no number"),
        ("1;5", "value '1;5' is no number"),
        ("0x1F", "value '0x1F' is no number"),
        ("9" * 400, "value 999"),
        ("1e12", "value 1e12 is beyond 1"),
    ],
)
def test_cell_that_is_no_number(
    refused: Refused, truth: Truth, tmp_path: Path, form: str, value: str, text: str
) -> None:
    where = FORMS[form]
    path = tmp_path / "a.csv"
    path.write_text(edit(where.text(truth), 9, where.needed, value))
    if value in ("", "nan") and form in ("cfclient", "crazyswarm"):
        (flight,) = importer.run([path], form, Given())
        assert len(flight) == len(truth) - 1, "a log block may lack a number; its row has no whole pose"
        return
    found = refused(path, form=form)
    assert found.startswith(f"{path}: line 9: {where.needed}: {text}")
    assert len(found) < 300 + len(str(path))


@each_form
@pytest.mark.parametrize("value", ["", "nan", "inf", "x"])
def test_time_that_is_no_number(refused: Refused, truth: Truth, tmp_path: Path, form: str, value: str) -> None:
    where = FORMS[form]
    path = tmp_path / "a.csv"
    path.write_text(edit(where.text(truth), 9, where.time, value))
    assert refused(path, form=form).startswith(f"{path}: line 9: {where.time}: ")


@each_form
@pytest.mark.parametrize("kind", ["twice", "back", "reset"])
def test_clock_that_does_not_rise(refused: Refused, truth: Truth, tmp_path: Path, form: str, kind: str) -> None:
    where = FORMS[form]
    lines = where.text(truth).splitlines()
    at = lines[0].split(",").index(where.time)
    before = float(lines[9].split(",")[at])
    value = {"twice": before, "back": before - 0.1 * (1000 if form == "cfclient" else 1), "reset": 0.0}[kind]
    path = tmp_path / "a.csv"
    path.write_text(edit("\n".join(lines), 11, where.time, f"{value:g}" if form != "cfclient" else str(int(value))))
    if form == "habas2021" and kind == "reset":
        flights = importer.run([path], form, Given(attempts="all"))
        assert len(flights) > 1, "a jump of the study's clock is another attempt"
        return
    found = refused(path, form=form)
    assert found.startswith(f"{path}: line 11: {where.time}: time ")
    assert found.endswith(" twice" if kind == "twice" else f" after {before:.10g}")


@each_form
@pytest.mark.parametrize("value", ["0", "3"])
def test_quaternion_that_is_none(refused: Refused, truth: Truth, tmp_path: Path, form: str, value: str) -> None:
    where = FORMS[form]
    text = where.text(truth)
    stem = where.norm[:-1]
    names = [n for n in text.splitlines()[0].split(",") if n[:-1] == stem and n[-1] in "wxyz1234"]
    assert len(names) == 4
    for name in names:
        text = edit(text, 9, name, value)
    path = tmp_path / "a.csv"
    path.write_text(text)
    length = "0" if value == "0" else "6"
    assert refused(path, form=form) == f"{path}: line 9: {where.norm}: quaternion of length {length}, it must be 1"


def test_one_damaged_file_of_a_folder_is_named(refused: Refused, truth: Truth, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for block in ("motion", "imu"):
        (folder / f"{block}.csv").write_text(cfclient_text(truth, BLOCKS[block]))
    (folder / "imu.csv").write_text(edit((folder / "imu.csv").read_text(), 20, "gyro.y", "?"))
    assert refused(folder, form="cfclient") == f"{folder}/imu.csv: line 20: gyro.y: value '?' is no number"


@pytest.mark.parametrize(
    ("column", "value", "text"),
    [
        ("flip_flag", "Maybe", "flip_flag: value 'Maybe' is neither True nor False"),
        ("k_ep", "1.5", "k_ep: value '1.5' is no whole number"),
        ("policy", "[3.7 six]", "policy: value '[3.7 six]' is no list of numbers"),
        ("policy", "[3.7 inf]", "policy: value '[3.7 inf]' is no list of numbers"),
        ("policy", "[3.7]", "policy: value '[3.7]': expected [RREV_c M_yd]"),
        ("reward", "good", "reward: value 'good' is no number"),
        ("vz", "up", "vz: value 'up' is no number"),
    ],
)
def test_other_cells_of_the_study(
    refused: Refused, truth: Truth, tmp_path: Path, column: str, value: str, text: str
) -> None:
    line = 9 if column in ("flip_flag", "k_ep") else 3 + len(truth)
    path = tmp_path / "a.csv"
    path.write_text(edit(habas_text(habas_rows(truth), end="\n"), line, column, value))
    assert refused(path, form="habas2021") == f"{path}: line {line}: {text}"


# ---- the card's binary files and archives


def usd(truth: Truth) -> bytes:
    return usd_bytes(truth, {"fixedFrequency": ([*BLOCKS["motion"], *BLOCKS["attitude"]], 1)})


def closed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda _: b"", "is empty"),
        (lambda _: b"a,b\n1,2\n", "begins with 0x61: a log of a micro-SD card begins with 0xbc"),
        (lambda d: d[:6], "is cut off after 6 bytes"),
        (lambda d: d[:-1], "CRC-32 is "),
        (lambda d: d[:300] + bytes([d[300] ^ 1]) + d[301:], "CRC-32 is "),
        (lambda d: closed(d[:1] + b"\x09" + d[2:-4]), "version 9 of the file (allowed 1, 2)"),
        (lambda d: closed(d[:30]), "byte 24: the list of events is cut off"),
        (lambda d: closed(d[:-10]), "is cut off"),
        (lambda d: closed(d[:-4] + b"\x01\x00abc"), "there is no kind 1"),
        (lambda d: closed(d[:-4].replace(b"x(f)", b"x(q)")), "is no variable of event fixedFrequency"),
        (lambda d: closed(d[:-4].replace(b"fixed", b"fix\xffd")), "is no name"),
    ],
)
def test_damaged_card_file(refused: Refused, truth: Truth, tmp_path: Path, change: Any, text: str) -> None:
    path = tmp_path / "log00"
    path.write_bytes(change(usd(truth)))
    found = refused(path, form="usd")
    assert found.startswith(f"{path}: ")
    assert text in found


def test_card_file_with_numbers_that_are_none(refused: Refused, truth: Truth, tmp_path: Path) -> None:
    columns = {**truth.columns, "v_z_mps": np.where(np.arange(len(truth)) == 7, np.inf, truth["v_z_mps"])}
    path = tmp_path / "log00"
    path.write_bytes(usd(Truth(columns)))
    assert refused(path, form="usd") == f"{path}: event 8: stateEstimate.vz: value inf where a number must be"


def test_card_file_with_a_signalling_nan(truth: Truth, tmp_path: Path) -> None:
    columns = {**truth.columns, "v_z_mps": np.where(np.arange(len(truth)) == 7, 1234.5, truth["v_z_mps"])}
    path = tmp_path / "log00"
    path.write_bytes(closed(usd(Truth(columns))[:-4].replace(struct.pack("<f", 1234.5), struct.pack("<I", 0x7FA00000))))
    (flight,) = importer.run([path], "usd", Given())
    assert len(flight) == len(truth) - 1


@pytest.mark.parametrize("value", ["1e300", "-1e31", "9" * 400])
def test_number_too_large_for_any_unit(refused: Refused, truth: Truth, tmp_path: Path, value: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(edit(cfclient_text(truth, [*BLOCKS["motion"], *BLOCKS["imu"]]), 9, "acc.y", value))
    assert refused(path, form="cfclient").startswith(f"{path}: line 9: acc.y: value {value[:30]}")


@pytest.mark.parametrize(
    ("arrays", "text"),
    [
        ({}, "holds no data"),
        ({"t": np.zeros(0)}, "holds no data"),
        ({"t": np.arange(3.0), "pos": np.zeros((4, 3))}, "pos: is no column of 3 numbers"),
        ({"t": np.arange(3.0), "pos": np.array(["a", "b", "c"])}, "pos: is no column of 3 numbers"),
        ({"t": np.array(1.0)}, "t: is no column"),
        ({"t": np.array([0.0, 1.0, 1.0]), "pos": np.zeros((3, 3))}, "row 3: t: time 1 twice"),
        ({"t": np.arange(3.0), "pos": np.array([[0, 0, 0], [0, np.inf, 0], [0, 0, 0]])}, "row 2: pos_2: value inf"),
    ],
)
def test_damaged_archive(refused: Refused, tmp_path: Path, arrays: dict[str, Any], text: str) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, **arrays)
    found = refused(path, form="crazyswarm")
    assert found.startswith(f"{path}: ")
    assert text in found


def test_archive_with_objects_or_of_enormous_size(refused: Refused, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, t=np.array([{"a": 1}], dtype=object))
    assert "is no archive of numpy arrays" in refused(path, form="crazyswarm")
    path.write_bytes(b"no zip at all")
    assert "is no archive of numpy arrays" in refused(path, form="trace")


def test_run_folder_without_recordings(refused: Refused, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    assert refused(folder, form="ivl") == f"{folder}: no recordings/*.csv: neither a run folder of a vehicle nor a file"


# ---- random damage


@pytest.fixture(scope="module")
def logs_by_form() -> dict[str, bytes]:
    world = ivl.World("habas2021", "wide_short", "as_simulated")
    short = simulated(world).part(slice(60, 110))
    result = {form: how.text(short).encode() for form, how in FORMS.items()}
    return result | {"usd": usd(short)}


CELLS = st.sampled_from(
    ["", "nan", "-inf", "1e308", "0", "-1", "x", "1,2", '"', "\0", "\r", "\ufeff", "٣", "True", "[1 2 3]", "1e-320"]
)


@settings(max_examples=150)
@given(data=st.data())
@each_form
def test_random_cells(
    form: str, data: st.DataObject, logs_by_form: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    lines = logs_by_form[form].decode().split("\n")
    for _ in range(data.draw(st.integers(1, 4))):
        row = data.draw(st.integers(0, len(lines) - 1))
        cells = lines[row].split(",")
        cells[data.draw(st.integers(0, len(cells) - 1))] = data.draw(CELLS)
        lines[row] = ",".join(cells)
    ends_well("\n".join(lines).encode(), form, tmp_path_factory)


@settings(max_examples=150)
@given(data=st.data())
@pytest.mark.parametrize("form", [*FORMS, "usd"])
def test_random_bytes(
    form: str, data: st.DataObject, logs_by_form: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory
) -> None:
    log = bytearray(logs_by_form[form])
    kind = data.draw(st.sampled_from(["flip", "cut", "insert", "remove", "swap lines"]))
    at = data.draw(st.integers(0, len(log) - 1))
    n = data.draw(st.integers(1, 200))
    if kind == "flip":
        log[at] ^= 1 << data.draw(st.integers(0, 7))
    elif kind == "cut":
        del log[at:]
    elif kind == "insert":
        log[at:at] = data.draw(st.binary(min_size=1, max_size=20))
    elif kind == "remove":
        del log[at : at + n]
    else:
        lines = bytes(log).split(b"\n")
        i, j = (data.draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        lines[i], lines[j] = lines[j], lines[i]
        log = bytearray(b"\n".join(lines))
    if form == "usd" and data.draw(st.booleans()):
        log = bytearray(closed(bytes(log[:-4])))
    ends_well(bytes(log), form, tmp_path_factory)


@settings(max_examples=100)
@given(log=st.binary(max_size=300))
@pytest.mark.parametrize("form", [*FORMS, "usd"])
def test_garbage(form: str, log: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    ends_well(log, form, tmp_path_factory)


def ends_well(log: bytes, form: str, factory: pytest.TempPathFactory) -> None:
    """One line that names the file, or flights that can be written and read, with finite poses."""
    folder = factory.mktemp("log")
    path = folder / "a.csv"
    path.write_bytes(log)
    try:
        flights = importer.run([path], form, Given(attempts="all"))
    except ConfigError as error:
        text = str(error)
        assert str(path) in text
        assert text.isprintable()
        assert len(text) < 500 + len(str(path))
        return
    store.write(folder / "out", flights)
    for flight in store.read(folder / "out"):
        assert (np.diff(flight["t_s"]) > 0).all()
        for values in flight.samples.values():
            assert not np.isinf(values).any()


def test_traceback_would_be_seen(tmp_path: Path) -> None:
    """Of these tests: the command catches no other errors than those that are meant."""
    with pytest.raises(TypeError):
        importer.run(None, "trace", Given())  # type: ignore[arg-type]
    assert cli.run(["flight", "import", str(tmp_path / "a"), "--format", "trace", "--out", str(tmp_path / "b")]) == 2

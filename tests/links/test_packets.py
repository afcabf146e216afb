"""Packets and flight recorder: the host's codec against the flight core's own, byte for byte."""

import ctypes
import math
import re
from pathlib import Path

import numpy as np
import pytest

from ivl import native
from ivl.errors import LinkError
from ivl.links import packets
from ivl.links.packets import PacketType, Phase, Request, Status, decode, encode

CORE = Path(__file__).parents[2] / "firmware" / "core"
VALUES = {
    PacketType.POLICY: {
        "seq": 4_000_000_001,
        "crc": 3_000_000_001,
        "form": 1,
        "n": 6,
        "part": 1,
        "theta0": 4.8,
        "theta1": 0.00815,
        "theta2": -1.0,
        "theta3": 0.0,
    },
    PacketType.COMMAND: {
        "seq": 65535,
        "request": 2,
        "hover_x_m": -0.25,
        "hover_y_m": 1.5,
        "hover_z_m": 0.7,
        "speed_mps": 2.2,
        "angle_rad": math.radians(60.3),
    },
    PacketType.READING: {"valid": 3, "age_s": 0.02, "rrev_per_s": 4.8, "of_y_radps": -math.inf},
    PacketType.POLICY_ECHO: {
        "seq": 7,
        "status": -2,
        "missing": 0x8001,
        "seq_in_force": 6,
        "crc_in_force": 2**32 - 1,
        "form_in_force": 3,
    },
    PacketType.COMMAND_ECHO: {"seq": 1, "status": -3, "request": 3, "phase": 7, "rule": 28, "cause": 255},
    PacketType.CONFIG_ECHO: {"seq": 2**32 - 1, "status": -1, "bad": 255, "crc": 0xE9085006},
}


@pytest.mark.parametrize("kind", list(PacketType), ids=lambda kind: kind.name)
def test_packet_is_read_by_the_flight_core_and_written_by_it_in_the_same_bytes(kind: PacketType) -> None:
    """Through the core's own decoder and encoder: decode(C) then encode(C) gives the host's bytes back."""
    data = encode(kind, **VALUES[kind])
    get = getattr(native.library().c, f"ivl_wire_get_{kind.name.lower()}")
    put = getattr(native.library().c, f"ivl_wire_put_{kind.name.lower()}")
    get.restype, put.restype = ctypes.c_bool, ctypes.c_size_t
    struct, out = ctypes.create_string_buffer(64), ctypes.create_string_buffer(64)
    assert get(data, ctypes.c_size_t(len(data)), struct)
    n = put(out, struct)
    assert out.raw[:n] == data


@pytest.mark.parametrize("kind", list(PacketType), ids=lambda kind: kind.name)
def test_decode_is_the_inverse_of_encode(kind: PacketType) -> None:
    packet = decode(encode(kind, **VALUES[kind]))
    assert packet is not None
    assert packet.type == kind
    assert dict(packet.values) == {
        name: float(np.float32(value)) if isinstance(value, float) else value for name, value in VALUES[kind].items()
    }


@pytest.mark.parametrize("kind", list(PacketType), ids=lambda kind: kind.name)
def test_bytes_of_another_size_version_or_type_are_no_packet(kind: PacketType) -> None:
    data = encode(kind, **VALUES[kind])
    wrong = [data[:-1], data + b"\0", bytes((kind, 1)) + data[2:], bytes((0x7F, 2)) + data[2:], b"", data[:1]]
    assert [decode(item) for item in wrong] == [None] * len(wrong)


def test_members_that_are_missing_unknown_or_too_large_are_refused() -> None:
    with pytest.raises(
        ValueError, match="POLICY: members are seq, crc, form, n, part, theta0, theta1, theta2, theta3, not seq"
    ):
        encode(PacketType.POLICY, seq=1)
    with pytest.raises(ValueError, match="seq: value 65536 does not fit"):
        encode(PacketType.COMMAND, **{**VALUES[PacketType.COMMAND], "seq": 65536})


def test_numbers_of_phases_requests_status_and_types_are_those_of_the_flight_core() -> None:
    library = native.library()
    assert [library.phase_name(phase) for phase in Phase] == [phase.name.lower() for phase in Phase]
    assert library.phase_name(len(Phase)) == "?"
    types, wire = (CORE / "ivl_types.h").read_text(), (CORE / "ivl_wire.h").read_text()
    requests = re.findall(r"^\s+IVL_REQUEST_(\w+?),?$", types, re.MULTILINE)
    assert requests == [request.name for request in Request] + ["COUNT"]
    kinds = {name: int(code, 16) for name, code in re.findall(r"IVL_WIRE_TYPE_(\w+) = (0x\w+)", wire)}
    assert kinds == {kind.name: int(kind) for kind in PacketType}
    assert re.search(r"IVL_ERR_RANGE = -1.*IVL_ERR_PHASE = -2", types, re.DOTALL)
    assert "IVL_WIRE_ERR_NO_CONTROLLER = -3" in wire
    assert "IVL_ERR_FORM = -4" in types
    assert re.search(r"IVL_WIRE_ERR_CRC = -5.*IVL_WIRE_ERR_INCOMPLETE = -6", wire, re.DOTALL)
    assert [int(status) for status in Status] == [0, -1, -2, -3, -4, -5, -6]


def test_recorder_header_of_another_version_is_refused() -> None:
    dtype = native.library().layout(native.LAYOUT_RECORD_HEADER)[1]
    header = np.zeros(1, dtype=dtype)
    header["magic"], header["version"], header["row_size"] = packets.RECORD_MAGIC, 1, 44
    with pytest.raises(LinkError, match="another version"):
        packets.record_header(header.tobytes())


def test_recorder_rows_come_in_si_units_and_survive_the_wrap_of_the_clock() -> None:
    header_dtype = native.library().layout(native.LAYOUT_RECORD_HEADER)[1]
    row_dtype = native.library().layout(native.LAYOUT_RECORD_ROW)[1]
    header = np.zeros(1, dtype=header_dtype)
    header["magic"], header["version"], header["row_size"] = packets.RECORD_MAGIC, 2, row_dtype.itemsize
    header["n_rows"], header["trigger_row"], header["thrust_N_max"], header["tick_hz"] = 2, 1, 0.2, 500
    rows = np.zeros(2, dtype=row_dtype)
    rows["t_us"] = [2**32 - 1000, 1000]
    rows["p"][1], rows["q"][1], rows["w"][1] = (1500, 0, -20), (0, 32767, 0, 0), (32, -64, 0)
    rows["f"][1], rows["d"][1], rows["thrust"][1], rows["phase"][1] = (0, 0, -981), 503, (0, 255, 51, 0), 4
    recording = packets.record_rows(packets.record_header(header.tobytes()), rows.tobytes())
    row = recording.rows[1]
    assert (recording.trigger_row, recording.tick_hz) == (1, 500.0)
    assert row["t_s"] == pytest.approx(0.002)
    assert row["p_W_m"].tolist() == pytest.approx([1.5, 0.0, -0.02])
    assert row["q_WB"].tolist() == [0.0, 1.0, 0.0, 0.0]
    assert row["w_B_radps"].tolist() == [1.0, -2.0, 0.0]
    assert row["f_B_mps2"].tolist() == pytest.approx([0.0, 0.0, -9.81])
    assert row["d_ceil_m"] == pytest.approx(0.503)
    assert row["thrust_N"].tolist() == pytest.approx([0.0, 0.2, 0.04, 0.0], abs=1e-7)
    assert row["phase"] == Phase.COAST
    lines = recording.to_csv().splitlines()
    assert lines[0].startswith("t_s,p_x_W_m,p_y_W_m,p_z_W_m,v_x_W_mps")
    assert "q_WB_w" in lines[0]
    assert "thrust2_N" in lines[0]
    assert len(lines) == 3
    assert all(line.count(",") == lines[0].count(",") for line in lines)


def test_a_recording_that_begins_with_a_level_out_has_no_trigger() -> None:
    header_dtype = native.library().layout(native.LAYOUT_RECORD_HEADER)[1]
    row_dtype = native.library().layout(native.LAYOUT_RECORD_ROW)[1]
    header = np.zeros(1, dtype=header_dtype)
    header["magic"], header["version"], header["row_size"] = packets.RECORD_MAGIC, 2, row_dtype.itemsize
    header["n_rows"], header["trigger_row"], header["thrust_N_max"], header["tick_hz"] = 3, 1, 0.2, 500
    rows = np.zeros(3, dtype=row_dtype)
    for phase, expected in ((Phase.LEVEL_OUT, None), (Phase.FLIP, 1)):
        rows["phase"] = (Phase.APPROACH, phase, phase)
        recording = packets.record_rows(packets.record_header(header.tobytes()), rows.tobytes())
        assert recording.trigger_row == expected


def test_configuration_and_its_crc_are_those_of_the_world(vertical: object) -> None:
    world = vertical.make_world()  # type: ignore[attr-defined]
    record, crc = world.native_model.config()
    fields, _ = native.library().layout(native.LAYOUT_CONFIG)
    assert record["ivl.h_ceil"][0] == np.float32(
        world.params.values["world.ceiling_height"] + world.params.values["world.sensed_gap_offset"]
    )
    function = native.library().c.ivl_cfg_crc
    function.restype = ctypes.c_uint32
    assert function(ctypes.c_void_p(record.ctypes.data)) == crc
    assert all(np.float32(f.lo) <= record[name][0] <= np.float32(f.hi) for name, f in fields.items())

"""Recorded landings give the same bits on the emulated chip as on this computer."""

from pathlib import Path

import layout
import numpy as np
import pytest
import recording
import replay
from recording import Recording

from ivl import native

N_TICKS = 40_000
AT_LEAST = {
    "phase idle": 50, "phase ready": 500, "phase approach": 2000, "phase flip": 300, "phase coast": 100,
    "phase attached": 30, "phase done": 100, "phase aborted": 500, "inputs not finite": 50, "inputs denormal": 50,
    "inputs beyond 1e8": 30, "poses older than 40 ms": 5, "poses from the future": 30, "poses refused": 200,
    "commands refused": 50, "policies refused": 1, "a motor at its limit": 500,
    "a motor at rest while others run": 500, "motors run": 5000,
}  # fmt: skip
"""A tenth of what eight seeds show: a recording that no longer visits something is noticed."""
MOTORS_OFF = (0, 4, 5, 6)  # idle, coast, attached, done


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    return recording.record(tmp_path_factory.mktemp("recorded"), N_TICKS, seed=1)


def test_no_bit_differs_on_the_chip(build: Path, recorded: Recording) -> None:
    verdict = replay.replay(build / "replay.elf", recorded)
    assert (verdict.n_bits, verdict.first) == (0, "")
    assert verdict.n_ticks >= N_TICKS
    missing = {name: verdict.counts[name] for name, least in AT_LEAST.items() if verdict.counts[name] < least}
    assert not missing


def test_one_changed_bit_is_found_and_named(build: Path, recorded: Recording, tmp_path: Path) -> None:
    program = build / "replay.elf"
    answers = bytearray(recorded.replies.read_bytes())
    leaves, size = layout.struct(program, "ivl_port_reply_t")
    (leaf,) = [leaf for leaf in leaves if leaf.name == "out.thrust_N[2]"]
    _, hello = layout.struct(program, "ivl_port_hello_t")
    answers[hello + 777 * size + leaf.offset] ^= 4
    spoiled = Recording(recorded.requests, tmp_path / "replies.bin")
    spoiled.replies.write_bytes(answers)
    verdict = replay.replay(program, spoiled)
    assert verdict.n_bits == 1
    assert "record 777 of its chunk: out.thrust_N[2] is" in verdict.first


def test_same_seed_records_the_same_requests(recorded: Recording, tmp_path: Path) -> None:
    again = recording.record(tmp_path, N_TICKS, seed=1)
    assert again.requests.read_bytes() == recorded.requests.read_bytes()


def test_no_motor_runs_in_a_phase_that_has_none(build: Path, recorded: Recording) -> None:
    program = build / "replay.elf"
    _, hello = layout.struct(program, "ivl_port_hello_t")
    replies = np.frombuffer(recorded.replies.read_bytes()[hello:], layout.dtype(program, "ivl_port_reply_t"))
    thrusts = np.stack([replies[f"out.thrust_N[{i}]"] for i in range(4)], axis=1)
    assert np.isfinite(thrusts).all()
    rest = np.isin(replies["state.phase"], MOTORS_OFF)
    assert rest.sum() > 1000
    assert not thrusts[rest].any()
    assert not replies["out.motors_on"][rest].any()


def test_structs_lie_alike_on_both_processors(build: Path) -> None:
    here = native.DEFAULT_LIBRARY.parents[3] / "build" / "layout" / "layout.o"
    for name in ("ivl_port_hello_t", "ivl_port_request_t", "ivl_port_reply_t"):
        assert layout.struct(build / "tick_server.elf", name) == layout.struct(here, name)


def test_request_that_makes_no_sense_ends_the_program(build: Path, recorded: Recording, tmp_path: Path) -> None:
    program = build / "replay.elf"
    request = layout.dtype(program, "ivl_port_request_t")
    asked = np.frombuffer(recorded.requests.read_bytes(), request)
    later = int(np.argmax(asked["operation"] != asked["operation"][0]))  # the first ones start slots: any will do
    good = asked[[0, 1, later]]
    for field, value in (("operation", 9), ("slot", 16), ("slot", 15)):
        bad = good.copy()
        bad[field][2] = value
        (tmp_path / "bad.bin").write_bytes(bad.tobytes())
        with pytest.raises(RuntimeError, match="exit code 117: request: "):
            replay.replay(program, Recording(tmp_path / "bad.bin", recorded.replies))

"""Recorded flights replayed by the emulated chip: the same bits as in process."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import replay_fixture as fixture
from replay_fixture import as_log, changed, simulated

from ivl.cli import run as cli
from ivl.errors import RolloutError
from ivl.flight import replay, store
from ivl.flight.store import Flight, Flights, Manifest
from ivl.links import pil


@pytest.fixture(scope="module")
def chips() -> pil.Chips:
    return pil.Chips(pil.qemu_command(pil.IMAGE))


@pytest.fixture(scope="module")
def flights() -> list[Flight]:
    """Of several kinds: every tick logged, 100 Hz, oblique, with a gap that makes the core abort, with odd numbers."""
    world = fixture.world()
    log = as_log(simulated(world))
    gap = changed(log, [i for i in range(len(log)) if not 20 <= i < 35])
    odd = changed(log)
    odd.samples["v_z_mps"][10:13] = (np.nan, 1e-42, 3e38)
    odd.samples["q_x"][15:18] = 0.9
    odd.samples["battery_V"][:] = 3.4
    return [simulated(world), log, as_log(simulated(world, 3.0, 45.0, 3.5, start="flown")), gap, odd]


@pytest.mark.parametrize("battery", [False, True])
def test_replay_on_the_chip_has_the_same_bits(chips: pil.Chips, flights: list[Flight], battery: bool) -> None:
    here = replay.replay(flights, fixture.world(), battery=battery)
    before = chips.n_ticks
    there = replay.replay(flights, fixture.world(), chips, battery=battery)
    assert there.summary["bits"] == here.summary["bits"]
    assert there.summary == here.summary | {"where": "emulated chip"}
    assert chips.n_ticks - before == here.summary["n_ticks"] > 3000


def test_policy_that_the_core_refuses_is_refused_by_the_chip(chips: pil.Chips, flights: list[Flight]) -> None:
    messages = []
    for where in (None, chips):
        with pytest.raises(Exception, match="policy refused by the flight core") as refused:
            replay.replay([flights[0]], fixture.world(**{"firmware.flip_moment_max": 0.001}), where)
        messages.append(str(refused.value))
    assert messages[0] == messages[1]


def test_chip_that_fails_voids_the_replay(flights: list[Flight]) -> None:
    relay = """
import subprocess, sys
chip = subprocess.Popen(sys.argv[1:], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
out, size = sys.stdout.buffer, int.from_bytes((hello := chip.stdout.read(32))[8:12], "little")
out.write(hello); out.flush()
for _ in range(300):
    chip.stdin.write(sys.stdin.buffer.read(size)); chip.stdin.flush()
    out.write(chip.stdout.read(int.from_bytes(hello[12:16], "little"))); out.flush()
chip.kill()
"""
    failing = pil.Chips([sys.executable, "-c", relay, *pil.qemu_command(pil.IMAGE)])
    with pytest.raises(RolloutError, match="the emulated chip has ended; its exit code is 0"):
        replay.replay(flights, fixture.world(), failing)


def test_command_says_where_and_prints_the_same_bits(
    tmp_path: Path, flights: list[Flight], capsys: pytest.CaptureFixture[str]
) -> None:
    store.write(tmp_path / "flights", Flights(Manifest("test", [], "MIT", "", ""), (flights[1],)))
    found = []
    for extra in ([], ["--uri", "pil://"]):
        assert cli(["flight", "replay", str(tmp_path / "flights"), "--json", *extra]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert [f["where"] for f in found] == ["in process", "emulated chip"]
    assert found[0]["bits"] == found[1]["bits"]

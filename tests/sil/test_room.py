"""Several vehicles in one room: they see each other, and are tracked as several bodies. With unmodified cflib."""

import contextlib
import struct
import time

import pytest
from cflib.crazyflie.log import LogConfig

from ivl.silproc import SilProcess

APART_M, RADIUS_M = 1.0, 0.047


def run_to(raw, t_ms: int) -> None:
    """Let a vehicle in lock-step run; it may tell on the same channel that a parameter has changed."""
    raw.send(b"\x2f\x00sil\0run_to_ms\0\x0a" + t_ms.to_bytes(4, "little"))
    while (packet := raw.receive())[0] & 0xF3 != 0x23 or packet[1] != 0:
        pass
    assert packet[-1] == 0


def test_neighbours_see_each_other_in_the_ranges(world, connected, wait_for):
    with SilProcess(world, vehicles=3, decks=["bcMultiranger"]) as sil, contextlib.ExitStack() as stack:
        for n in range(3):
            sil.set("sil.reset", 1, n)
        spots = [(sil.get("sil.start_x", n), sil.get("sil.start_y", n)) for n in range(3)]
        assert spots == [(0.0, 0.0), (0.0, APART_M), (APART_M, 0.0)]
        flown = [stack.enter_context(connected(uri, parameters=False)) for uri in sil.uris]
        seen: list[dict[str, float]] = [{}, {}, {}]
        for n, cf in enumerate(flown):
            block = LogConfig("ranges", 100)
            for direction in ("front", "back", "left", "right"):
                block.add_variable(f"range.{direction}")
            block.data_received_cb.add_callback(lambda _, data, __, n=n: seen[n].update(data))
            cf.log.add_config(block)
            block.start()

        def is_seen(n: int, direction: str) -> bool:
            return abs(seen[n].get(f"range.{direction}", 0) - 1000.0 * (APART_M - RADIUS_M)) < 30.0

        # the second is to the left of the first, the third in front of it
        for n, direction in ((0, "left"), (0, "front"), (1, "right"), (2, "back")):
            wait_for(f"vehicle {n} to see {direction}", lambda n=n, direction=direction: is_seen(n, direction))
        assert seen[0]["range.back"] == seen[0]["range.right"] == seen[1]["range.left"] == 32767
        # the third leaves upwards
        flown[2].high_level_commander.go_to(0.0, 0.0, 0.8, 0.0, 1.0, relative=True)
        wait_for("an empty front", lambda: seen[0]["range.front"] == 32767 and seen[2]["range.back"] == 32767)


def test_what_is_seen_in_lockstep_depends_on_no_order(world, Raw):
    """As long as the vehicles are never further apart than what is told is old."""

    def told(order: tuple[int, int]) -> list[tuple[float, float]]:
        found = []
        with (
            SilProcess(world, vehicles=2, lockstep=True, decks=["bcMultiranger"]) as sil,
            Raw(sil.uris[0]) as first,
            Raw(sil.uris[1]) as second,
        ):
            for n, raw in enumerate((first, second)):
                raw.connect()
                sil.set("sil.reset", 1, n)
            # the second goes 0.5 m towards the first, in 2 s
            assert second.ask(b"\x8c\x0c\x00\x01\x00" + struct.pack("<5f", 0.0, -0.5, 0.0, 0.0, 2.0))[-1] == 0
            for t_ms in range(50, 2001, 50):
                for n in order:
                    run_to((first, second)[n], t_ms)
                found.append((sil.get("range.left", 0), sil.get("range.right", 1)))
        return found

    there = told((0, 1))
    assert told((1, 0)) == there
    assert there[-1][0] == pytest.approx(500.0 - 1000.0 * RADIUS_M, abs=60.0)
    assert len(set(there)) > 15


def test_two_that_meet_know_of_it(world, wait_for):
    with SilProcess(world, vehicles=2, speed=2.0) as sil:
        sil.set("sil.start_y", 0.3, 1)
        for n in range(2):
            sil.set("sil.reset", 1, n)
        sil.set("sil.start_y", 0.0, 1)
        sil.set("sil.start_z", sil.get("sil.start_z", 1) + 0.5, 1)
        sil.set("sil.reset", 1, 1)  # above the first, and then it falls
        sil.set("stabilizer.stop", 1, 1)
        wait_for("both to notice", lambda: min(sil.get("sil.n_bumps", n) for n in range(2)) >= 1)


def test_a_vehicle_that_stands_still_is_seen_where_it_is(world, wait_for):
    with SilProcess(world, vehicles=2, decks=["bcMultiranger"]) as sil:
        for n in range(2):
            sil.set("sil.reset", 1, n)
        wait_for("each other", lambda: sil.get("range.left", 0) < 1000.0 and sil.get("range.right", 1) < 1000.0)
        sil.set("fault.freeze_ms", 1500, 1)
        t_s = time.monotonic()
        while time.monotonic() - t_s < 1.0:
            assert abs(sil.get("range.left", 0) - 1000.0 * (APART_M - RADIUS_M)) < 30.0
        wait_for("the second to go on", lambda: sil.get("fault.freeze_ms", 1) == 0)
        assert sil.get("range.right", 1) < 1000.0

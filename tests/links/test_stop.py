"""The stop: within 50 ms of the key on a link that loses packets, from key and second terminal, as the site says."""

import errno
import io
import os
import pty
import random
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_room import GOOD, Script, plan_of, vehicle_of

from ivl import cli, gamepad
from ivl.errors import LinkError, StoreError
from ivl.experiment import Experiment
from ivl.links import preflight, stop
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.landing_flight import Rollout
from ivl.links.options import Options
from ivl.links.packets import Phase
from ivl.links.sites.room import Room
from ivl.links.stop import POLL_S, Stop
from ivl.links.trouble import Cause, Trouble
from ivl.links.vehicle import Supervisor
from ivl.silproc import SilProcess

ACTS_S = 0.05


@pytest.fixture(autouse=True)
def _slow_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine answers pings late; that is no fault of the room."""
    monkeypatch.setattr(preflight, "P95_S_MAX", 10.0)


class Radio:
    """A vehicle behind a link that loses packets; its time is that of the pauses between them."""

    def __init__(self, loss: float, rng: random.Random) -> None:
        self._loss, self._rng = loss, rng
        self.now_s = self.stopped_s = 0.0
        self.reason, self.has_stopped = "", False

    def stop(self, reason: str, motors_off: bool) -> None:
        del motors_off
        self.reason = reason

    def send_stop(self) -> None:
        if not self.has_stopped and self._rng.random() >= self._loss:
            self.has_stopped, self.stopped_s = True, self.now_s

    def pause(self, span_s: float) -> bool:
        self.now_s += span_s
        return False


@pytest.mark.parametrize("loss", [0.0, 0.05, 0.2])
def test_it_acts_within_50_ms_of_the_key(loss: float) -> None:
    """Counted in packets: one look after the key, and a packet every 5 ms until one comes through."""
    rng = random.Random(11)
    delays_s = []
    for _ in range(5000):
        radio = Radio(loss, rng)
        stop.act(radio, "stopped by a key", False, radio.pause)
        assert radio.has_stopped
        delays_s.append(POLL_S + radio.stopped_s)
    assert max(delays_s) <= ACTS_S
    assert min(delays_s) == POLL_S
    assert (max(delays_s) > POLL_S) == (loss > 0.0)


def until(condition: Callable[[], bool]) -> None:
    while not condition():
        time.sleep(0.001)


def test_a_key_at_the_terminal_stops_and_the_terminal_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    master, slave = pty.openpty()
    said: list[str] = []
    radio = Radio(0.0, random.Random(0))
    with os.fdopen(slave, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        before = termios.tcgetattr(slave)
        watch = Stop(None, False, said.append)
        watch.begin(radio)
        until(lambda: termios.tcgetattr(slave)[3] != before[3])
        assert not radio.reason
        os.write(master, b"x")
        until(lambda: bool(said))
        assert radio.has_stopped
        assert radio.reason == "stopped by a key"
        watch.end()
        watch.end()
        assert termios.tcgetattr(slave) == before
    os.close(master)


def event(value: int, kind: int, number: int = 0) -> bytes:
    """As the kernel tells it."""
    return struct.pack("<IhBB", 1234, value, kind, number)


@pytest.fixture
def pad(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A device that behaves as the kernel's does; what is written here is read there."""
    path = tmp_path / "js0"
    os.mkfifo(path)
    written = os.open(path, os.O_RDWR)
    monkeypatch.setattr(gamepad, "FOLDER", tmp_path)
    yield written
    os.close(written)


def test_a_button_of_a_gamepad_stops_and_nothing_else_that_it_tells(pad: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    said: list[str] = []
    radio = Radio(0.0, random.Random(0))
    watch = Stop(None, False, said.append)
    for no_press in (event(1, 0x81), event(-32767, 0x02), event(0, 0x01), event(1, 0x82)):
        os.write(pad, no_press)
    watch.begin(radio)
    time.sleep(0.05)
    assert not radio.reason
    os.write(pad, event(32767, 0x02) + event(1, 0x01, 7))
    until(lambda: bool(said))
    watch.end()
    assert radio.reason == "stopped by a gamepad"
    assert said == ["STOP: by a gamepad: level-out and landing"]


def test_a_gamepad_that_is_gone_is_told_and_keys_still_stop(pad: int, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    with gamepad.buttons(said.append) as pressed:
        os.write(pad, event(1, 0x01))
        assert pressed()
        assert not pressed()

        def fail(*_: object) -> bytes:
            raise OSError(errno.ENODEV, "No such device")

        monkeypatch.setattr(gamepad.os, "read", fail)
        assert not pressed()
        assert not pressed()
    assert [line.partition(" is gone")[2] for line in said] == [
        ": it does not stop the vehicle any more (No such device)"
    ]


def test_a_stop_over_a_link_that_is_gone_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    radio, said = Radio(0.0, random.Random(0)), []

    def fail() -> None:
        raise LinkError("link lost")

    monkeypatch.setattr(radio, "send_stop", fail)
    watch = Stop(tmp_path, False, said.append)
    watch.begin(radio)
    assert stop.ask(tmp_path)
    until(lambda: bool(said))
    watch.end()
    assert said == ["STOP: by ivl stop: not sent: link lost"]


def test_a_second_terminal_stops_every_run_that_flies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("xxxx"))  # a pipe is no key
    assert cli.run(["stop"]) == 1
    assert "no vehicle flies" in capsys.readouterr().err
    folders = [tmp_path / "runs" / name for name in ("a", "b")]
    radios = [Radio(0.0, random.Random(0)) for _ in folders]
    watches = [Stop(folder, False, lambda _: None) for folder in folders]
    for folder, watch, radio in zip(folders, watches, radios, strict=True):
        folder.mkdir(parents=True)
        watch.begin(radio)
    assert not any(radio.reason for radio in radios)
    assert cli.run(["stop"]) == 0
    assert capsys.readouterr().out.count(": stopped") == 2
    assert [radio.reason for radio in radios] == ["stopped by ivl stop"] * 2
    for watch in watches:
        watch.end()
    assert [path for folder in folders for path in folder.iterdir()] == []
    with pytest.raises(StoreError, match="no vehicle flies in this run now"):
        stop.ask(folders[0])


def test_only_a_file_of_the_user_who_flies_is_obeyed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / stop.FILE
    assert not stop.is_asked(tmp_path)
    path.symlink_to(tmp_path / "other")
    (tmp_path / "other").write_text("")
    assert not stop.is_asked(tmp_path), "a link is no request"
    path.unlink()
    path.write_text("")
    assert stop.is_asked(tmp_path)
    monkeypatch.setattr(os, "getuid", lambda: path.stat().st_uid + 1)
    assert not stop.is_asked(tmp_path)
    (tmp_path / stop.FLYING).write_text("1")
    path.unlink()
    monkeypatch.undo()
    thread = threading.Thread(target=stop.ask, args=(tmp_path,))
    thread.start()
    until(path.exists)
    assert path.stat().st_mode & 0o777 == 0o600
    path.unlink()
    thread.join()


@pytest.mark.parametrize(("what", "when"), [("level_out", "start"), ("level_out", "hover"), ("motors_off", "hover")])
def test_a_stopped_flight_is_not_scored_and_the_day_goes_on(
    server: SilProcess, in_room: Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, what: str, when: str
) -> None:
    """Stopped on the way to the start point, under the stock controller, or in the hover under the core."""
    script, said = Script(), []
    monkeypatch.setattr(sys, "stdin", io.StringIO(""))
    options = Options(tmp_path, script, rehearse=True, say=said.append)

    locked: list[bool] = []
    script.on_help = lambda _: locked.append(bool(int(server.get("supervisor.info")) & Supervisor.LOCKED))
    with CrazyflieSource(server.uri, in_room, options) as source:
        site, vehicle = source._site, vehicle_of(source)
        assert isinstance(site, Room)
        site._stop = Stop(tmp_path, what == "motors_off", said.append)

        def press(*_: object) -> None:
            assert (tmp_path / stop.FLYING).exists()
            (tmp_path / stop.FILE).write_text("")
            until(lambda: any(line.startswith("STOP: by ivl stop") for line in said))
            assert vehicle.stopped

        if when == "start":
            take_off = vehicle.take_off

            def rise(*arguments: float) -> None:
                take_off(*arguments)
                vehicle.pause(1.0)
                press()

            monkeypatch.setattr(vehicle, "take_off", rise)
        else:
            monkeypatch.setattr(site, "before_approach", press)
        (flown,) = source.fly(plan_of(GOOD))
    assert (flown.discarded, flown.outcomes["n_legs"][0]) == ("", 4)
    assert source.troubles[Cause.STOPPED] == 1
    assert script.asked[:2] == ["place", "help stopped"]
    assert script.asked[-2:] == ["place", "confirm 4"]
    assert locked == [what == "motors_off"]
    assert not (tmp_path / stop.FLYING).exists()


def test_a_stop_in_the_flip_lets_it_end_and_is_asked_about_afterwards(
    server: SilProcess, in_room: Experiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = Script()
    with CrazyflieSource(server.uri, in_room, Options(operator=script, rehearse=True)) as source:
        vehicle = vehicle_of(source)
        is_over = source._site._is_over  # type: ignore[union-attr]

        def look() -> bool:
            if vehicle.phase in (Phase.FLIP, Phase.COAST) and not vehicle.stopped:
                stop.act(vehicle, "stopped by a key", False, lambda _: False)
            return bool(is_over())

        monkeypatch.setattr(source._site, "_is_over", look)
        landing = source.fly_one(GOOD)
        assert vehicle.stopped
        assert landing.outcome["n_legs"][0] == 4
        with pytest.raises(Trouble) as error:
            source.fly_one(Rollout((4.8, 8.0)))
        assert error.value.cause is Cause.STOPPED
    assert script.asked == ["place", "confirm 4"]

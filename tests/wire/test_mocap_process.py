"""Clients of tracking systems in their own process: real ones, at a small server and at nobody."""

import itertools
import json
import math
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ivl import cli
from ivl.cli import mocap as mocap_cli
from ivl.errors import LinkError
from ivl.mocap import config as configs
from ivl.mocap.config import MocapConfig, load
from ivl.mocap.natnet import NatNetServer
from ivl.mocap.stream import Mocap
from ivl.mocap.tracker import Tracker, request_of
from ivl.mocap.watch import Pose, Status

DEADLINE_S = 60.0
BODY = "cf21"


def wait_for(condition: Callable[[], Any], what: str) -> None:
    ends_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < ends_s, f"never: {what}"
        time.sleep(0.005)


class Sink:
    def __init__(self) -> None:
        self.poses: list[tuple[float, ...]] = []
        self.fails = False

    def send_extpose(self, *pose: float) -> None:
        if self.fails:
            raise AttributeError("'NoneType' object has no attribute 'send_packet'")
        self.poses.append(pose)


class Cameras(threading.Thread):
    """A room in which the body circles, 100 frames a second; attributes are its faults."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.server = NatNetServer([BODY, "box"])
        self.frozen = self.occluded = self.silent = False
        self.shift_m, self.t_s = 0.0, 0.0
        self._ended = threading.Event()
        self.start()

    def run(self) -> None:
        while not self._ended.wait(0.01):
            self.t_s += 0.0 if self.frozen else 0.01
            pose = (math.cos(self.t_s) + self.shift_m, math.sin(self.t_s), 1.0, 0.0, 0.0, 0.6, 0.8)
            if not self.silent:
                self.server.send({BODY: None if self.occluded else pose, "box": (self.t_s, 0, 0, 0, 0, 0, 1)})

    def close(self) -> None:
        self._ended.set()
        self.join()
        self.server.close()

    @property
    def request(self) -> dict[str, Any]:
        return {"system": "optitrack", "options": self.server.options, "connect_s": 10.0}


@pytest.fixture
def cameras() -> Iterator[Cameras]:
    cameras = Cameras()
    yield cameras
    cameras.close()


def config(**values: Any) -> MocapConfig:
    # a busy machine delays frames: what is slow there is not lost
    limits = {"lost_s": 1.0, "frozen_s": 1.0, "settle_s": 1.05}
    return MocapConfig(**{"system": "simulator", "body": BODY, **limits, **values})


def test_optitrack_client_brings_poses_to_the_vehicle(cameras: Cameras) -> None:
    sink = Sink()
    with Mocap(config(), sink, cameras.request) as mocap:
        state = mocap.wait_until_good()
        assert sorted(state.bodies) == ["box", BODY]
        wait_for(lambda: len(sink.poses) >= 30, "thirty poses")
    for x, y, z, *q in sink.poses:
        assert math.hypot(x, y) == pytest.approx(1.0, abs=1e-5)
        assert z == 1.0
        assert q == pytest.approx([0.0, 0.0, 0.6, 0.8])
    angles = [math.atan2(y, x) for x, y, *_ in sink.poses]
    assert all((b - a) % (2.0 * math.pi) < math.pi for a, b in itertools.pairwise(angles)), "in their order"


@pytest.mark.parametrize(
    ("fault", "status", "text"),
    [
        ("frozen", Status.FROZEN, f"the pose of {BODY} has not changed by a bit"),
        ("occluded", Status.LOST, rf"{BODY} is not seen .*bodies that are: box"),
        ("silent", Status.SILENT, "no frame from simulator"),
    ],
)
def test_fault_is_named_and_passes(cameras: Cameras, fault: str, status: Status, text: str) -> None:
    with Mocap(config(), None, cameras.request) as mocap:
        mocap.wait_until_good()
        setattr(cameras, fault, True)
        wait_for(lambda: (s := mocap.state()).status is status and re.match(text, s.text), f"status {status}")
        with pytest.raises(LinkError, match="motion capture: "):
            mocap.wait_until_good(timeout_s=0.0)
        wait_for(lambda: [re.match(f"motion capture: {text}", p) is not None for p in mocap.problems()] == [True], text)
        setattr(cameras, fault, False)
        mocap.wait_until_good()


class Heard:
    """A guard that remembers: the thread of motion capture tells every state, however late this thread looks."""

    def __init__(self) -> None:
        self.states: list[tuple[Status, str]] = []

    def look(self, status: Status, text: str, now_s: float) -> None:
        assert text.startswith("motion capture: ")
        assert now_s > 0
        if self.statuses[-1:] != [status]:
            self.states.append((status, text))

    def in_flight(self) -> bool:
        return False

    @property
    def statuses(self) -> list[Status]:
        return [status for status, _ in self.states]


def test_jump_is_named_and_not_sent(cameras: Cameras) -> None:
    sink, heard = Sink(), Heard()
    with Mocap(config(settle_s=3.0), sink, cameras.request) as mocap:
        mocap.guard = heard
        wait_for(lambda: Status.GOOD in heard.statuses, "good")
        cameras.shift_m = 7.0
        wait_for(lambda: heard.statuses[-1] is Status.JUMPED, "jumped")
        assert max(x for x, *_ in sink.poses) < 1.5
        assert mocap.state().counts.n_jumps == 1


def test_frames_and_hostile_counts_of_another_sender_are_not_heard(cameras: Cameras) -> None:
    """From another socket of the same computer; a stranger's pose is not even a jump, and ends no client."""
    sink, heard = Sink(), Heard()
    stranger = NatNetServer([BODY, "box"])
    stranger._target = cameras.server._target
    hostile = struct.pack("<2H2i", 7, 8, 1, 2**31 - 1)
    try:
        with Mocap(config(), sink, cameras.request) as mocap:
            mocap.guard = heard
            mocap.wait_until_good()
            n_frames, n_sent = mocap.state().counts.n_frames, len(sink.poses)
            for _ in range(50):
                stranger.send({BODY: (7.0, 7.0, 1.0, 0.0, 0.0, 0.0, 1.0)})
                stranger._data.sendto(hostile, stranger._target)
            wait_for(lambda: len(sink.poses) > n_sent + 20, "the vehicle's own poses")
            state = mocap.state()
        assert state.counts.n_jumps == state.n_restarts == 0
        assert state.counts.n_frames > n_frames
        assert max(x for x, *_ in sink.poses) < 1.5
        assert not {Status.JUMPED, Status.FAILED} & set(heard.statuses)
    finally:
        stranger.close()


def test_hostile_count_of_the_server_itself_costs_the_client_and_not_the_host(cameras: Cameras) -> None:
    """The client reads far beyond the datagram: it mostly dies at once, and a busy one may only fall silent."""
    heard = Heard()
    hostile = struct.pack("<2H2i", 7, 8, 1, 2**31 - 1)

    def is_hit() -> bool:
        cameras.server._data.sendto(hostile, cameras.server._target)  # again: one datagram may be lost
        time.sleep(0.1)
        return bool({Status.FAILED, Status.SILENT} & set(heard.statuses))

    with Mocap(config(restart_s=1.2), None, cameras.request) as mocap:
        mocap.guard = heard
        mocap.wait_until_good()
        wait_for(is_hit, "the end of the client")
        n_heard = len(heard.states)
        wait_for(lambda: Status.GOOD in heard.statuses[n_heard:], "good again")
        assert mocap.state().n_restarts >= 1


def test_guard_hears_each_status(cameras: Cameras) -> None:
    heard = Heard()
    with Mocap(config(), None, cameras.request) as mocap:
        mocap.guard = heard
        mocap.wait_until_good()
        cameras.occluded = True
        wait_for(lambda: heard.statuses[-1] is Status.LOST, "loss heard")
    assert heard.statuses[:2] in ([Status.CONNECTING, Status.SETTLING], [Status.SETTLING, Status.GOOD])
    assert heard.statuses.index(Status.GOOD) < heard.statuses.index(Status.LOST)


def test_send_rate_is_limited() -> None:
    """Three seconds of frames at 100 Hz, told as fast as they can be."""
    sink = Sink()
    mocap = Mocap(config(send_hz=20.0), sink)
    for i in range(301):
        mocap._send(5.0 + 0.01 * i, Pose((float(i), 0.0, 1.0), (0.0, 0.0, 0.0, 1.0)))
    numbers = [x for x, *_ in sink.poses]
    assert len(numbers) == pytest.approx(61, abs=1)
    assert all(4 <= b - a <= 6 for a, b in itertools.pairwise(numbers[2:]))


def test_closed_link_is_told_and_not_raised(cameras: Cameras) -> None:
    sink = Sink()
    sink.fails = True
    with Mocap(config(), sink, cameras.request) as mocap:
        mocap.wait_until_good()
        told = "motion capture: poses do not reach the vehicle: 'NoneType'"
        wait_for(lambda: any(problem.startswith(told) for problem in mocap.problems()), "error")
        sink.fails = False
        wait_for(lambda: not mocap.state().sink_error, "no error")


def test_process_that_dies_is_started_again(cameras: Cameras) -> None:
    heard = Heard()
    with Mocap(config(restart_s=1.2), None, cameras.request) as mocap:
        mocap.guard = heard
        mocap.wait_until_good()
        assert mocap._tracker is not None
        os.kill(mocap._tracker._process.pid, signal.SIGKILL)
        wait_for(lambda: Status.FAILED in heard.statuses, "failure")
        failed = heard.statuses.index(Status.FAILED)
        assert "its client ended with signal 9" in heard.states[failed][1]
        wait_for(lambda: Status.GOOD in heard.statuses[failed:], "good again")
        assert mocap.state().n_restarts >= 1


def test_process_that_is_started_again_has_the_time_that_connecting_takes(cameras: Cameras) -> None:
    """Also where that is longer than the silence after which it is started."""
    heard = Heard()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent,
        Mocap(config(), None, cameras.request) as mocap,
    ):
        silent.bind(("127.0.0.1", 0))
        mocap.guard = heard
        mocap.wait_until_good()
        options = {**cameras.request["options"], "port_command": str(silent.getsockname()[1])}
        mocap._request = {"system": "optitrack", "options": options, "connect_s": 0.7}
        mocap.config = config(restart_s=0.2)
        assert mocap._tracker is not None
        os.kill(mocap._tracker._process.pid, signal.SIGKILL)
        whole = "no frame within 0.7 s"
        wait_for(lambda: any(whole in text for _, text in heard.states), "the end of a client that was not cut short")


def test_client_that_blocks_is_ended_in_time() -> None:
    # the server answers nothing: this client's connect() has no end of its own
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        options = {"port_command": str(silent.getsockname()[1])}
        blocked = MocapConfig(system="optitrack", host="localhost", body=BODY, options=options, connect_s=0.3)
        with Mocap(blocked) as mocap, pytest.raises(LinkError, match=r"optitrack localhost: no frame within 0\.3 s"):
            mocap.wait_until_good()


def test_client_that_spins_is_ended_in_time() -> None:
    vicon = MocapConfig(system="vicon", host="127.0.0.1:9", body=BODY, connect_s=0.3)
    with Mocap(vicon) as mocap, pytest.raises(LinkError, match=r"no frame within 0\.3 s"):
        mocap.wait_until_good()


def test_client_that_refuses_is_quoted() -> None:
    qualisys = MocapConfig(system="qualisys", host="127.0.0.1", body=BODY, options={"port": "9"})
    with Mocap(qualisys) as mocap, pytest.raises(LinkError, match=r"qualisys 127\.0\.0\.1: Error connecting QTM"):
        mocap.wait_until_good()


def test_host_that_does_not_exist_is_told() -> None:
    nowhere = MocapConfig(system="optitrack", host="nowhere.invalid", body=BODY)
    with pytest.raises(LinkError, match=r"host: value 'nowhere\.invalid' cannot be found"):
        request_of(nowhere)


def test_mock_stands_still_and_would_count_as_frozen() -> None:
    with Mocap(load("mock")) as mocap:
        assert mocap.wait_until_good().pose.p_W_m == pytest.approx((0.1, 0.2, 1.3))
    frozen = load("mock").model_copy(update={"frozen_s": 0.1})
    with Mocap(frozen) as mocap:
        wait_for(lambda: mocap.state().status is Status.FROZEN, "frozen")


def test_process_ends_with_its_parent(tmp_path: Path) -> None:
    program = (
        "import time; from ivl.mocap.config import load; from ivl.mocap.stream import Mocap\n"
        "m = Mocap(load('mock')); m.start(); m.wait_until_good()\n"
        "print(m._tracker._process.pid, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, cwd=tmp_path)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    wait_for(lambda: not _runs(child), "end of the child")


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """Configuration of a mock for a busy machine; the program's time begins when the pose is good."""
    watch = mocap_cli._watch

    def when_good(tracking: Mocap, *arguments: Any, **more: Any) -> None:
        wait_for(lambda: tracking.state().status is Status.GOOD, "a good pose")
        watch(tracking, *arguments, **more)

    monkeypatch.setattr(mocap_cli, "_watch", when_good)
    file = tmp_path / "mock.yaml"
    file.write_text((Path(configs.__file__).parent / "mock.yaml").read_text() + "lost_s: 1.0\nsettle_s: 1.05\n")
    return str(file)


def test_report_of_the_program(patient: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["mocap", "--config", patient, "--seconds", "0.2", "--json"]) in (0, 1)
    report = json.loads(capsys.readouterr().out)
    assert report["status"] == "good"
    assert report["pose"]["q_WB"] == [0.0, 0.0, 0.0, 1.0]
    assert report["n_frames"] > 10
    assert report["bodies"] == [BODY]


def test_live_view_of_the_program(patient: str, capsys: pytest.CaptureFixture[str]) -> None:
    cli.run(["mocap", "--config", patient, "--seconds", "0.4"])
    view = capsys.readouterr().err
    for word in ("status", "position", "rate", "intervals", "bodies", BODY):
        assert word in view


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ([], "--config is needed: a file, or one of mock, optitrack"),
        (["--config", "simulator"], "--uri is needed"),
        (["--config", "nosuch.yaml"], "no such file, and no such example"),
    ],
)
def test_wrong_options_are_one_line(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["mocap", *arguments]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1


def test_a_guard_hears_of_it_when_motion_capture_itself_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    heard: list[Status] = []

    class Listener:
        def look(self, status: Status, *_: object) -> None:
            heard.append(status)

        def in_flight(self) -> bool:
            return False

    def fail(*_: object) -> None:
        raise ZeroDivisionError("a fault of the program")

    cameras = Cameras()
    config = MocapConfig(system="simulator", body=BODY)
    monkeypatch.setattr(Mocap, "_take", fail)
    try:
        with Mocap(config, request=cameras.request) as mocap:
            mocap.guard = Listener()
            wait_for(lambda: heard[-3:] == [Status.FAILED] * 3, "the guard is told")
            assert "motion capture itself failed: ZeroDivisionError" in mocap.state().text
    finally:
        cameras.close()


def test_a_guard_that_fails_is_a_body_that_is_lost_and_is_asked_again() -> None:
    heard: list[Status] = []

    class Listener:
        def look(self, status: Status, *_: object) -> None:
            heard.append(status)
            if len(heard) in (2, 4):
                raise OSError("the link is closed")

        def in_flight(self) -> bool:
            return False

    cameras = Cameras()
    try:
        with Mocap(MocapConfig(system="simulator", body=BODY), request=cameras.request) as mocap:
            mocap.guard = Listener()
            wait_for(lambda: len(heard) > 6, "the guard is told after it has failed again")
            assert heard[2:7] == [Status.FAILED] * 5
            assert mocap.state().status is Status.FAILED
            assert "OSError: the link is closed" in mocap.state().text
    finally:
        cameras.close()


@pytest.mark.parametrize(
    "line",
    [
        b"hello",
        b"[1]",
        b"5",
        b'{"bodies": 3, "t_s": 1}',
        b'{"t_s": 1, "bodies": {"a": [1, "x"]}}',
        b'{"bodies": {}}',
        b"[" * 9999,
        b'{"t_s": 1, "bodies": {"a": [0, 0, ' + b"9" * 400 + b", 0, 0, 0, 1]}}",
        b'{"t_s": 1, "bodies": {"a": "0010001"}}',
        b'{"t_s": 1, "bodies": {"a": [0, 0, true, 0, 0, 0, 1]}}',
        *(b'{"t_s": ' + t + b', "bodies": {}}' for t in (b"NaN", b"Infinity", b"1e308", b"-1", b'"1"', b"9" * 400)),
    ],
)
def test_a_strange_line_of_the_child_is_counted_and_no_frame(line: bytes) -> None:
    tracker = Tracker.__new__(Tracker)
    tracker.failure, tracker.n_strange = "", 0
    assert tracker._frame(line) is None
    assert tracker.n_strange == 1
    assert tracker.failure == ""

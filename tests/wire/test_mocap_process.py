"""Clients of tracking systems in their own process: real ones, at a small server and at nobody."""

import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from ivl import cli
from ivl.errors import LinkError
from ivl.mocap.config import MocapConfig, load
from ivl.mocap.natnet import NatNetServer
from ivl.mocap.stream import Mocap
from ivl.mocap.tracker import request_of
from ivl.mocap.watch import Status

DEADLINE_S = 20.0
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
    limits = {"lost_s": 0.3, "frozen_s": 0.3, "settle_s": 0.35}
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
    assert angles == sorted(angles)


@pytest.mark.parametrize(
    ("fault", "status", "text"),
    [
        ("frozen", Status.FROZEN, "has not changed by a bit"),
        ("occluded", Status.LOST, rf"{BODY} is not seen .*bodies that are: box"),
        ("silent", Status.SILENT, "no frame from simulator"),
    ],
)
def test_fault_is_named_and_passes(cameras: Cameras, fault: str, status: Status, text: str) -> None:
    with Mocap(config(), None, cameras.request) as mocap:
        mocap.wait_until_good()
        setattr(cameras, fault, True)
        wait_for(lambda: mocap.state().status is status, f"status {status}")
        with pytest.raises(LinkError, match=text):
            mocap.wait_until_good(timeout_s=0.0)
        assert mocap.problems() == [f"motion capture: {mocap.state().text}"]
        setattr(cameras, fault, False)
        mocap.wait_until_good()


def test_jump_is_named_and_not_sent(cameras: Cameras) -> None:
    sink = Sink()
    with Mocap(config(lost_s=0.2, settle_s=1.0), sink, cameras.request) as mocap:
        wait_for(lambda: mocap.state().status is Status.SETTLING, "settling")
        mocap.wait_until_good()
        cameras.shift_m = 7.0
        wait_for(lambda: mocap.state().status is Status.JUMPED, "jumped")
        assert max(x for x, *_ in sink.poses) < 1.5
        assert mocap.state().counts.n_jumps == 1


def test_guard_hears_each_status(cameras: Cameras) -> None:
    heard: list[Status] = []

    class Guard:
        def look(self, status: Status, text: str, now_s: float) -> None:
            assert text.startswith("motion capture: ")
            assert now_s > 0
            heard.append(status)

    with Mocap(config(), None, cameras.request) as mocap:
        mocap.guard = Guard()
        mocap.wait_until_good()
        cameras.occluded = True
        wait_for(lambda: heard[-1:] == [Status.LOST], "loss heard")
    assert Status.GOOD in heard


def test_send_rate_is_limited(cameras: Cameras) -> None:
    sink = Sink()
    with Mocap(config(send_hz=20.0), sink, cameras.request) as mocap:
        mocap.wait_until_good()
        before = mocap.state().counts.n_frames
        wait_for(lambda: mocap.state().counts.n_frames >= before + 100, "frames")
        n_frames = mocap.state().counts.n_frames
    assert 10 <= len(sink.poses) <= n_frames / 4


def test_closed_link_is_told_and_not_raised(cameras: Cameras) -> None:
    sink = Sink()
    sink.fails = True
    with Mocap(config(rate_hz_min=1.0, jitter_ms_max=1000.0), sink, cameras.request) as mocap:
        mocap.wait_until_good()
        wait_for(lambda: mocap.state().sink_error, "error")
        assert "poses do not reach the vehicle: 'NoneType'" in mocap.problems()[0]
        sink.fails = False
        wait_for(lambda: not mocap.state().sink_error, "no error")


def test_process_that_dies_is_started_again(cameras: Cameras) -> None:
    with Mocap(config(restart_s=0.6), None, cameras.request) as mocap:
        mocap.wait_until_good()
        assert mocap._tracker is not None
        os.kill(mocap._tracker._process.pid, signal.SIGKILL)
        wait_for(lambda: mocap.state().status is Status.FAILED, "failure")
        assert "its client ended with signal 9" in mocap.state().text
        wait_for(lambda: mocap.state().status is Status.GOOD, "good again")
        assert mocap.state().n_restarts == 1


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


def test_report_of_the_program(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["mocap", "--config", "mock", "--seconds", "1.0", "--json"]) in (0, 1)
    report = json.loads(capsys.readouterr().out)
    assert report["status"] == "good"
    assert report["pose"]["q_WB"] == [0.0, 0.0, 0.0, 1.0]
    assert report["n_frames"] > 30
    assert report["bodies"] == [BODY]


def test_live_view_of_the_program(capsys: pytest.CaptureFixture[str]) -> None:
    cli.run(["mocap", "--config", "mock", "--seconds", "0.4"])
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

"""The server: who may look, who may stop, and clients that do not read."""

import asyncio
import socket
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from looking import Beside
from tornado import websocket

from ivl import cli
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.options import Options
from ivl.live import server
from ivl.live.pump import PERIOD_S
from ivl.live.view import View, address
from ivl.silproc import SilProcess
from ivl.source import Plan, WorldSource

Open = Callable[..., Any]


def status(url: str, method: str = "GET", **headers: str) -> int:
    request = urllib.request.Request(url, method=method, headers={k.replace("_", "-"): v for k, v in headers.items()})
    try:
        with urllib.request.urlopen(request, timeout=60.0) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        with error:
            return error.code


async def over(client: websocket.WebSocketClientConnection) -> None:
    """Close a client, and wait until it is."""
    client.close()
    while await client.read_message() is not None:
        pass


def test_only_the_token_stops_and_only_this_machine_is_answered(vertical: Experiment, view_of: Open) -> None:
    with view_of(vertical, False) as view:
        stop = f"{view.url}stop"
        assert status(stop, "POST") == 403
        assert status(stop, "POST", X_Ivl_Token="x" * len(view.token)) == 403
        assert status(stop, "GET", X_Ivl_Token=view.token) == 405
        assert status(stop, "POST", X_Ivl_Token=view.token) == 200
        assert status(view.url) == 200
        assert status(view.url, Host="elsewhere.example:80") == 403
        assert status(f"{view.url}news", Host="elsewhere.example:80") == 403
        for path in ("../view.py", "view.py", "%2e%2e/board.py", "live.htm"):
            assert status(view.url + path) in (403, 404)
        with urllib.request.urlopen(view.url, timeout=60.0) as answer:
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert view.token.encode() not in answer.read()


def test_a_page_elsewhere_gets_no_news(vertical: Experiment, view_of: Open) -> None:
    with view_of(vertical, False) as view:
        for origin, answer in ((view.url.rstrip("/"), b"101"), ("http://elsewhere.example", b"403")):
            with stuck_client(view, origin) as client:
                assert client.recv(12) == b"HTTP/1.1 " + answer


def stuck_client(view: View, origin: str | None = None) -> socket.socket:
    """A client that asks for the news and never reads them; its buffer is small."""
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    host = view.url.removeprefix("http://").rstrip("/")
    client.connect(address(host))
    lines = ["GET /news HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade"]
    lines += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13"]
    lines += [] if origin is None else [f"Origin: {origin}"]
    client.sendall("\r\n".join([*lines, "", ""]).encode())
    return client


def until(condition: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 120.0
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def test_a_client_that_does_not_read_delays_nobody_and_is_dropped(
    vertical: Experiment, view_of: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "STALLED_S", 2.0)
    with view_of(vertical, False) as view, stuck_client(view) as stuck:
        clients = view._server.clients
        until(lambda: len(clients) == 1)
        (behind,) = clients
        held = 0
        number, end_s = 0, time.monotonic() + 120.0
        while clients:  # 30 kB each time: soon more than the sockets hold
            assert time.monotonic() < end_s
            number += 1
            view.board.hear(f"{number} {'x' * 150}\n" * 200)
            time.sleep(0.01)
            held = max(held, len(behind.ws_connection.stream._write_buffer) if behind.ws_connection else 0)
        assert 0 < held < 70_000  # one message, and no other behind it

        async def news() -> list[float]:
            client = await websocket.websocket_connect(view.url.replace("http", "ws") + "news")
            times = []
            while len(times) < 20:
                if '"now"' in str(await client.read_message())[:20]:
                    times.append(time.monotonic())
            await over(client)
            return times

        times = Beside(lambda: asyncio.run(news())).result()
        assert np.median(np.diff(times)) < 4 * PERIOD_S
        assert stuck.fileno() >= 0


def test_a_flight_has_the_same_bits_whoever_looks_on(vertical: Experiment, view_of: Open) -> None:
    theta = np.array([[4.8, 8.0], [2.0, 3.0], [6.5, 9.0]])
    plan = Plan(theta, np.full(3, 77, dtype=np.uint64), np.arange(3, dtype=np.uint64))
    here = np.concatenate([flown.outcomes for flown in WorldSource(vertical.make_world(), vertical).fly(plan)])
    with SilProcess(vertical.make_world()) as vehicle, view_of(vertical, False) as view, stuck_client(view):
        with CrazyflieSource(vehicle.uri, vertical, Options(observer=view.board)) as source:
            assert view.board.contact is not None
            there = np.concatenate([flown.outcomes for flown in source.fly(plan)])
            until(lambda: '"p_W_m":[' in view._pump.parts["now"].text)
        assert view.board.contact is None
    assert there.tobytes() == here.tobytes()


def test_the_command_serves_the_page_while_it_learns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    seen: list[int] = []
    serve = View.__exit__

    def leave(view: View, *why: Any) -> None:
        seen.append(status(view.url))
        seen.append(len(view.board.lines))
        serve(view, *why)

    monkeypatch.setattr(View, "__exit__", leave)
    small = ["learner.name=ephe_robust", "n_rollouts=2", "budget=4", "check.effort=0.01", "check.n_fresh=10"]
    small += ["check.grid.rrev_c_per_s={lo: 4.5, hi: 5, step: 0.1}", "check.grid.moment_y_Nmm={lo: 7, hi: 9, step: 1}"]
    words = [word for text in small for word in ("--set", text)] + ["--trials", "1", "--json"]
    assert cli.run(["learn", "experiments/paper_vertical.yaml", *words, "--live-at", "127.0.0.1:0"]) == 0
    told = capsys.readouterr().err
    assert "live view: http://127.0.0.1:" in told
    assert "stream for Foxglove: ws://127.0.0.1:" in told
    assert seen[0] == 200
    assert seen[1] >= 3  # folder, episodes, judging


@pytest.mark.parametrize("text", ["8764", "127.0.0.1", "127.0.0.1:x", "127.0.0.1:70000", ":80"])
def test_an_address_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="HOST:PORT"):
        address(text)


def test_an_address_that_is_taken_is_refused(vertical: Experiment, tmp_path: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=r"--live-at"):
            View(vertical, tmp_path, ("127.0.0.1", port), True, print)
        with pytest.raises(ConfigError, match=r"--live-at"):
            View(vertical, tmp_path, ("127.0.0.1", port - 1), True, print)

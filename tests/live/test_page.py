"""The page in a real browser: a simulated run, a rehearsed one, and the stop button."""

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from looking import Beside, Look
from playwright.sync_api import Browser

from ivl import run
from ivl.experiment import Experiment
from ivl.links import preflight
from ivl.links.operators import ConsoleOperator, Seen, Upcoming
from ivl.links.options import Options
from ivl.links.stop import Stop
from ivl.live.view import View

Open = Callable[..., Any]


def test_a_simulated_run_is_replayed_and_its_search_is_shown(
    browser: Browser, vertical: Experiment, view_of: Open, tmp_path: Path
) -> None:
    with view_of(vertical, True) as view:
        run.run(vertical, tmp_path / "run")
        look = Look(browser, view.url)
        look.until("live.parts.learning && live.parts.landing && live.parts.now.replay")
        assert look.text("flights") == "4 / 4"
        assert look.text("next") == "all flown"
        assert "simulated: replay of rollout 4" in look.text("pose-note")
        assert look.text("verdict") == look.value("live.parts.landing.simulated_verdict")
        assert look.value("live.parts.learning.episodes.length") == 2
        first = look.value("live.frames")
        look.until(f"live.frames > {first + 5}")
        assert look.value("live.drawn.side.body") != look.value("live.drawn.side.surface")
        assert look.page.locator("#stop").is_disabled()
    look.until("!document.querySelector('#stale').hidden")
    assert look.text("stale") == "The run is over. This is its last news."
    assert look.complaints == [text for text in look.complaints if "WebSocket" in text]  # it has closed
    assert look.foreign == []
    look.page.close()


class Waits(ConsoleOperator):
    """An operator who lets the test look before the flight and after it."""

    def __init__(self) -> None:
        self.may_fly, self.may_judge = threading.Event(), threading.Event()

    def place(self, _: Upcoming) -> None:
        assert self.may_fly.wait(240.0)

    def confirm(self, suggested: Seen, *_: object) -> Seen:
        assert self.may_judge.wait(240.0)
        return suggested


def _shown(look: Look, view: View) -> tuple[Any, Any]:
    """The landing that the page shows, and what its flight recorder kept; the page may be one landing late."""
    for _ in range(100):
        landing, curves = view.board.landing, look.value("live.parts.landing")
        if curves["theta"] == pytest.approx(landing.rollout.theta):
            return curves, landing.recording
        time.sleep(0.1)
    raise AssertionError("the page never shows the last landing")


def test_a_rehearsed_day_is_shown_as_the_vehicle_tells_it(
    browser: Browser, in_room: Experiment, view_of: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preflight, "P95_S_MAX", 10.0)  # a busy machine answers late; that is no fault of the room
    operator = Waits()
    with view_of(in_room, False) as view:
        options = Options(
            operator=operator, rehearse=True, say=lambda line: view.board.hear(f"{line}\n"), observer=view.board
        )
        flown = Beside(lambda: run.run(in_room, tmp_path / "run", uri="rehearsal://", flight=options))
        look = Look(browser, view.url)
        look.until("live.parts.now.vehicle && live.parts.upcoming && live.parts.learning")
        assert look.text("phase") == "idle"
        assert look.text("battery").endswith(" V")
        assert look.text("link").endswith(" lost")
        assert look.text("next-title") == "Next policy: rollout 1 of 4"
        upcoming = view.board.upcoming
        assert f"{upcoming.forecast.n_landed} of 64 land" in look.text("next-note")
        assert look.value("live.parts.room.fence_m") == [[-2.0, 1.0], [-1.2, 1.2], [-0.2, 4.0]]
        operator.may_fly.set()
        look.until("live.trail.some(([x, y, z]) => z > 0.3)")
        operator.may_judge.set()
        look.until("live.parts.landing && live.parts.learning && live.parts.learning.n_flown > 0")
        curves, recording = _shown(look, view)
        at_zero = int(np.argmin(np.abs(curves["recorded"]["t_s"])))  # the trigger, or the end of a flight without one
        row = -1 if recording.trigger_row is None else recording.trigger_row
        gap_m = float(in_room.make_world().surface.gap_m(recording.rows["p_W_m"][row]))
        assert curves["recorded"]["gap_m"][at_zero] == pytest.approx(gap_m, abs=0.03)
        assert curves["simulated"]["t_s"]
        assert not look.page.locator("#has-recorded").is_hidden()
        flown.result()
        look.until("live.parts.log && live.parts.log.some((line) => line.startsWith('flown: '))")
    assert [text for text in look.complaints if "WebSocket" not in text] == []
    look.page.close()


class Fake:
    """A vehicle that can be stopped."""

    def __init__(self) -> None:
        self.reason, self.n_sent = "", 0

    def stop(self, reason: str, motors_off: bool) -> None:
        del motors_off
        self.reason = reason

    def send_stop(self) -> None:
        self.n_sent += 1


def test_the_button_stops_what_flies_as_ivl_stop_does(
    browser: Browser, vertical: Experiment, view_of: Open, tmp_path: Path
) -> None:
    (tmp_path / "run").mkdir()
    said: list[str] = []
    vehicle, stop = Fake(), Stop(tmp_path / "run", False, said.append)
    with view_of(vertical, False) as view:
        look = Look(browser, view.url, view.token)
        assert look.page.locator("#stop").is_disabled()
        stop.begin(vehicle)
        look.until("!document.querySelector('#stop').disabled")
        look.page.click("#stop")
        look.until("document.querySelector('#told').textContent === 'STOP: stopped'")
        stop.end()
        assert vehicle.reason == "stopped by ivl stop"
        assert vehicle.n_sent > 0
        stranger = Look(browser, view.url)
        stop.begin(vehicle)
        stranger.until("live.parts.now.flies")
        assert stranger.page.locator("#stop").is_disabled()
        stop.end()
        stranger.page.close()
    look.page.close()


def test_a_question_at_the_terminal_is_shown_until_it_is_answered(
    browser: Browser, vertical: Experiment, view_of: Open
) -> None:
    from ivl.cli import console

    answered = threading.Event()

    def read() -> str:
        assert answered.wait(240.0)
        return "changed\n"

    with view_of(vertical, False) as view, console.overheard(view.board.hear):
        operator = ConsoleOperator(console.err, 0, view.board.reader(read))
        asked = Beside(lambda: operator.change_battery(3.42, 3.7))
        look = Look(browser, view.url)
        look.until("!document.querySelector('#asked').hidden")
        assert "change the battery and switch the vehicle on" in look.text("asked")
        answered.set()
        asked.result()
        look.until("document.querySelector('#asked').hidden")
        assert look.text("log").splitlines() == [
            "BATTERY: 3.42 V, needed 3.70 V; the same rollout is next.",
            "change the battery and switch the vehicle on, then [changed | stop]: changed",
        ]
    look.page.close()

"""A page in the browser, with all that it asked for and complained of; a run in a thread of its own."""

import threading
import time
from collections.abc import Callable
from typing import Any

from browsing import DEADLINE_MS
from playwright.sync_api import Browser, Page, Request, Route


class Look:
    """At one page."""

    def __init__(
        self, browser: Browser, url: str, fragment: str = "", also: tuple[str, ...] = ("data:",), width: int = 1400
    ) -> None:
        """Open `url`; other requests than those that begin with it or with one of `also` are refused and kept."""
        self.page: Page = browser.new_page(viewport={"width": width, "height": 900})
        self.page.set_default_timeout(DEADLINE_MS)
        self.complaints: list[str] = []
        self.foreign: list[str] = []

        def gate(route: Route, request: Request) -> None:
            if request.url.startswith((url, *also)):
                route.continue_()
            else:
                self.foreign.append(request.url)
                route.abort()

        self.page.route("**/*", gate)
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.goto(f"{url}#{fragment}" if fragment else url)
        self.page.wait_for_selector("body[data-ready=true]")

    def text(self, name: str) -> str:
        return self.page.locator(f"#{name}").inner_text()

    def until(self, script: str) -> None:
        """Until an expression is true; the page's policy forbids the browser's own way to wait."""
        end_s = time.monotonic() + DEADLINE_MS / 1000.0
        while not self.page.evaluate(script):
            assert time.monotonic() < end_s, script
            self.page.wait_for_timeout(20)

    def value(self, script: str) -> Any:
        return self.page.evaluate(script)


class Beside:
    """A function in a thread; `result` raises what it raised."""

    def __init__(self, do: Callable[[], Any]) -> None:
        self._do, self._found, self._error = do, None, None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._found = self._do()
        except BaseException as error:  # noqa: BLE001 - raised where it is asked for
            self._error = error

    def result(self) -> Any:
        self._thread.join(240.0)
        assert not self._thread.is_alive()
        if self._error is not None:
            raise self._error
        return self._found

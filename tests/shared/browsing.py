"""A real browser without network, and how it is started."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, sync_playwright

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--no-sandbox --disable-quic --no-first-run --disable-background-networking --disable-component-update "
    "--disable-sync --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
)

DEADLINE_MS = 240_000  # for a machine that is busy; nothing is judged by it


@contextmanager
def browsing() -> Iterator[Browser]:
    """A browser for as long as this lasts."""
    assert CHROMIUM.exists(), f"{CHROMIUM} is missing: run the tests by `make test-report`, which installs it"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=str(CHROMIUM), headless=True, args=FLAGS.split(), timeout=DEADLINE_MS
        )
        yield browser
        browser.close()

"""The live view of one run: a thread with the page and the stream, until it is closed.

Opened as a context manager, it serves; what it shows is what its `board` is told.
"""

import asyncio
import secrets
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.live.board import Board
from ivl.live.pump import Pump
from ivl.live.server import Server
from ivl.live.stream import Stream

DEFAULT_AT = "127.0.0.1:8764"
"""Where the page is; Foxglove looks for a stream at the next port by itself."""
_END_S = 5.0


class View:
    """Use as a context manager; the board is what to tell."""

    def __init__(
        self, experiment: Experiment, folder: Path, at: tuple[str, int], in_process: bool, say: Callable[[str], None]
    ) -> None:
        """Listen.

        Args:
            experiment: What is run.
            folder: Run folder.
            at: Address and port of the page; the stream has the next port. Port 0: both any that is free.
            in_process: No vehicle is flown; landings are replayed.
            say: Told where the page is, and why it ended if it did.

        Raises:
            ConfigError: An address is not free.
            IvlError: A package is missing.
        """
        host, port = at
        self.board, self._say = Board(folder), say
        self.token = secrets.token_urlsafe(16)
        self.stream = Stream(host, port + 1 if port else 0)
        self._pump = Pump(self.board, experiment, in_process)
        try:
            self._server = Server(self._pump, host, port, self.token, self.stream.url)
        except BaseException:
            self.stream.close()
            raise
        self.url = f"http://{f'[{host}]' if ':' in host else host}:{self._server.port}/"
        self._ended: asyncio.Event | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ivl-live", daemon=True)

    def __enter__(self) -> Self:
        """Serve from now on, and say where."""
        self._thread.start()
        self._ready.wait()
        self._say(f"live view: {self.url}#{self.token}")
        self._say(f"stream for Foxglove: {self.stream.url}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Show the last news, and end."""
        self.board.stage = "over" if kind is None else f"ended: {error or kind.__name__}"
        if self._loop is not None and self._ended is not None and self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(_END_S)
        self.stream.close()

    def _run(self) -> None:
        """A view that breaks must not end a flight: it is said, and flying goes on without it."""
        try:
            asyncio.run(self._serve())
        except Exception as error:  # noqa: BLE001 - whatever it is, it is told
            self._say(f"the live view has ended: {type(error).__name__}: {error}")
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        self._server.begin()
        self._ready.set()
        try:
            await self._pump.run(self.stream.show, self._ended)
        finally:
            await self._server.end()


def address(text: str) -> tuple[str, int]:
    """HOST:PORT as address and port.

    Raises:
        ConfigError: It is neither.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or int(port) > 65534:
        raise ConfigError(f"--live-at: value {text!r} is not HOST:PORT (allowed ports 0 .. 65534; 0: any)")
    return host.strip("[]"), int(port)

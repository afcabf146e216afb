"""The page: its files, its parts over a web socket, and the stop button.

Each client is served by a coroutine of its own, which sends the latest of each part that the client does not have, and
waits until that is gone. A client that does not read is behind, alone, and is dropped after a while; nothing is queued
for it. Anybody who reaches the address may look; only who has the token may stop.
"""

import asyncio
import hmac
import json
import socket
from pathlib import Path
from typing import Any

from tornado import httpserver, web, websocket
from tornado.iostream import StreamClosedError

from ivl.errors import ConfigError, StoreError
from ivl.links import stop
from ivl.live.pump import PERIOD_S, Pump

ASSETS = Path(__file__).parent
LOOPBACK = ("127.0.0.1", "::1", "localhost")
TOKEN_HEADER = "X-Ivl-Token"
CLIENTS_MAX = 16
SEND_BYTES = 65536
"""The system keeps no more for a client: what it has not read would only be older."""
STALLED_S = 10.0
"""A client that takes nothing for so long is dropped."""
_FILES = {"": "live.html", "live.css": "live.css", "draw.js": "draw.js", "plots.js": "plots.js", "live.js": "live.js"}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Server:
    """Serves one pump; all but the constructor belongs to the thread of its event loop."""

    def __init__(self, pump: Pump, host: str, port: int, token: str, stream_url: str) -> None:
        """Listen.

        Raises:
            ConfigError: The address is not free, or is none.
        """
        self.pump, self.token, self.stream_url = pump, token, stream_url
        self.loopback = host in LOOPBACK
        self.clients: set[News] = set()
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            self._socket = socket.create_server((host, port), family=family)
        except OSError as error:
            raise ConfigError(f"--live-at {host}:{port}: {error.strerror}: choose another with --live-at") from error
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)  # a connection takes it over
        self.port: int = self._socket.getsockname()[1]
        self._http: httpserver.HTTPServer | None = None

    def begin(self) -> None:
        """Answer from now on."""
        own: dict[str, Any] = {"server": self}
        routes: list[Any] = [(r"/news", News, own), (r"/stop", StopButton, own), (r"/(.*)", Asset, own)]
        self._http = httpserver.HTTPServer(web.Application(routes, log_function=_say_nothing), max_body_size=1024)
        self._http.add_sockets([self._socket])

    async def end(self) -> None:
        """Give each client its last news, for a moment, and close."""
        await asyncio.sleep(2 * PERIOD_S)
        for client in list(self.clients):
            client.close(1001, "the program has ended")
        if self._http is not None:
            self._http.stop()
            await asyncio.wait_for(self._http.close_all_connections(), 1.0)


def _say_nothing(handler: web.RequestHandler) -> None:
    """Keep requests out of the terminal of a run."""
    del handler


class _Guarded(web.RequestHandler):
    """Refuses what another page in the same browser may try."""

    def initialize(self, server: Server) -> None:
        """Called by the library with the route's arguments."""
        self.server = server

    def prepare(self) -> None:
        """A page elsewhere may name a host of its own that leads here: then the name is not ours."""
        name = self.request.host.rpartition(":")[0].strip("[]") or self.request.host
        if self.server.loopback and name not in LOOPBACK:
            raise web.HTTPError(403)

    def set_default_headers(self) -> None:
        """Nothing from elsewhere, kept nowhere."""
        self.clear_header("Server")
        self.set_header("Content-Security-Policy", _POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cache-Control", "no-store")


class Asset(_Guarded):
    """A file of the page."""

    def get(self, name: str) -> None:
        """Answer with it."""
        if name not in _FILES:
            raise web.HTTPError(404)
        kinds = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}
        path = ASSETS / _FILES[name]
        self.set_header("Content-Type", f"{kinds[path.suffix]}; charset=utf-8")
        self.finish(path.read_bytes())


class StopButton(_Guarded):
    """The same as `ivl stop`, for who has the token."""

    async def post(self) -> None:
        """Stop, and say what came of it."""
        given = self.request.headers.get(TOKEN_HEADER, "")
        if not hmac.compare_digest(given.encode(), self.server.token.encode()):
            raise web.HTTPError(403)
        folder = self.server.pump.board.folder
        try:
            done = await asyncio.to_thread(stop.ask, folder)
            text = "stopped" if done else "asked, but nobody has answered: use the terminal"
        except StoreError as error:
            done, text = False, str(error)
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps({"stopped": done, "text": text}))


class News(_Guarded, websocket.WebSocketHandler):
    """The parts of the page, as they change."""

    async def get(self, *args: Any, **kwargs: Any) -> None:
        """Take a client, if there is room for one more."""
        if len(self.server.clients) >= CLIENTS_MAX:
            raise web.HTTPError(503)
        await super().get(*args, **kwargs)

    def open(self, *args: str, **kwargs: str) -> None:
        """Begin to serve it."""
        del args, kwargs
        self.set_nodelay(True)
        self.server.clients.add(self)
        self._serving = asyncio.ensure_future(self._serve())

    async def _serve(self) -> None:
        has: dict[str, int] = {}
        try:
            await self.write_message(json.dumps({"part": "stream", "data": self.server.stream_url}))
            while True:
                for name, part in list(self.server.pump.parts.items()):
                    if has.get(name) != part.version:
                        await self._send(part.text)
                        has[name] = part.version
                async with self.server.pump.ticked:
                    await self.server.pump.ticked.wait()
        except (websocket.WebSocketClosedError, StreamClosedError):
            pass  # it has gone
        except TimeoutError:
            self.close(1008, "too slow")
        finally:
            self.server.clients.discard(self)

    async def _send(self, text: str) -> None:
        """Return when the system has taken it.

        Raises:
            TimeoutError: The client takes nothing.
        """
        sent = asyncio.ensure_future(self.write_message(text))
        taken, _ = await asyncio.wait({sent}, timeout=STALLED_S)
        if not taken:
            sent.add_done_callback(lambda late: late.exception())  # it will only say that the client is gone
            raise TimeoutError
        sent.result()

    def on_message(self, message: str | bytes) -> None:
        """Nothing is taken."""
        del message

    def on_close(self) -> None:
        """It has gone."""
        self.server.clients.discard(self)

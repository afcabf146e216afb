"""A stream for Foxglove: the topics of `ivl export`, live, over the web socket protocol of its SDK.

What a client does not take in time is dropped by the SDK, whose threads are its own. Clients can send nothing.
"""

from typing import Any

from ivl.errors import ConfigError, IvlError
from ivl.export import schemas, topics
from ivl.export.flight import Flight

_BACKLOG = 64
"""Messages that are kept for a client that is behind, under a second; then its oldest is dropped."""


class Stream:
    """A server; `show` each moment."""

    def __init__(self, host: str, port: int) -> None:
        """Listen.

        Raises:
            IvlError: The SDK is not installed.
            ConfigError: The address is not free.
        """
        try:
            import foxglove
        except ModuleNotFoundError as error:
            raise IvlError("a live view needs Foxglove's SDK: pip install 'ivl[live]'") from error
        self._sdk, self._context = foxglove, foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        try:
            self._server = foxglove.start_server(
                name="ivl", host=host, port=port, context=self._context, message_backlog_size=_BACKLOG
            )
        except RuntimeError as error:
            raise ConfigError(f"--live-at: the stream at {host}:{port}: {error}: choose another port") from error
        self.url = f"ws://{host}:{self._server.port}"

    def show(self, row: Flight) -> None:
        """Send a moment; nobody is waited for."""
        if not self._channels:
            self._channels = {topic: self._channel(topic, name, row) for topic, name in topics.TOPICS.items()}
        if not any(channel.has_sinks() for channel in self._channels.values()):
            return
        for t_ns, topic, message in topics.messages(row):
            self._channels[topic].log(topics.encoded(message), log_time=t_ns)

    def _channel(self, topic: str, name: str, row: Flight) -> Any:
        """A topic as clients see it; the columns of a run's rows are the same all through the run."""
        schema = self._sdk.Schema(name=name, encoding="jsonschema", data=schemas.text(name, row.columns))
        return self._sdk.Channel(topic, message_encoding="json", schema=schema, context=self._context)

    def close(self) -> None:
        """End it."""
        for channel in self._channels.values():
            channel.close()
        self._server.stop()

"""MCAP: one file with the topics of `ivl.export.topics`, for Foxglove and PlotJuggler."""

from pathlib import Path

from mcap.writer import Writer

import ivl
from ivl import files
from ivl.export import schemas, topics
from ivl.export.flight import Flight


def write(flight: Flight, path: Path) -> None:
    """Write a flight; raises OSError if the file cannot be written."""
    with files.replacing(path) as part, part.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=f"ivl {ivl.__version__}")
        channels = {}
        for topic, name in topics.TOPICS.items():
            schema = writer.register_schema(name, "jsonschema", schemas.text(name, flight.columns))
            channels[topic] = writer.register_channel(topic, "json", schema)
        for number, (t_ns, topic, message) in enumerate(topics.messages(flight)):
            data = topics.encoded(message)
            writer.add_message(channels[topic], log_time=t_ns, publish_time=t_ns, sequence=number, data=data)
        writer.add_metadata("landing", {"title": flight.title, **flight.facts})
        writer.finish()  # type: ignore[no-untyped-call]

"""The stream for Foxglove, read back with a web socket client: the topics, schemas and numbers of the exports."""

import asyncio
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from looking import Beside
from tornado import websocket

from ivl import run
from ivl.experiment import Experiment
from ivl.export import schemas, topics
from ivl.live import last_flight
from ivl.live.plain import plain

Open = Callable[..., Any]
_OP_MESSAGE = 1


async def listen(url: str, n: int) -> tuple[dict[str, Any], dict[str, list[tuple[int, Any]]]]:
    """What a client is offered by topic, and the first `n` messages of each topic: time in ns, content."""
    client = await websocket.websocket_connect(url, subprotocols=["foxglove.sdk.v1"])
    offered: dict[str, Any] = {}
    heard: dict[str, list[tuple[int, Any]]] = {}
    topic_of: dict[int, str] = {}
    while len(offered) < len(topics.TOPICS) or any(len(found) < n for found in heard.values()):
        data = await asyncio.wait_for(client.read_message(), 120.0)
        assert data is not None
        if isinstance(data, str):
            message = json.loads(data)
            for channel in message.get("channels", []) if message["op"] == "advertise" else []:
                offered[channel["topic"]] = channel
                topic_of[channel["id"]] = channel["topic"]
                heard[channel["topic"]] = []
                asked = [{"id": channel["id"], "channelId": channel["id"]}]
                await client.write_message(json.dumps({"op": "subscribe", "subscriptions": asked}))
        elif data[0] == _OP_MESSAGE:
            _, number, t_ns = struct.unpack("<BIQ", data[:13])
            heard[topic_of[number]].append((t_ns, json.loads(data[13:])))
    client.close()
    while await client.read_message() is not None:
        pass
    return offered, heard


def test_a_replay_is_streamed_with_the_topics_of_the_exports(
    vertical: Experiment, view_of: Open, tmp_path: Path
) -> None:
    run.run(vertical, tmp_path / "run")
    with view_of(vertical, True) as view:
        offered, heard = Beside(lambda: asyncio.run(listen(view.stream.url, 4))).result()
        flight = view._pump._replay._flight
    assert {topic: channel["schemaName"] for topic, channel in offered.items()} == topics.TOPICS
    for topic, channel in offered.items():
        assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
        expected = schemas.text(topics.TOPICS[topic], flight.columns)
        assert json.loads(channel["schema"]) == json.loads(expected)
    states, poses = heard["/ivl/state"], heard["/ivl/pose"]
    heights_m = flight.columns["p_WB_m_3"]
    for _, state in states:
        row = int(np.flatnonzero(heights_m == state["p_WB_m_3"])[0])
        assert state["pitch_deg"] == flight.columns["pitch_deg"][row]
        assert set(state) == {*flight.columns, "phase_name"}
    times = [t_ns for t_ns, _ in poses]
    assert times == sorted(times)
    assert np.median(np.diff(times)) < 0.5e9
    drawn = {entity["id"] for _, scene in heard["/ivl/scene"] for entity in scene["entities"]}
    assert drawn <= {"ceiling", "body", "legs"}


def test_a_replay_shows_every_part_of_a_landing_at_a_quarter_of_its_speed(vertical: Experiment) -> None:
    world = vertical.make_world()
    trace = last_flight.simulate(vertical, world, (4.8, 8.0), 1, 2)
    replay = last_flight.Replay(3, world, trace, 100.0)
    span_s = float(trace.rows.t_s[-1] - trace.rows.t_s[0])
    for share in (0.0, 0.3, 0.7, 0.999):
        row = replay.row(100.0 + share * span_s / last_flight.SPEED, 1.7e9)
        i = int(np.searchsorted(trace.rows.t_s, trace.rows.t_s[0] + share * span_s))
        assert row.vector("p_WB_m", 3)[0] == pytest.approx(trace.rows.p_WB_m[i], abs=5e-3)
        assert row.t_s.tolist() == [1.7e9]
    assert last_flight.moment(row)["feet_stuck"] == (trace.rows.foot_state[-1] == 2).tolist()


def test_numbers_that_are_none_are_null() -> None:
    assert plain({"a": (1.0, float("nan")), "b": np.array([np.inf, 2.0]), "c": np.float32(1.5), 4: None}) == {
        "a": [1.0, None], "b": [None, 2.0], "c": 1.5, "4": None,
    }  # fmt: skip

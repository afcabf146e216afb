"""Packets as frames and back: known answers, every loss, and whatever else a bus may carry."""

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivl.can import ident, requests
from ivl.can.fragments import Joiner, Splitter
from ivl.can.repeat import LogMemory, Repeater

PACKETS = st.binary(min_size=1, max_size=31)
PING, SETPOINT, READ = b"\xfc\x00", b"\x3c" + bytes(14), b"\x2d\x05\x00"


def frames_of(packet_list: list[bytes], fd: bool, node: int = 3) -> list[list[can.Message]]:
    splitter = Splitter(node, to_vehicle=True, fd=fd)
    return [splitter.split(packet) for packet in packet_list]


# ---- identifiers


def test_identifier_bits_by_hand() -> None:
    word = ident.pack(ident.Ident(5, 9, True, False, 2, 19, 0xA7))
    assert f"{word:029b}" == "10110110100110101001110100111"
    assert word < 1 << 29


@given(word=st.integers(0, 2**29 - 1))
def test_identifier_is_ours_only_with_the_magic(word: int) -> None:
    found = ident.unpack(word)
    assert (found is None) == (word >> 21 & 0x1F != ident.MAGIC)
    assert found is None or ident.pack(found) == word


@pytest.mark.parametrize("wrong", [{"node": 16}, {"sequence": 32}, {"prio": 8}, {"fragment": 4}, {"header": 256}])
def test_identifier_refuses_what_does_not_fit(wrong: dict[str, int]) -> None:
    values = {"prio": 0, "node": 0, "to_vehicle": True, "is_last": True, "fragment": 0, "sequence": 0, "header": 0}
    with pytest.raises(ValueError, match="does not fit"):
        ident.pack(ident.Ident(**{**values, **wrong}))


def test_what_stops_the_vehicle_wins_the_bus() -> None:
    emergency, setpoint, request, stream = (
        Splitter(0, True, False).split(packet)[0].arbitration_id
        for packet in (b"\x9d\x03", SETPOINT, READ, b"\x52\x00")
    )
    assert emergency < setpoint < request < stream


# ---- fragments


@given(packet=PACKETS, fd=st.booleans(), node=st.integers(0, 15))
def test_packet_comes_back(packet: bytes, fd: bool, node: int) -> None:
    (frames,) = frames_of([packet], fd, node)
    assert len(frames) <= (1 if fd else 4)
    assert all(len(frame.data) in ((8, 12, 16, 20, 24, 32) if fd else range(9)) for frame in frames)
    joiner = Joiner(node, to_vehicle=True)
    assert [joiner.join(frame) for frame in frames] == [None] * (len(frames) - 1) + [packet]


@pytest.mark.parametrize("packet", [b"", bytes(32)])
def test_packet_of_wrong_size_is_refused(packet: bytes) -> None:
    with pytest.raises(ValueError, match=r"1 \.\. 31 bytes"):
        Splitter(0, True, False).split(packet)


def test_frames_of_others_are_ignored() -> None:
    joiner = Joiner(node=3, to_vehicle=False)
    others = [Splitter(3, True, False), Splitter(4, False, False)]
    frames = [splitter.split(PING)[0] for splitter in others]
    ours = Splitter(3, False, False).split(PING)[0]
    frames += [
        can.Message(arbitration_id=ours.arbitration_id & 0x7FF, is_extended_id=False, data=[0]),
        can.Message(arbitration_id=ours.arbitration_id, is_remote_frame=True),
        can.Message(arbitration_id=ours.arbitration_id, is_error_frame=True),
    ]
    assert [joiner.join(frame) for frame in frames] == [None] * 5
    assert joiner.join(ours) == PING


@settings(max_examples=100)
@given(
    sent=st.lists(PACKETS, min_size=1, max_size=20),
    fd=st.booleans(),
    lost=st.lists(st.booleans(), min_size=80, max_size=80),
)
def test_lost_frames_lose_their_packets_and_no_other(sent: list[bytes], fd: bool, lost: list[bool]) -> None:
    # one header, so that all have one sequence; the last packet arrives, so that every gap is seen
    sent = [b"\x2c" + packet[1:] for packet in [*sent, b"\x2cend"]]
    joiner, expected, received, dropping = Joiner(3, True), [], [], iter(lost)
    first = frames_of([b"\x2cbegin", *sent], fd)
    joiner.join(first[0][0])
    for packet, frames in zip(sent, first[1:], strict=True):
        kept = [frame for frame in frames if packet is sent[-1] or not next(dropping, False)]
        expected += [packet] if len(kept) == len(frames) else []
        received += [p for p in map(joiner.join, kept) if p is not None]
    assert received == expected
    counts = joiner.counts
    assert counts.n_packets == 1 + len(expected)
    assert counts.n_packets + counts.n_missing + counts.n_bad == 1 + len(sent)


def test_frame_that_comes_twice_counts_once() -> None:
    joiner = Joiner(3, True)
    (frames,) = frames_of([bytes(range(31))], fd=False)
    twice = [frame for frame in frames for _ in range(2)]
    assert [p for p in map(joiner.join, twice) if p] == [bytes(range(31))]
    assert (joiner.counts.n_doubled, joiner.counts.n_bad, joiner.counts.n_missing) == (4, 0, 0)


def test_a_higher_priority_may_come_between() -> None:
    slow, fast = b"\x52" + bytes(30), SETPOINT
    a, b = frames_of([slow, fast], fd=False)
    joiner = Joiner(3, True)
    order = [a[0], b[0], a[1], b[1], a[2], a[3]]
    assert [p for p in map(joiner.join, order) if p] == [fast, slow]
    assert joiner.counts.n_bad == 0


FRAMES = st.builds(
    can.Message,
    arbitration_id=st.builds(
        lambda word, ours: word & ~(0x1F << 21) | ident.MAGIC << 21 & -ours if ours else word,
        st.integers(0, 2**29 - 1),
        st.booleans(),
    ),
    is_extended_id=st.just(True),
    is_fd=st.booleans(),
    data=st.binary(max_size=8),
)


@settings(max_examples=100)
@given(frames=st.lists(FRAMES, max_size=30), node=st.integers(0, 15), to_vehicle=st.booleans())
def test_joiner_survives_any_frames(frames: list[can.Message], node: int, to_vehicle: bool) -> None:
    joiner = Joiner(node, to_vehicle)
    joined = [p for p in map(joiner.join, frames) if p is not None]
    assert all(1 <= len(packet) <= 31 for packet in joined)
    assert joiner.counts.n_packets == len(joined)
    # whatever came before, the next good packet comes through
    (good,) = frames_of([bytes(range(31))], fd=False, node=node)
    splitter = Splitter(node, to_vehicle, False)
    assert [p for p in map(joiner.join, splitter.split(b"\xee\x01")) if p] in ([b"\xee\x01"], [])
    assert [p for p in map(joiner.join, splitter.split(b"\xee" + bytes(20))) if p] == [b"\xee" + bytes(20)]
    assert len(good) == 4


@given(data=st.binary(min_size=1, max_size=64), word=st.integers(0, 255))
def test_joiner_survives_any_fd_data(data: bytes, word: int) -> None:
    size = next(s for s in (*range(9), 12, 16, 20, 24, 32, 48, 64) if s >= len(data))
    data = data.ljust(size, b"\0")
    frame = frames_of([bytes([word])], fd=True)[0][0]
    joiner = Joiner(3, True)
    packet = joiner.join(can.Message(arbitration_id=frame.arbitration_id, is_fd=True, data=data))
    good = data[0] <= 30 and data[0] < len(data)
    assert packet == (bytes([word]) + data[1 : 1 + data[0]] if good else None)


# ---- which requests may be repeated

ANSWERS = [
    (b"\xfd\x00", b"\xf1Bitcraze Crazyflie"),
    (b"\xdd\x00", b"\xd1\x00\x0c\x00\x00\x00"),
    (b"\x5d\x05", b"\x51\x05\x00\x00"),
    (b"\x5c\x03", b"\x50\x03\x10\x00\x01\x02\x03\x04\x10\x80"),
    (b"\x5c\x02\x07\x01", b"\x50\x02\x07\x01\x07group\0name\0"),
    (b"\x2c\x02\x07\x01", b"\x20\x02\x07\x01\x08group\0name\0"),
    (b"\x2d\x07\x01", b"\x21\x07\x01\x00\x05"),
    (b"\x2e\x07\x01\x05", b"\x22\x07\x01\x05"),
    (b"\x2f\x07\x07\x01", b"\x23\x07\x07\x01\x00\x01"),
    (b"\x2f\x00group\0name\0\x08\x01", b"\x23\x00group\0name\0\x00"),
    (b"\x4c\x01", b"\x40\x01\x02"),
    (b"\x4c\x02\x01", b"\x40\x02\x01\x18\x00\x01\x00\x00" + bytes(8)),
    (b"\x4d\x01\x10\x00\x00\x00\x18", b"\x41\x01\x10\x00\x00\x00\x00" + bytes(24)),
    (b"\x5d\x06\x01\x07\x00\x00", b"\x51\x06\x01\x00"),
    (b"\x5d\x07\x01\x07\x00\x00", b"\x51\x07\x01\x00"),
    (b"\x5d\x03\x01\x01", b"\x51\x03\x01\x00"),
    (b"\x9c\x0c", b"\x90\x8c\x03\x00"),
]
NEVER = [
    b"\x3c" + bytes(14),  # set-point
    b"\x7c\x00",  # stop
    b"\x7d\x00" + bytes(4),  # end of set-points
    b"\x8c\x07" + bytes(13),  # take off
    b"\x6c" + bytes(12),  # position
    b"\x6d\x08" + bytes(28),  # pose
    b"\x9d\x01\x01",  # arm
    b"\x9d\x03",  # emergency stop
    b"\xde\x01\x01" + bytes(12),  # app
    b"\xfc\x00" + bytes(8),  # ping
]


@pytest.mark.parametrize(("request_", "answer"), ANSWERS)
def test_an_answer_is_known_with_and_without_link_bits(request_: bytes, answer: bytes) -> None:
    expected = requests.answer_of(request_)
    assert expected is not None
    for header in (answer[0] & 0xF3, answer[0] | 0x0C):
        assert requests.answers(bytes([header]) + answer[1:], expected)
    assert [other for _, other in ANSWERS if requests.answers(other, expected)] == [answer]


@pytest.mark.parametrize("packet", NEVER)
def test_set_points_and_commands_are_no_requests(packet: bytes) -> None:
    assert requests.answer_of(packet) is None


@given(packet=PACKETS)
def test_any_packet_can_be_classified(packet: bytes) -> None:
    expected = requests.answer_of(packet)
    assert expected is None or expected[0] == packet[0] & 0xF3
    assert isinstance(requests.is_arming(packet), bool)


@pytest.mark.parametrize(
    ("packet", "arms"),
    [
        (b"\x9d\x01\x01", True),
        (b"\x9d\x01\x00", False),
        (b"\xd0\x01\x01", True),
        (b"\x9d\x03", False),
        (b"\x9d\x01", False),
    ],
)
def test_arming_is_seen(packet: bytes, arms: bool) -> None:
    assert requests.is_arming(packet) == arms


# ---- repeats


def test_request_is_repeated_until_it_is_answered() -> None:
    repeater = Repeater(period_s=0.05, limit_s=2.0)
    assert repeater.offer(READ, 10.0) == [READ]
    assert repeater.due(10.04) == []
    assert repeater.due(10.05) == [READ]
    assert repeater.due(10.06) == []
    assert repeater.answered(b"\x21\x06\x00\x00\x01", 10.07) == []
    assert repeater.due(10.11) == [READ]
    repeater.answered(b"\x21\x05\x00\x00\x01", 10.12)
    assert repeater.due(11.0) == []
    assert (repeater.n_repeated, repeater.n_given_up, repeater.n_waiting) == (2, 0, 0)


def test_request_without_answer_is_given_up() -> None:
    repeater = Repeater(period_s=0.0625, limit_s=0.5)
    repeater.offer(READ, 0.0)
    sent = [packet for i in range(100) for packet in repeater.due(i / 64)]
    assert sent == [READ] * 8
    assert (repeater.n_repeated, repeater.n_given_up) == (8, 1)


def test_set_point_is_sent_once() -> None:
    repeater = Repeater()
    assert repeater.offer(SETPOINT, 0.0) == [SETPOINT]
    assert repeater.due(5.0) == []


def test_newer_write_replaces_the_older_one() -> None:
    repeater = Repeater()
    repeater.offer(b"\x2e\x05\x00\x01", 0.0)
    repeater.offer(b"\x2e\x05\x00\x02", 0.01)
    assert repeater.due(0.1) == [b"\x2e\x05\x00\x02"]


def test_log_control_goes_one_at_a_time_and_in_order() -> None:
    create, append, start = b"\x5d\x06\x01\x07\x00\x00", b"\x5d\x07\x01\x07\x01\x00", b"\x5d\x03\x01\x01"
    again = b"\x5d\x07\x01\x07\x02\x00"
    repeater = Repeater()
    assert repeater.offer(create, 0.0) == [create]
    assert repeater.offer(append, 0.0) == repeater.offer(again, 0.0) == repeater.offer(start, 0.0) == []
    assert repeater.due(0.05) == [create]
    assert repeater.answered(b"\x51\x06\x01\x00", 0.06) == [append]
    assert repeater.answered(b"\x52\x01\x00\x00\x00\x05", 0.07) == []
    assert repeater.answered(b"\x51\x07\x01\x00", 0.08) == [again]
    assert repeater.answered(b"\x51\x07\x01\x00", 0.09) == [start]
    assert repeater.due(2.2) == []
    assert repeater.n_given_up == 1


def test_log_block_is_never_built_twice() -> None:
    create, append, answer = b"\x5d\x06\x01\x07\x00\x00", b"\x5d\x07\x01\x07\x01\x00", b"\x51\x07\x01\x00"
    memory = LogMemory()
    assert memory.forward(READ) == memory.forward(READ) == (True, None)
    assert memory.forward(create) == (True, None)
    assert memory.forward(create) == (False, None)
    memory.answered(b"\x51\x06\x01\x00")
    assert memory.forward(create) == (False, b"\x51\x06\x01\x00")
    assert memory.forward(append) == (True, None)
    memory.answered(answer)
    assert memory.forward(append) == (False, answer)
    assert memory.forward(b"\x5d\x05") == (True, None)
    assert memory.forward(b"\x5d\x05") == (True, None)
    assert memory.forward(create) == (True, None)

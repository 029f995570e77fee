"""The stream contract: the newest frame wins, one sender, counters that jump."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARKS, HumanFrame
from naoimitate.live.sample import Sample, StreamProtocol
from naoimitate.live.stream import SILENCE, Stream

HERE, THERE = ("127.0.0.1", 1000), ("127.0.0.2", 2000)


class Numbers:
    """A protocol whose datagrams are the sequence number in decimal digits."""

    def feed(self, datagram: bytes) -> list[Sample]:
        if not datagram.isdigit():
            raise DatagramError("no number")
        return [Sample(HumanFrame(float(datagram) * 0.01, np.zeros((len(LANDMARKS), 3))), int(datagram))]


def protocol(name: str, start: bytes) -> StreamProtocol:
    return StreamProtocol(name, name.upper(), 1, Numbers, Numbers, lambda d: d.startswith(start))  # type: ignore[arg-type]


NUMBERS, OTHER = protocol("numbers", b"1"), protocol("other", b"other")


@pytest.fixture
def stream() -> Stream:
    return Stream(NUMBERS, (NUMBERS, OTHER))


def send(stream: Stream, *numbers: int, at: float = 0.0) -> list[int | None]:
    """Sequence numbers of the frames that are used when each number is looked at as it comes."""
    used: list[int | None] = []
    for k, number in enumerate(numbers):
        stream.take(at + 0.01 * k, HERE, str(number).encode())
        newest = stream.newest()
        used.append(None if newest is None else newest[1].sequence)
    return used


def test_the_newest_frame_wins_and_is_given_once(stream: Stream) -> None:
    for k, number in enumerate((5, 6, 7)):
        stream.take(0.01 * k, HERE, str(number).encode())
    arrival, sample = stream.newest() or (0.0, None)
    assert sample is not None and sample.sequence == 7 and arrival == pytest.approx(0.02)
    assert stream.newest() is None


def test_late_and_repeated_frames_are_dropped_and_counted(stream: Stream) -> None:
    assert send(stream, 10, 12, 11, 12, 13) == [10, 12, None, None, 13]
    assert (stream.counts.late, stream.counts.lost) == (2, 1)


@pytest.mark.parametrize("begins", [0, 5_000_000])
def test_a_counter_that_jumps_is_believed_after_three_frames(stream: Stream, begins: int) -> None:
    send(stream, *range(1000, 1010))
    assert send(stream, begins, begins + 1, begins + 2, begins + 3) == [None, None, begins + 2, begins + 3]
    assert stream.counts.restarts == 1


def test_single_stray_numbers_are_never_believed(stream: Stream) -> None:
    send(stream, 100)
    assert send(stream, 3, 101, 900_000, 102, 2, 103) == [None, 101, None, 102, None, 103]


def test_a_second_sender_is_heard_when_the_first_is_silent(stream: Stream) -> None:
    send(stream, 1, 2)
    stream.take(0.5, THERE, b"77")
    assert stream.newest() is None and stream.counts.foreign == 1
    stream.take(0.01 + SILENCE + 0.1, THERE, b"3")
    assert stream.newest() is not None and stream.sender == THERE


def test_only_the_allowed_sender_is_heard() -> None:
    stream = Stream(NUMBERS, (NUMBERS,), allow=THERE[0])
    stream.take(0.0, HERE, b"1")
    assert stream.newest() is None
    stream.take(0.0, THERE, b"1")
    assert stream.newest() is not None


def test_another_protocol_is_named(stream: Stream) -> None:
    for k in range(5):
        stream.take(0.1 * k, HERE, b"other bytes")
    assert "this looks like OTHER, not NUMBERS" in stream.complaint()
    assert stream.sender is None, "who is not understood does not keep others out"


def test_what_nobody_knows_is_said(stream: Stream) -> None:
    assert stream.complaint() == ""
    stream.take(0.0, HERE, b"\xff\x00")
    assert "1 datagrams" in stream.complaint()
    send(stream, 1)
    assert stream.complaint() == ""


def test_rate_and_jitter_are_those_of_the_arrivals(stream: Stream) -> None:
    send(stream, *range(100))
    assert stream.rate == pytest.approx(100.0)
    assert stream.jitter == pytest.approx(0.0, abs=1e-9)


@given(st.lists(st.tuples(st.integers(0, 60), st.booleans()), max_size=80))
def test_frames_are_used_in_order_but_for_a_restart(events: list[tuple[int, bool]]) -> None:
    stream, last, restarts = Stream(NUMBERS, (NUMBERS, OTHER)), -1, 0
    for k, (number, damaged) in enumerate(events):
        stream.take(0.01 * k, HERE, b"\x00junk" if damaged else str(number).encode())
        newest = stream.newest()
        if newest is None:
            continue
        assert newest[1].sequence is not None
        assert newest[1].sequence > last or stream.counts.restarts > restarts
        last, restarts = newest[1].sequence, stream.counts.restarts
    assert stream.counts.datagrams == len(events)

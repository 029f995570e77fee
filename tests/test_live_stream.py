"""The stream contract: the newest frame wins, one sender, counters that jump, what is said of troubles."""

from __future__ import annotations

import math
import sys
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from naoimitate.core.errors import DatagramError
from naoimitate.core.frames import LANDMARK, LANDMARKS, HumanFrame
from naoimitate.human.body import measure
from naoimitate.live.filter import LandmarkFilter
from naoimitate.live.order import BELIEVED, MOST_NUMBERS, OVERTAKEN, Order
from naoimitate.live.protocols import osc
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.sample import Sample, StreamProtocol
from naoimitate.live.sender import Conditions, Tally, through
from naoimitate.live.stream import LACKING, NEEDED, SENDERS, SILENCE, Stream
from naoimitate.motion.builtin import tpose

HERE, THERE = ("127.0.0.1", 1000), ("127.0.0.2", 2000)


class Numbers:
    """A protocol whose datagrams are the sequence number in decimal digits."""

    def feed(self, datagram: bytes) -> list[Sample]:
        if not datagram.isdigit():
            raise DatagramError(f"no number\x1b[31m but {datagram!r}")
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
    assert (stream.counts.late, stream.counts.lost) == (2, 0)


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


def delivered(network: Conditions, rate: float, *lengths: int) -> list[tuple[float, tuple[int, int]]]:
    """When each frame (run, number) comes of senders that begin again at once, runs of so many frames."""
    came: list[tuple[float, tuple[int, int]]] = []
    begin = 0.0
    for run, length in enumerate(lengths):
        names = {b"%d" % k: (run, k) for k in range(length)}
        source = ((k / rate, [b"%d" % k]) for k in range(length))
        came += [(begin + due, names[datagram]) for due, datagram in through(network, source, 1.0 / rate, Tally())]
        begin += length / rate
    return sorted(came)


NETWORKS = [
    Conditions(jitter=jitter, loss=loss, duplicate=double, reorder=reorder, seed=7)
    for jitter in (0.05, 0.1, 0.2)
    for loss, double, reorder in ((0.0, 0.0, 0.0), (0.0, 0.3, 0.2), (0.3, 0.3, 0.2))
]


@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize("rate", [60.0, 100.0, 240.0])
def test_frames_never_go_back_whatever_the_network_does_and_the_lost_are_those_that_never_came(
    rate: float, counted: bool
) -> None:
    for network in NETWORKS:
        came, order, last = delivered(network, rate, int(10 * rate)), Order(), -1
        for due, (_, k) in came:
            if order.takes(k if counted else k / rate, due, counted):
                assert k > last
                last = k
        assert order.restarts == 0
        first, numbers = came[0][1][1], {k for _, (_, k) in came}
        missing = [k for k in range(first, last) if k not in numbers]
        assert order.lost == (len(missing) if counted else 0)


@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize("rate", [60.0, 100.0, 240.0])
@pytest.mark.parametrize("length", [5, 20, 50, 100, 700])
def test_a_sender_that_begins_again_is_believed_wherever_it_does(rate: float, length: int, counted: bool) -> None:
    came, order = delivered(Conditions(), rate, length, int(2 * rate)), Order()
    used = [(due, name) for due, name in came if order.takes(name[1] if counted else name[1] / rate, due, counted)]
    first = next(due for due, (run, _) in used if run == 1)
    at_once = length / rate > 2.0 * OVERTAKEN  # its first numbers came too long ago to be late
    assert first - length / rate <= (0.0 if at_once else OVERTAKEN) + (BELIEVED + 1) / rate
    assert [name for _, name in used] == sorted(name for _, name in used)


@pytest.mark.parametrize("rate", [60.0, 240.0])
@pytest.mark.parametrize("length", [150, 700])
def test_a_restart_is_believed_once_over_a_bad_network_and_what_was_on_its_way_is_late(
    rate: float, length: int
) -> None:
    for network in NETWORKS:
        came, order = delivered(network, rate, length, int(3 * rate)), Order()
        used = [(due, name) for due, name in came if order.takes(name[1], due, True)]
        assert order.restarts == 1
        assert [name for _, name in used] == sorted(name for _, name in used)
        assert next(due for due, (run, _) in used if run == 1) - length / rate < network.jitter + OVERTAKEN


def test_a_clock_that_begins_again_between_its_old_moments_is_believed_after_a_quarter_second() -> None:
    order, rate = Order(), 60.0
    assert all(order.takes(k / rate, k / rate, False) for k in range(50))
    came = [(0.85 + k / rate, 0.004 + k / rate) for k in range(60)]
    used = [arrival - 0.85 for arrival, number in came if order.takes(number, arrival, False)]
    assert used[0] <= OVERTAKEN + (BELIEVED + 1) / rate and order.restarts == 1


def test_the_order_remembers_a_bounded_number_of_frames() -> None:
    order = Order()
    for k in range(3 * MOST_NUMBERS):
        order.takes(2 * k, k * 1e-4, True)
        order.takes(2 * k - 7, k * 1e-4, True)
    assert order._run is not None and len(order._run._came) <= MOST_NUMBERS


def test_who_shows_nobody_keeps_no_sender_out_and_does_not_disturb_it() -> None:
    vmc = PROTOCOLS["vmc"]
    encoder, frame = vmc.encoder(), tpose()
    stream, junk = Stream(vmc, ()), osc.message("/foo", 1.0)
    lone = osc.bundles([osc.message("/VMC/Ext/Bone/Pos", "Hips", 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)], 1400)[0]
    for k in range(120):
        now = k / 60.0
        for datagram in encoder.encode(frame, k, now):
            stream.take(now, THERE, junk)
            stream.take(now, THERE, lone)
            stream.take(now, HERE, datagram)
    assert stream.sender == HERE and stream.counts.frames >= 118
    assert stream.complaint() == ""


def test_a_sender_that_shows_nobody_any_more_makes_room() -> None:
    stream = Stream(PROTOCOLS["vmc"], ())
    encoder = PROTOCOLS["vmc"].encoder()
    for k in range(180):
        now, who = k / 60.0, HERE if k < 30 else THERE
        stream.take(now, HERE, osc.message("/foo", 1.0))
        for datagram in encoder.encode(tpose(), k, now):
            stream.take(now, who, datagram)
    assert stream.sender == THERE and stream.counts.frames > 30 + 60 * (2.5 - SILENCE) - 5


def test_a_crowd_of_senders_is_not_remembered() -> None:
    nobody = Stream(NUMBERS, (), person=1)
    for k in range(10 * SENDERS):
        nobody.take(0.0, (f"10.0.0.{k}", 1), b"1")
    assert len(nobody._decoders) == SENDERS and nobody.sender is None


def test_the_reason_why_a_datagram_is_refused_is_said_in_one_printable_line(stream: Stream) -> None:
    for _ in range(3):
        stream.take(0.0, HERE, b"x" * 5000)
    said = stream.complaint()
    assert said.startswith("3 datagrams came that are not NUMBERS: no number?[31m but b'xxx")
    assert said.isprintable() and len(said) < 300


def test_one_datagram_of_another_protocol_does_not_hide_the_reason(stream: Stream) -> None:
    stream.take(0.0, HERE, b"other bytes")
    for _ in range(9):
        stream.take(0.0, HERE, b"\x00")
    assert "no number" in stream.complaint()


def test_what_is_needed_is_what_a_person_is_measured_by() -> None:
    landmarks = np.full_like(tpose().landmarks, np.nan)
    with pytest.raises(Exception, match="lacks") as lacking:
        measure(HumanFrame(0.0, landmarks))
    assert set(str(lacking.value).split("lacks ")[1].split(":")[0].split(", ")) == set(NEEDED)


def test_landmarks_that_stay_away_are_named() -> None:
    json, stream = PROTOCOLS["json"], Stream(PROTOCOLS["json"], ())
    encoder, whole = json.encoder(), tpose().landmarks
    gone = whole.copy()
    gone[[LANDMARK["l_toe"], LANDMARK["r_toe"], LANDMARK["head"]]] = np.nan
    said = []
    for k in range(300):
        here = gone if 60 <= k < 64 or 120 <= k < 240 else whole
        stream.take(k / 60.0, HERE, encoder.encode(HumanFrame(k / 60.0, here), k, k / 60.0)[0])
        said.append(stream.complaint())
    assert [bool(text) for text in said] == [120 + 60 * LACKING <= k < 240 for k in range(300)]
    assert "does not see l_toe, r_toe:" in said[239]


def test_a_person_of_whom_nothing_is_seen_is_said() -> None:
    json, stream = PROTOCOLS["json"], Stream(PROTOCOLS["json"], ())
    nobody = HumanFrame(0.0, np.full_like(tpose().landmarks, np.nan))
    for k in range(90):
        stream.take(k / 60.0, HERE, json.encoder().encode(nobody, k, k / 60.0)[0])
    assert "does not see anything of the person" in stream.complaint()
    assert stream.sender is None


def test_the_rate_of_a_stream_that_is_dead_falls_to_nothing(stream: Stream) -> None:
    send(stream, *range(300))
    rates = [stream.rate_at(2.99 + silence) for silence in (0.0, 0.01, 0.1, 0.5, 0.9, 1.1, 60.0)]
    assert rates[:2] == pytest.approx([100.0, 100.0]) and rates[-2:] == [0.0, 0.0]
    assert rates == sorted(rates, reverse=True) and rates[3] == pytest.approx(50.0, abs=2.0)


def test_rate_and_jitter_may_be_read_while_frames_come(stream: Stream) -> None:
    troubles: list[Exception] = []
    looks = 0

    def look() -> None:
        nonlocal looks
        while looks < 300:
            looks += 1
            try:
                assert stream.rate >= 0.0 and stream.jitter >= 0.0 and stream.complaint() == ""
            except Exception as error:  # whatever it is, the panel would die of it
                troubles.append(error)

    send(stream, *range(300))
    interval, number = sys.getswitchinterval(), 300
    sys.setswitchinterval(1e-6)
    thread = threading.Thread(target=look)
    thread.start()
    while thread.is_alive():
        send(stream, number, at=0.01 * number)
        number += 1
    sys.setswitchinterval(interval)
    assert troubles == []


@pytest.mark.parametrize("rate", [3.0, 10.0, 24.0, 60.0, 100.0, 240.0])
def test_the_delay_of_the_filter_is_the_one_that_a_swinging_hand_shows(rate: float) -> None:
    for frequency in (frequency for frequency in (0.5, 1.0, 3.0) if frequency < rate / 4.0):
        smooth, times = LandmarkFilter(), np.arange(int(6 * rate)) / rate
        places = np.tile(0.05 * np.sin(2.0 * np.pi * frequency * times)[:, None, None], (1, len(LANDMARKS), 3))
        seen = [smooth.step(HumanFrame(t, p)).landmarks[0, 0] for t, p in zip(times, places, strict=True)]
        late = times > 2.0
        angle = 2.0 * np.pi * frequency * times[late]
        (a, b), *_ = np.linalg.lstsq(np.stack([np.sin(angle), np.cos(angle)], 1), np.array(seen)[late], rcond=None)
        assert smooth.delay(rate, frequency) == pytest.approx(-math.atan2(b, a) / (2.0 * np.pi * frequency), abs=2e-6)


def test_there_is_no_delay_to_tell_without_a_stream() -> None:
    assert math.isnan(LandmarkFilter().delay(0.0))

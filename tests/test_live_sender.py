"""The test sender: what it performs, when its datagrams are due, and a second of real UDP."""

from __future__ import annotations

import itertools
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.cli import run
from naoimitate.core.errors import MotionFormatError, StreamError
from naoimitate.core.frames import LANDMARK, HumanFrame, Motion
from naoimitate.human.live_support import SupportEstimator
from naoimitate.live.fade import minimum_jerk
from naoimitate.live.performance import BLEND, Performance, moved
from naoimitate.live.protocols.plain import JsonDecoder, JsonEncoder
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.sender import Conditions, Tally, UdpSender, address, frames, play, through
from naoimitate.motion.builtin import builtin_motion, builtin_names
from naoimitate.motion.tpose import heading, is_tpose

LIMBS = (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle"))


def lengths(frame: HumanFrame) -> np.ndarray:
    return np.array([np.linalg.norm(frame[f"{s}_{a}"] - frame[f"{s}_{b}"]) for s in "lr" for a, b in LIMBS])


def elsewhere(motion: Motion) -> Motion:
    """The same clip somewhere in the room, the person looking elsewhere."""
    there = [moved(frame, 2.0, np.array([3.0, -2.0, 0.0])) for frame in motion]
    return Motion(
        motion.name,
        motion.time,
        np.array([frame.landmarks for frame in there]),
        np.array([frame.orientations for frame in there]),
        contacts=motion.contacts,
        tpose=motion.tpose,
    )


@pytest.mark.parametrize("name", builtin_names())
def test_the_tpose_stands_where_the_clip_begins_and_the_way_into_it_is_smooth(name: str) -> None:
    motion = elsewhere(builtin_motion(name))
    performance = Performance(motion, 1.0)
    stand, first = performance.at(0.5), motion[0]
    assert is_tpose(stand.landmarks[None])[0]
    assert stand["pelvis"][:2] == pytest.approx(first["pelvis"][:2], abs=1e-9)
    assert heading(stand.landmarks) == pytest.approx(heading(first.landmarks), abs=1e-9)
    way = [performance.at(1.0 + share * BLEND) for share in np.linspace(0.0, 1.0, 101)]
    assert way[0].landmarks == pytest.approx(stand.landmarks, abs=1e-9)
    assert way[-1].landmarks == pytest.approx(first.landmarks, abs=1e-9)
    steps = np.linalg.norm(np.diff([frame.landmarks for frame in way], axis=0), axis=-1)
    assert steps[[0, -1]].max() < 1e-4
    assert np.abs(np.diff(steps, axis=0)).max() < 2e-3
    for frame in way:
        assert lengths(frame) == pytest.approx(lengths(first), abs=1e-4)


@pytest.mark.parametrize("name", builtin_names())
def test_nobody_seems_to_fly_before_the_clip(name: str) -> None:
    performance = Performance(builtin_motion(name), 1.0)
    estimator = SupportEstimator.standing(performance.at(0.0))
    assert {estimator.update(performance.at(i / 100.0)) for i in range(200)} == {"D"}


def test_after_the_blend_the_clip_comes_as_it_is() -> None:
    motion = builtin_motion("paper")
    performance = Performance(motion, 2.0)
    assert performance.duration == pytest.approx(2.0 + BLEND + motion.duration)
    for time_ in (0.0, 1.234, motion.duration):
        seen, true = performance.at(2.0 + BLEND + time_), motion.at(time_)
        assert seen.landmarks == pytest.approx(true.landmarks, abs=1e-9)
        assert seen.orientations == pytest.approx(true.orientations, abs=1e-9)
        assert np.array_equal(seen.contacts, true.contacts)


def test_a_repeated_walk_goes_on_where_it_ended() -> None:
    motion = builtin_motion("walk")
    performance = Performance(motion, repeat=3)
    path = np.array([performance.at(t)["pelvis"] for t in np.arange(0.0, performance.duration, 0.01)])
    assert np.linalg.norm(np.diff(path, axis=0), axis=-1).max() < 0.02
    walked = np.linalg.norm(motion[-1]["pelvis"][:2] - motion[0]["pelvis"][:2])
    assert np.linalg.norm(path[-1][:2] - path[0][:2]) > 2.5 * walked


def test_without_a_tpose_the_clip_starts_at_once_and_none_can_be_made_up() -> None:
    motion = builtin_motion("wave")
    assert Performance(motion).at(0.0).landmarks == pytest.approx(motion[0].landmarks)
    bare = Motion("bare", motion.time, motion.landmarks)
    assert Performance(bare).duration == motion.duration
    with pytest.raises(MotionFormatError, match="--tpose 0"):
        Performance(bare, 3.0)


@given(st.floats(0.0, 1.0))
def test_minimum_jerk_is_even_about_its_middle(share: float) -> None:
    assert minimum_jerk(share) + minimum_jerk(1.0 - share) == pytest.approx(1.0)
    assert 0.0 <= minimum_jerk(share) <= 1.0


def numbered(count: int, rate: float) -> list[tuple[float, list[bytes]]]:
    return [(i / rate, [i.to_bytes(4, "big")]) for i in range(count)]


def delivered(network: Conditions, count: int = 2000, rate: float = 100.0) -> tuple[list[tuple[float, int]], Tally]:
    tally = Tally()
    schedule = through(network, numbered(count, rate), 1.0 / rate, tally)
    return [(due, int.from_bytes(datagram, "big")) for due, datagram in schedule], tally


def test_a_perfect_network_delivers_every_frame_in_its_time() -> None:
    schedule, tally = delivered(Conditions(), 1000, 120.0)
    assert schedule == [(i / 120.0, i) for i in range(1000)]
    assert tally == Tally(given=1000, sent=1000)


shares = st.floats(0.0, 1.0)


@settings(max_examples=150, deadline=None)
@given(shares, st.floats(0.0, 0.5), shares, shares, st.integers(), st.floats(1.0, 1000.0))
def test_whatever_the_network_does_it_is_counted_and_due_times_never_fall(
    loss: float, jitter: float, duplicate: float, reorder: float, seed: int, rate: float
) -> None:
    network = Conditions(loss, jitter, duplicate, reorder, seed)
    schedule, tally = delivered(network, 200, rate)
    assert all(a[0] <= b[0] for a, b in itertools.pairwise(schedule))
    assert all(i / rate <= due <= i / rate + jitter + 3.0 / rate + 1e-9 for due, i in schedule)
    assert tally.given == 200
    assert tally.sent == len(schedule) == 200 - tally.lost + tally.doubled
    copies = Counter(i for _, i in schedule)
    assert len(copies) == 200 - tally.lost
    assert sum(count == 2 for count in copies.values()) == tally.doubled
    assert max(copies.values(), default=0) <= 2
    assert delivered(network, 200, rate)[0] == schedule


def test_shares_are_those_asked_for() -> None:
    _, tally = delivered(Conditions(loss=0.3, duplicate=0.1, reorder=0.2, seed=4), 20_000)
    assert tally.lost / 20_000 == pytest.approx(0.3, abs=0.015)
    assert tally.doubled / (20_000 - tally.lost) == pytest.approx(0.1, abs=0.01)
    assert tally.held_back / (20_000 - tally.lost) == pytest.approx(0.2, abs=0.015)


def test_jitter_under_the_interval_keeps_the_order_and_reordering_breaks_it() -> None:
    def overtaken(network: Conditions) -> float:
        order = [i for _, i in delivered(network)[0]]
        return float(np.mean(np.array(order) < np.maximum.accumulate(order)))

    assert overtaken(Conditions(jitter=0.009)) == 0.0
    assert overtaken(Conditions(jitter=0.2)) > 0.5
    assert overtaken(Conditions(reorder=0.1)) == pytest.approx(0.1, abs=0.03)


def test_a_slow_network_keeps_only_what_is_under_way() -> None:
    made = []

    def source() -> list[tuple[float, list[bytes]]]:
        for frame in numbered(100_000, 100.0):
            made.append(frame[0])
            yield frame

    schedule = through(Conditions(jitter=0.1), source(), 0.01, Tally())
    for due, _ in itertools.islice(schedule, 1000):
        assert made[-1] <= due + 0.1 + 0.01 + 1e-9


def test_waits_do_not_add_up() -> None:
    now, sent = 5.0, []

    def sleep(seconds: float) -> None:
        nonlocal now
        assert seconds > 0.0
        now += seconds + 0.0007  # sleeps are always a little long

    def send(datagram: bytes) -> None:
        nonlocal now
        sent.append(now)
        now += 0.001

    play(((i / 100.0, b"") for i in range(1000)), send, lambda: now, sleep)
    late = np.array(sent) - 5.0 - np.arange(1000) / 100.0
    assert late.min() >= 0.0 and late.max() < 0.001


def test_frames_are_counted_and_come_at_the_rate() -> None:
    motion = builtin_motion("wave")
    made = list(frames(Performance(motion, 1.0), JsonEncoder(), 50.0))
    samples = [JsonDecoder().feed(datagram)[0] for _, (datagram,) in made]
    assert [sample.sequence for sample in samples] == list(range(len(made)))
    assert [time for time, _ in made] == [sample.frame.time for sample in samples]
    assert len(made) == int((1.0 + BLEND + motion.duration) * 50.0 + 1e-6) + 1
    assert samples[-1].frame.landmarks == pytest.approx(motion[-1].landmarks, abs=1e-5)


@pytest.mark.parametrize("name", sorted(PROTOCOLS))
def test_every_protocol_brings_a_motion_through_and_knows_its_own(name: str) -> None:
    protocol, motion = PROTOCOLS[name], builtin_motion("wave")
    encoder, decoder, seen = protocol.encoder(), protocol.decoder(), []
    for i, (_, datagrams) in enumerate(itertools.islice(frames(Performance(motion, 1.0), encoder, 50.0), 150)):
        for datagram in datagrams:
            assert [other for other in PROTOCOLS.values() if other.recognises(datagram)] == [protocol]
            seen += [(i, sample) for sample in decoder.feed(datagram)]
    assert len(seen) >= 145
    last = seen[-1][1].frame
    assert np.isfinite(last.landmarks[LANDMARK["l_wrist"]]).all()


def test_a_second_of_real_datagrams_comes_at_the_rate() -> None:
    performance = Performance(builtin_motion("wave"), 1.0)
    packets = frames(performance, JsonEncoder(), 100.0)
    schedule = itertools.takewhile(lambda item: item[0] <= 1.0, through(Conditions(), packets, 0.01, Tally()))
    arrivals: list[tuple[float, bytes]] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)

        def receive() -> None:
            while len(arrivals) < 101:
                arrivals.append((receiver.recv(65536), time.monotonic())[::-1])

        listener = threading.Thread(target=receive)
        listener.start()
        used = time.process_time()
        with UdpSender(address("127.0.0.1", receiver.getsockname()[1])) as sender:
            play(schedule, sender.send)
        used = time.process_time() - used
        listener.join(10.0)
    samples = [JsonDecoder().feed(datagram)[0] for _, datagram in arrivals]
    assert [sample.sequence for sample in samples] == list(range(101))
    late = np.array([at for at, _ in arrivals]) - arrivals[0][0] - np.arange(101) / 100.0
    assert np.median(np.abs(late)) < 0.005 and abs(late[-1]) < 0.1
    assert used < 0.5  # it sleeps, it does not spin


def test_ctrl_c_ends_a_stream_with_its_summary() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(20.0)
        to = f"127.0.0.1:{receiver.getsockname()[1]}"
        arguments = [
            "-m",
            "naoimitate.cli",
            "stream",
            "builtin:wave",
            "--protocol",
            "json",
            "--to",
            to,
            "--loss",
            "0.2",
        ]
        with subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            receiver.recv(65536)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=20.0)
    assert process.returncode == 0 and err == b""
    assert f"streaming builtin:wave as json to {to}" in out.decode()
    assert "were lost" in out.decode().splitlines()[-1]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("127.0.0.1", "127.0.0.1:9000"),
        ("127.0.0.1:5", "127.0.0.1:5"),
        ("[::1]:7", "[::1]:7"),
        ("::1", "[::1]:9000"),
        ("localhost:8", None),
    ],
)
def test_addresses_have_a_port_or_take_the_protocols(text: str, place: str | None) -> None:
    found = address(text, 9000)
    assert place is None or found.text == place


@pytest.mark.parametrize(
    "text", ["", ":9000", "127.0.0.1:0", "127.0.0.1:65536", "127.0.0.1:x", "[::1]:²", "no host", "a" * 300]
)
def test_bad_addresses_are_told(text: str) -> None:
    with pytest.raises(StreamError, match="HOST:PORT"):
        address(text, 9000)


MISTAKES = [
    ["--protocol", "json", "--to", "127.0.0.1:99999"],
    ["--protocol", "json", "--to", "nobody.invalid"],
    ["--protocol", "json", "--to", "255.255.255.255:9"],
    ["--protocol", "other"],
    [],
    ["--protocol", "json", "--loss", "1.5"],
    ["--protocol", "json", "--rate", "0"],
    ["--protocol", "json", "--jitter", "-1"],
    ["--protocol", "json", "--repeat", "0"],
]


@pytest.mark.parametrize("arguments", MISTAKES, ids=" ".join)
def test_a_mistake_is_one_line_and_status_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["stream", "builtin:wave", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and len(err) < 400

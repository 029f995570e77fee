"""The receiver: when a datagram came, and how much is read at a time."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Iterator

import pytest

from naoimitate.core.errors import StreamError
from naoimitate.live import receiver as module
from naoimitate.live.receiver import ENOUGH, MOST, OLDEST, Receiver

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="only Linux stamps datagrams")


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    receiver = Receiver("127.0.0.1", 0)
    yield receiver
    receiver.close()


def send(receiver: Receiver, *datagrams: bytes, bind: str = "127.0.0.1") -> None:
    with socket.socket(socket.AF_INET6 if ":" in bind else socket.AF_INET, socket.SOCK_DGRAM) as out:
        for datagram in datagrams:
            out.sendto(datagram, (bind, receiver.port))


def await_stamps(receiver: Receiver, bind: str = "127.0.0.1") -> None:
    """The kernel begins to stamp a moment after it was asked to."""
    for _ in range(200):
        send(receiver, b"is it stamped?", bind=bind)
        time.sleep(0.02)
        if time.monotonic() - receiver.read()[0].arrival > 0.015:
            return
    pytest.fail("the system stamps no datagrams")


@LINUX
@pytest.mark.parametrize("bind", ["127.0.0.1", "::1"])
def test_a_datagram_came_when_the_system_got_it(bind: str) -> None:
    try:
        receiver = Receiver(bind, 0)
    except StreamError as error:
        pytest.skip(f"this machine has no {bind}: {error}")
    await_stamps(receiver, bind)
    before = time.monotonic()
    send(receiver, b"first", bind=bind)
    after = time.monotonic()
    time.sleep(0.2)
    send(receiver, b"second", bind=bind)
    assert receiver.wait(1.0)
    first, second = receiver.read()
    receiver.close()
    assert before - 1e-3 <= first.arrival <= after + 1e-3
    assert second.arrival - first.arrival >= 0.199
    assert (first.payload, first.address[0]) == (b"first", bind)


@LINUX
@pytest.mark.parametrize("step", [-3600.0, -0.5, -0.05, 0.05, 0.5, 3600.0])
def test_a_clock_that_is_set_moves_no_arrival_out_of_what_can_be(
    receiver: Receiver, monkeypatch: pytest.MonkeyPatch, step: float
) -> None:
    await_stamps(receiver)
    assert receiver.read() == []
    empty = time.monotonic()
    time.sleep(0.02)
    send(receiver, b"frame")
    time.sleep(0.02)
    true = time.time
    monkeypatch.setattr(module.time, "time", lambda: true() + step)
    (datagram,) = receiver.read()
    now = time.monotonic()
    assert empty - 1e-3 <= datagram.arrival <= now
    assert now - datagram.arrival < OLDEST


@LINUX
def test_what_waited_longer_than_a_second_is_a_second_old(receiver: Receiver) -> None:
    await_stamps(receiver)
    send(receiver, b"frame")
    time.sleep(OLDEST + 0.2)
    (datagram,) = receiver.read()
    assert time.monotonic() - datagram.arrival == pytest.approx(OLDEST, abs=0.1)


def test_of_a_flood_little_is_read_at_a_time_and_all_in_the_end(receiver: Receiver) -> None:
    sent = [b"%d" % k for k in range(10 * MOST + 1)]
    send(receiver, *sent)
    reads = list(iter(receiver.read, []))
    assert [datagram.payload for read in reads for datagram in read] == sent
    assert max(len(read) for read in reads) == MOST


def test_a_large_datagram_is_read_with_few_others(receiver: Receiver) -> None:
    send(receiver, *[bytes(60000)] * 8)
    for read in iter(receiver.read, []):
        assert sum(len(datagram.payload) for datagram in read) < ENOUGH + 60000
        assert len(read) == 1


def test_an_error_that_lasts_is_no_trap(receiver: Receiver) -> None:
    receiver.close()
    assert receiver.read() == []

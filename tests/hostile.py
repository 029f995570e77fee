"""Datagrams that nobody means well with, for the tests of every decoder of JSON."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

from hypothesis import strategies as st

MEGABYTE = 1_000_000
LONG = 65000


def spoiled(good: bytes) -> st.SearchStrategy[bytes]:
    """A good datagram with some bytes overwritten, put in, doubled or cut away."""
    place = st.integers(0, len(good))

    def overwritten(edits: list[tuple[int, bytes]]) -> bytes:
        text = bytearray(good)
        for at, patch in edits:
            text[at : at + len(patch)] = patch
        return bytes(text)

    patch = st.one_of(
        st.binary(min_size=1, max_size=4),
        st.sampled_from(
            [b"NaN", b"1e308", b"-1e999", b"null", b"[[[[", b"}}", b'"', b"9" * 40, b"{", b"\\u0000", b"true"]
        ),
    )
    return st.one_of(
        st.lists(st.tuples(place, patch), min_size=1, max_size=5).map(overwritten),
        place.map(lambda at: good[:at]),
        st.tuples(place, place).map(lambda ends: good[min(ends) : max(ends)]),
        st.tuples(place, patch).map(lambda edit: good[: edit[0]] + edit[1] + good[edit[0] :]),
        place.map(lambda at: good[:at] + good),
    )


def texts(key: bytes, inside: Callable[[bytes], bytes]) -> list[bytes]:
    """Huge JSON texts around 64 kB: ``inside`` puts a value where the protocol looks for ``key``."""
    values = [
        b"[" * LONG,
        b'{"a":' * (LONG // 5),
        b"[" + b"[]," * (LONG // 3) + b"0]",
        b"[" + b"{}," * (LONG // 3) + b"{}]",
        b"[" + b"1.5," * (LONG // 4) + b"1]",
        b"{" + b",".join(b'"k%d":[]' % i for i in range(LONG // 11)) + b"}",
        b"{" + b",".join([key + b":null"] * (LONG // (len(key) + 6))) + b"}",
        b'"' + "\U0001f600".encode() + b"a" * LONG + b'"',
        b'"' + b"\\ud83d\\ude00" + b"a" * LONG + b'"',
        b"9" * LONG,
        b"0." + b"9" * LONG,
        b"1e" + b"9" * LONG,
    ]
    return [inside(value) for value in values] + values


def peak_memory(work: Callable[[], object]) -> int:
    """Most bytes that were allocated at once, by Python's own count."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()

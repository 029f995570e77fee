"""Hostile datagrams for every decoder: only DatagramError may come out, memory stays flat, the good stream goes on.

python benchmarks/fuzz.py [COUNT] [PROTOCOL ...]      # a million each without arguments
"""

from __future__ import annotations

import contextlib
import random
import resource
import sys
import time
from dataclasses import replace

from naoimitate.core.errors import DatagramError
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.sample import StreamProtocol
from naoimitate.motion.builtin import tpose

COUNT = 1_000_000
EVERY = 1000
"""Hostile datagrams between two frames of the good stream."""
PATCHES = (
    b"\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xc0\0\0",
    b"NaN",
    b"1e308",
    b"null",
    b"[[[[",
    b"}}",
    b'"',
    b"9" * 40,
    b",",
)


def spoil(rng: random.Random, good: bytes) -> bytes:
    """A datagram with a few of its bytes changed, replaced by something hostile, cut out, or repeated elsewhere."""
    data = bytearray(good)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        at, kind = rng.randrange(len(data) + 1), rng.random()
        if kind < 0.5 and at < len(data):
            data[at] = rng.randrange(256)
        elif kind < 0.7:
            data[at : at + rng.randrange(8)] = rng.choice(PATCHES)
        elif kind < 0.85:
            del data[at : at + rng.randrange(60)]
        else:
            data[at:at] = data[rng.randrange(len(data) + 1) :][: rng.randrange(60)]
        data = data or bytearray(b"x")
    return bytes(data)


def fuzz(protocol: StreamProtocol, count: int) -> str:
    """Feed a decoder ``count`` hostile datagrams with good ones between them; a line of what came of it."""
    rng, decoder, encoder = random.Random(1), protocol.decoder(), protocol.encoder()
    seeds = [d for k in range(3) for d in encoder.encode(replace(tpose(), time=0.01 * k), k, 0.01 * k)]
    before, slowest, understood, good = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, 0.0, 0, 0
    for k in range(count):
        data = rng.randbytes(rng.randrange(200)) if k % 7 == 0 else spoil(rng, rng.choice(seeds))
        start = time.perf_counter()
        with contextlib.suppress(DatagramError):
            understood += bool(decoder.feed(data))
        slowest = max(slowest, time.perf_counter() - start)
        if k % EVERY == 0:
            number = 100_000 + k // EVERY
            datagrams = encoder.encode(replace(tpose(), time=0.01 * number), number, 0.01 * number)
            good += any([bool(decoder.feed(d)) for d in datagrams])
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return (
        f"{protocol.name}: {count} hostile datagrams, {understood} understood all the same; {good} of "
        f"{(count + EVERY - 1) // EVERY} good frames; memory +{grown} kB; slowest {1e3 * slowest:.1f} ms"
    )


def main(arguments: list[str]) -> None:
    """Fuzz the protocols that the command line names, or all."""
    count = int(arguments[0]) if arguments else COUNT
    for name in arguments[1:] or PROTOCOLS:
        print(fuzz(PROTOCOLS[name], count), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])

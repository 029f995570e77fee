"""The newest positions of a running simulation, in memory that processes share: the latest wins, nobody waits."""

from __future__ import annotations

import multiprocessing

import numpy as np

from naoimitate.core.frames import Array

SLOTS = 4
"""Places that are written in turn: a reader has the time of three writes to copy the newest one."""


class Positions:
    """One writer, any number of readers; goes to a spawned process as an argument.

    The memory holds the number of writes, then the slots, each a time (s) and positions. A slot counts only when its
    number has been written, so that a writer that dies half-way harms nobody.
    """

    def __init__(self, count: int) -> None:
        """Room for ``count`` numbers, the ``nq`` of a model."""
        self._memory = multiprocessing.get_context("spawn").RawArray("d", 1 + SLOTS * (1 + count))

    def write(self, time: float, qpos: Array) -> None:
        """Replace the newest positions: simulated time (s), qpos (nq,)."""
        writes, slots = self._views()
        number = int(writes[0]) + 1
        slots[number % SLOTS, 0], slots[number % SLOTS, 1:] = time, qpos
        writes[0] = number

    def read(self) -> tuple[float, Array]:
        """Simulated time (s) and positions (nq,) of the newest write, zeros before the first."""
        writes, slots = self._views()
        while True:
            number = int(writes[0])
            newest = slots[number % SLOTS].copy()
            if writes[0] - number < SLOTS - 1:
                return float(newest[0]), newest[1:]

    def _views(self) -> tuple[Array, Array]:
        cells = np.frombuffer(self._memory)
        return cells[:1], cells[1:].reshape(SLOTS, -1)

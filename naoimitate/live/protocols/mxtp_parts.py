"""Joins samples that MXTP splits over several datagrams, which may come in any order, twice, or not at all."""

from __future__ import annotations

from dataclasses import dataclass, field

from naoimitate.core.errors import DatagramError
from naoimitate.live.protocols.mxtp import POSE_BYTES, Header

WAITING = 4
"""Incomplete samples that one character may have."""
LARGEST_SAMPLE = 255
"""Items of a sample; a body with props and fingers has 67."""


@dataclass(frozen=True)
class _Partial:
    """The parts of a sample that have come, by their index, and the index of the last one once that is known."""

    parts: dict[int, bytes] = field(default_factory=dict)
    last: int | None = None

    def with_part(self, header: Header, items: bytes) -> _Partial:
        last = header.part if header.last else self.last
        return _Partial({**self.parts, header.part: items}, last)

    @property
    def joined(self) -> bytes | None:
        """All items in their order, or None while a part is missing."""
        if self.last is None or any(i not in self.parts for i in range(self.last + 1)):
            return None
        return b"".join(self.parts[i] for i in range(self.last + 1))


class Parts:
    """The incomplete samples of one character and one type."""

    def __init__(self) -> None:
        self._partials: dict[tuple[int, int], _Partial] = {}

    def add(self, header: Header, items: bytes) -> bytes | None:
        """All items of the sample that a part completes, or None.

        A sample is known by its counter and time, so that a sender that starts again mixes nothing. A complete sample
        ends the wait for older ones; beside that the oldest wait ends when there are too many. Raises DatagramError
        when a sample grows too large.
        """
        if header.last and not header.part:
            self._forget_before(header.counter)
            return items
        key = (header.counter, header.milliseconds)
        partial = self._partials.get(key, _Partial()).with_part(header, items)
        if sum(len(part) for part in partial.parts.values()) > POSE_BYTES * LARGEST_SAMPLE:
            raise DatagramError(f"an MXTP sample has more than {LARGEST_SAMPLE} segments: no person has so many")
        joined = partial.joined
        if joined is not None:
            self._partials.pop(key, None)
            self._forget_before(header.counter)
            return joined
        self._partials[key] = partial
        if len(self._partials) > WAITING:
            del self._partials[next(iter(self._partials))]
        return None

    def _forget_before(self, counter: int) -> None:
        if self._partials:
            self._partials = {key: partial for key, partial in self._partials.items() if key[0] >= counter}

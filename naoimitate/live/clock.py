"""The sender's clock on ours: frames keep their own rhythm whatever the network does to their arrival."""

from __future__ import annotations

import math

DRIFT = 1e-3
"""s by which the two clocks may drift apart in a second."""
LOST = 1.0
"""[s] of delay beyond which the sender's clock has been set anew."""


class SenderClock:
    """Moments of the sender as moments of the receiver: the smallest delay seen is taken as none."""

    def __init__(self) -> None:
        self._offset, self._last, self._sent = math.nan, math.nan, -math.inf

    def moment(self, sent: float, arrival: float) -> float:
        """When (s, our clock) a frame was sent that arrived at ``arrival``; the arrival where ``sent`` is NaN."""
        if not math.isfinite(sent):
            return arrival
        if sent < self._sent:  # frames come in order: the sender has begun again
            self._offset = math.nan
        self._sent = sent
        delay = arrival - sent
        leaked = self._offset + DRIFT * max(arrival - self._last, 0.0)
        self._offset = delay if math.isnan(leaked) or delay - leaked > LOST else min(delay, leaked)
        self._last = arrival
        return sent + self._offset

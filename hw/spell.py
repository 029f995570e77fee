"""For how long something has been so, where those who look may be late themselves."""

from __future__ import annotations

LOOK = 0.05
"""[s] that one look may count for: what a pause of the computer makes of a robot shows in a single look after it."""


class Spell:
    """The time for which something has been so without a break, s; 0 once it is not so any more."""

    def __init__(self, now: float) -> None:
        self.lasted = 0.0
        self._looked = now

    def look(self, so: bool, now: float) -> float:
        """Whether it is so at ``now`` s; returns for how long it has been."""
        self.lasted = self.lasted + min(max(now - self._looked, 0.0), LOOK) if so else 0.0
        self._looked = now
        return self.lasted

"""One line of the score sheet: a measure, its value, and the bar that it must meet."""

from __future__ import annotations

import math
from dataclasses import dataclass

Value = float | int | bool | None


@dataclass(frozen=True)
class Bar:
    """A bound on a value. limit: in the unit of the measure. at_least: the value must reach it, else not exceed it."""

    limit: float
    at_least: bool = False

    def met(self, value: float) -> bool:
        """Whether a value meets the bar; NaN never does."""
        return value >= self.limit if self.at_least else value <= self.limit

    def __str__(self) -> str:
        return f"{'>=' if self.at_least else '<='} {self.limit:g}"


@dataclass(frozen=True)
class Measure:
    """A measure of docs/scores.md.

    key: name in JSON. label, unit: for people. value: None where the run has nothing to measure. bar: None where the
    value is only reported. applies: the bar holds for this run. note: why not, or what the value means.
    """

    key: str
    label: str
    value: Value
    unit: str = ""
    bar: Bar | None = None
    applies: bool = True
    note: str = ""

    @property
    def passed(self) -> bool | None:
        """Whether the bar is met; None where there is no bar, no value, or the bar does not hold for this run."""
        if self.bar is None or self.value is None or not self.applies:
            return None
        return self.bar.met(float(self.value))

    @property
    def json_value(self) -> Value:
        """The value as JSON can hold it: None for NaN and infinity."""
        return None if isinstance(self.value, float) and not math.isfinite(self.value) else self.value

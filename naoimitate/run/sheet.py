"""The score sheet as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from naoimitate.run.measure import Measure, Value

VERDICTS = {True: "ok", False: "MISSED", None: ""}


def as_dict(sheet: Sequence[Measure]) -> dict[str, Any]:
    """Every value by its key; under ``bars`` the bar of each measure that has one, and whether it is met.

    ``passed`` is null where the bar does not hold for this run or there is nothing to measure. ``missed`` lists the
    keys of missed bars.
    """
    values: dict[str, Any] = {measure.key: measure.json_value for measure in sheet}
    bars = {m.key: {"bar": str(m.bar), "passed": m.passed, "note": m.note} for m in sheet if m.bar is not None}
    return {**values, "bars": bars, "missed": [measure.key for measure in sheet if measure.passed is False]}


def as_lines(sheet: Sequence[Measure]) -> list[str]:
    """One line per measure: what, value and unit, bar, verdict, note."""
    return [
        f"{measure.label:<46}{format_value(measure):>12}  {bar_text(measure):<10}{VERDICTS[measure.passed]:<7}"
        f"{measure.note}".rstrip()
        for measure in sheet
    ]


def format_value(measure: Measure) -> str:
    """Value and unit for people; a dash where there is nothing to measure."""
    return f"{_number(measure.value)} {measure.unit}".rstrip()


def bar_text(measure: Measure) -> str:
    """The bar for people, empty without one."""
    return "" if measure.bar is None else str(measure.bar)


def _number(value: Value) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.3g}" if isinstance(value, float) else str(value)

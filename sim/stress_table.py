"""What the suite found: a row for each part of it, and entries for JSON."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from typing import Any

from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.stress import differences
from naoimitate.sim.stress_play import Outcome
from naoimitate.sim.stress_sweep import Boundary


@dataclass(frozen=True)
class Case:
    """One draw of a part of the suite on one motion, and how it went."""

    part: str
    draw: int
    motion: str
    disturbance: Disturbance
    outcome: Outcome


@dataclass(frozen=True)
class Row:
    """A part of the suite.

    failures: how often each thing was the first to fail; tipped: how many ended on the floor, then or later.
    Worst among those that were survived, NaN where none was: tilt, rad off the plan; swing_load, share of the weight on
    a foot in the air; cop_margin, m from the centre of pressure to the edge of the stance soles.
    """

    part: str
    range: str
    draws: int
    survived: int
    failures: dict[str, int]
    tipped: int
    tilt: float
    swing_load: float
    cop_margin: float


def summed(part: str, range_: str, cases: Iterable[Case]) -> Row:
    """The row of a part, from its cases."""
    outcomes = [case.outcome for case in cases]
    held = [outcome for outcome in outcomes if outcome.survived]
    return Row(
        part=part,
        range=range_,
        draws=len(outcomes),
        survived=len(held),
        failures=dict(Counter(outcome.failure for outcome in outcomes if outcome.failure is not None)),
        tipped=sum(outcome.tipped for outcome in outcomes),
        tilt=_worst(max, [outcome.tilt for outcome in held]),
        swing_load=_worst(max, [outcome.swing_load for outcome in held]),
        cop_margin=_worst(min, [outcome.cop_margin for outcome in held]),
    )


def _worst(choose: Callable[[list[float]], float], values: list[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return choose(known) if known else math.nan


def entry(value: Row | Outcome) -> dict[str, Any]:
    """The fields of a row or an outcome as JSON has them: null for NaN."""
    fields = asdict(value).items()
    return {name: None if isinstance(item, float) and math.isnan(item) else item for name, item in fields}


def case_entry(case: Case) -> dict[str, Any]:
    """A case as JSON has it: what it was, the fields of its disturbance that are not neutral, and its outcome."""
    what = {"part": case.part, "draw": case.draw, "motion": case.motion, "survived": case.outcome.survived}
    return what | {"disturbance": differences(case.disturbance)} | entry(case.outcome)


def boundary_entry(boundary: Boundary, motion: str) -> dict[str, Any]:
    """A boundary as JSON has it, with each case that fell there."""
    fallen = [{"disturbance": differences(one), **entry(outcome)} for one, outcome in boundary.fallen]
    levels = {"survived": boundary.survived, "fell": boundary.fell}
    return {"motion": motion, **levels, "cases": boundary.cases, "fallen": fallen}


def words(disturbance: Disturbance) -> str:
    """What is not neutral, for people; SI units."""
    return ", ".join(f"{name} {value:.4g}" for name, value in differences(disturbance).items() if name != "seed")

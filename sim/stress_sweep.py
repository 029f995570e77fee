"""The boundary of one disturbance: from neutral outwards until the robot falls, all else as planned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.stress import Kind, variant
from naoimitate.sim.stress_play import Outcome
from naoimitate.sim.stress_pool import Pool, Trial


@dataclass(frozen=True)
class Boundary:
    """Where a plan (its index) stops to survive a kind, in one direction from neutral.

    survived: the last level at which every case was survived, None where not even the first; fell: the next, None where
    no level made it fall. fallen: the cases that fell there. cases: how many were tried at each level.
    """

    plan: int
    survived: float | None
    fell: float | None
    fallen: tuple[tuple[Disturbance, Outcome], ...]
    cases: int


def sweep(
    pool: Pool, kind: Kind, plans: int, *, seed: int, cases: int | None, told: Callable[[float], None]
) -> list[Boundary]:
    """The boundaries of all plans, by direction; cases: at each level, the kind's own by default.

    told: the share of the levels that are done.
    """
    boundaries: list[Boundary] = []
    for number, levels in enumerate(kind.outward):

        def on_the_way(share: float, number: int = number) -> None:
            told((number + share) / len(kind.outward))

        trials = cases or kind.variants
        boundaries += _one_way(pool, kind, levels, range(plans), seed, trials, on_the_way)
    return boundaries


def _one_way(
    pool: Pool,
    kind: Kind,
    levels: tuple[float, ...],
    plans: Sequence[int],
    seed: int,
    cases: int,
    told: Callable[[float], None],
) -> list[Boundary]:
    """All plans go up a level together, but for those that have fallen."""
    found: dict[int, Boundary] = {}
    survived: float | None = None
    for number, level in enumerate(levels):
        left = [plan for plan in plans if plan not in found]
        trials = [Trial(plan, variant(kind, level, case, seed)) for plan in left for case in range(cases)]
        fallen = [pair for pair in zip(trials, pool.play(trials), strict=True) if not pair[1].survived]
        for plan in left:
            here = tuple((trial.disturbance, outcome) for trial, outcome in fallen if trial.plan == plan)
            if here:
                found[plan] = Boundary(plan, survived, level, here, cases)
        survived = level
        told((number + 1) / len(levels))
    return [found.get(plan, Boundary(plan, survived, None, (), cases)) for plan in plans]

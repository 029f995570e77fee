"""The disturbance suite: what kinds there are, over which range each is drawn, and how a draw follows from a seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from naoimitate.robot.model import RobotModel
from naoimitate.sim.disturbance import Disturbance

ALL = "all"
"""Name of the part of the suite in which every kind is drawn at once."""

LARGEST_SEED = 2**31
DEG, MS, PERCENT = 180.0 / math.pi, 1000.0, 100.0

Fields = Callable[[float, np.random.Generator], Mapping[str, Any]]
"""Fields of a ``Disturbance`` from a level and random numbers for all that the level leaves open."""


@dataclass(frozen=True)
class Kind:
    """One kind of disturbance; levels in SI units.

    low, high: the range from which draws take their level, uniformly; the same where the range is one value.
    outward: for each direction the levels from next to neutral outwards, for finding where the robot falls.
    variants: how many random cases (headings, moments, links) each of these levels is tried with.
    unit, scale: to show a level to people.
    """

    name: str
    about: str
    low: float
    high: float
    outward: tuple[tuple[float, ...], ...]
    fields: Fields
    variants: int = 1
    unit: str = ""
    scale: float = 1.0

    def show(self, level: float) -> str:
        """A level with its unit."""
        return f"{self.scale * level:.4g} {self.unit}".rstrip()

    @property
    def range(self) -> str:
        """The range of the draws."""
        if self.low == self.high:
            return self.show(self.high)
        return f"{self.scale * self.low:.4g} to {self.show(self.high)}"

    def covers(self, level: float) -> bool:
        """Whether the suite goes as far from neutral as a level, or farther."""
        return level <= self.high and (level >= self.low or self.low == self.high)


def _seed(random: np.random.Generator) -> int:
    return int(random.integers(LARGEST_SEED))


def _heading(random: np.random.Generator) -> float:
    return float(random.uniform(0.0, 2.0 * math.pi))


def _links(level: float, random: np.random.Generator) -> Mapping[str, Any]:
    return {"mass": level, "com": level, "seed": _seed(random)}


def _tilt(level: float, random: np.random.Generator) -> Mapping[str, Any]:
    return {"tilt": level, "tilt_heading": _heading(random)}


def _drop(level: float, random: np.random.Generator) -> Mapping[str, Any]:
    return {"drop_time": level, "drop_at": float(random.uniform(0.0, LATEST))}


def _push(level: float, random: np.random.Generator) -> Mapping[str, Any]:
    return {"push": level, "push_heading": _heading(random), "push_at": float(random.uniform(0.0, LATEST))}


LATEST = 0.9
"""Pushes and losses begin no later than this share of the motion: what they do must have time to show."""

PUSH = 0.5
"""Largest impulse of the suite's pushes, N s; see docs/stress.md."""


def _levels(first: float, last: float, step: float) -> tuple[float, ...]:
    count = round(abs(last - first) / step) + 1
    return tuple(round(float(level), 9) for level in np.linspace(first, last, count))


KINDS = {
    kind.name: kind
    for kind in (
        Kind(
            "stiffness", "of every servo", 60.0, 400.0,
            ((*_levels(250.0, 100.0, 50.0), *_levels(80.0, 10.0, 10.0)), (400.0, 600.0, 1000.0)),
            lambda level, random: {"stiffness": level}, unit="N m/rad",
        ),
        Kind(
            "torque", "limits of the servos, 0 % planning limit to 100 % stall torque; below 0 less than planned",
            0.0, 1.0, (_levels(-0.1, -0.9, 0.1), (0.5, 1.0)),
            lambda level, random: {"torque": level}, unit="%", scale=PERCENT,
        ),
        Kind(
            "friction", "between soles and floor", 0.3, 1.0, ((*_levels(0.7, 0.1, 0.1), 0.05), (1.0, 1.5)),
            lambda level, random: {"friction": level},
        ),
        Kind(
            "mass", "of every link, and its centre of mass", 0.1, 0.1, (_levels(0.1, 0.8, 0.1),), _links,
            variants=6, unit="%", scale=PERCENT,
        ),
        Kind(
            "tilt", "of the floor, in any direction", 0.0, 3.0 / DEG, (tuple(np.radians(_levels(1.0, 12.0, 1.0))),),
            _tilt, variants=8, unit="deg", scale=DEG,
        ),
        Kind(
            "delay", "of every command", 0.02, 0.02, ((0.01, 0.02, 0.04, 0.06, 0.1, 0.15, 0.2, 0.3, 0.5),),
            lambda level, random: {"delay": level}, unit="ms", scale=MS,
        ),
        Kind(
            "noise", "of encoders and inertial board, as a multiple of what is usual", 1.0, 1.0, ((1.0, 3.0, 10.0),),
            lambda level, random: {"noise": level, "seed": _seed(random)}, variants=2,
        ),
        Kind(
            "drop", "no commands for so long", 0.2, 0.2, ((0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 2.0),), _drop,
            variants=12, unit="ms", scale=MS,
        ),
        Kind(
            "push", "on the torso, in any horizontal direction", 0.0, PUSH, (_levels(0.1, 3.0, 0.1),), _push,
            variants=12, unit="N s",
        ),
    )
}  # fmt: skip
"""By name, in the order of the tables."""


def kinds_for(robot: RobotModel) -> dict[str, Kind]:
    """The kinds that make sense for a robot: one that states no stall torque keeps its torque limits."""
    missing = {"torque"} if not robot.data.get("stall_torque") else set()
    return {name: kind for name, kind in KINDS.items() if name not in missing}


def draw(kinds: Mapping[str, Kind], part: str, number: int, seed: int) -> Disturbance:
    """Draw ``number`` of a part of the suite: a kind by its name, or ``ALL``. The same for every motion and robot."""
    chosen = list(KINDS) if part == ALL else [part]
    fields: dict[str, Any] = {}
    for name in chosen:
        random = _random(name, part == ALL, number, seed)
        if name in kinds:
            kind = kinds[name]
            fields |= kind.fields(float(random.uniform(kind.low, kind.high)), random)
    return Disturbance(**fields)


def variant(kind: Kind, level: float, number: int, seed: int) -> Disturbance:
    """Case ``number`` of a kind at a level: the same headings, moments and links at every level."""
    return Disturbance(**kind.fields(level, _random(kind.name, False, number, seed)))


def _random(name: str, together: bool, number: int, seed: int) -> np.random.Generator:
    """Random numbers of one kind in one draw: independent of which other kinds there are."""
    return np.random.default_rng([seed, number, list(KINDS).index(name), int(together)])


def differences(disturbance: Disturbance) -> dict[str, float | int]:
    """The fields of a disturbance that are not neutral."""
    neutral = asdict(Disturbance())
    return {name: value for name, value in asdict(disturbance).items() if value != neutral[name]}

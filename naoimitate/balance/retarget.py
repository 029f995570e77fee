"""What every way of retargeting the feet has in common: the request of a frame, and the answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from naoimitate.balance.pose import Pose
from naoimitate.core.frames import GivenUp
from naoimitate.core.geometry import wrap
from naoimitate.fsm import Mode

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Footing:
    """What the human's feet ask for.

    support: ``D``, ``L``, ``R`` or ``F``. offset: the human's, (6). between: (3,) m, from the left to the right sole in
    the torso frame, at the robot's scale. torso: (3, 3) world from the human's torso. headings: (2,) rad of the human's
    feet in the world. ahead, may_lift: as in ``SupportInput``.
    """

    support: str
    offset: float
    between: Array
    torso: Array
    headings: tuple[float, float]
    ahead: str = ""
    may_lift: bool = True

    def landing(self, swing: int) -> tuple[Array, float]:
        """Where the person's foot ``swing`` (0 left, 1 right) is in the other sole's frame: (2,) m and yaw, rad."""
        stance_yaw = self.headings[1 - swing]
        way = self.torso @ (self.between if swing == 1 else -self.between)
        c, s = math.cos(stance_yaw), math.sin(stance_yaw)
        place = np.array([c * way[0] + s * way[1], c * way[1] - s * way[0]])
        return place, wrap(self.headings[swing] - stance_yaw)


class Reach(NamedTuple):
    """What a frame's time allows: dt in s; joint angles (J,) rad within the speed limits, and within the accelerations.

    smooth_low, smooth_high lie within low, high; they are kept wherever the feet allow it. Read by compiled code too.
    """

    dt: float
    low: Array
    high: Array
    smooth_low: Array
    smooth_high: Array


@dataclass(frozen=True)
class Answer:
    """The pose that was found, what it gave up, and the solver's iterations."""

    pose: Pose
    given_up: GivenUp
    iterations: int


class Retargeting(Protocol):
    """A way of placing the feet: ``planted``, ``paper`` or ``direct``."""

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""

    @property
    def offset(self) -> float:
        """The robot's normalised offset, 0 left to 1 right."""

    @property
    def settled(self) -> bool:
        """Whether the body has been where it belongs for so long that nothing sways when a foot is lifted."""

    def place(self, q: Array, feet: Array, footing: Footing) -> Pose:
        """Stand in double support as near to the footing as the landing set allows, starting from q (J,) rad.

        feet: (2, 3) m, the targets (5) of the soles.
        """

    def stand(self, q: Array) -> Pose:
        """Stand in double support as q (J,) rad does, its soles flat, its feet around the origin, facing +x."""

    def step(self, pose: Pose, q_arms: Array, feet: Array, footing: Footing, reach: Reach) -> Answer:
        """The next pose: arms and head from q_arms (J,) rad, feet (2, 3) m the targets (5) of the soles."""

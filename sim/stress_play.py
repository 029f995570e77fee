"""One planned motion under one disturbance: what failed first, and by how much the rest held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.core.falling import HEIGHT_LIMIT, TILT_LIMIT, has_tipped
from naoimitate.core.frames import Array
from naoimitate.hw.feedback import feedback
from naoimitate.hw.target import ServoCommand
from naoimitate.robot.model import RobotModel
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.settings import SimSettings
from naoimitate.sim.simulate import SimResult, period_of, simulate

TIPPED, SANK, LOADED = "tipped", "sank", "swing foot loaded"
"""What can fail; see ``core.falling``."""


@dataclass(frozen=True)
class Plan:
    """A motion to be played: T frames as ``simulate`` takes them; hand_opening (T, 2), NaN keeps the last."""

    name: str
    time: Array
    q: Array
    base_pos: Array
    base_quat: Array
    support: npt.NDArray[np.str_]
    hand_opening: Array


@dataclass(frozen=True)
class Outcome:
    """How it went, up to the first failure.

    failure: what failed first, ``TIPPED``, ``SANK`` or ``LOADED``, None for a motion that was survived; at: when, s of
    the robot's time; tipped: whether the torso tipped or sank then or later. tilt: largest, rad, off the plan. height:
    smallest, over the plan. swing_load: largest share of the weight on a foot in the air. cop_margin: smallest, m, over
    the frames, NaN where the soles never carried. drift: largest horizontal distance of the torso from its plan, m.
    """

    failure: str | None
    at: float
    tipped: bool
    tilt: float
    height: float
    swing_load: float
    cop_margin: float
    drift: float

    @property
    def survived(self) -> bool:
        """Whether nothing failed."""
        return self.failure is None


def play(
    robot: RobotModel,
    plan: Plan,
    disturbance: Disturbance,
    *,
    known_stiffness: bool = False,
    closed: bool = False,
    control: ServoCommand | None = None,
) -> Outcome:
    """Play a plan under a disturbance until its end or until the robot lies.

    known_stiffness: the driver divides by the stiffness that its servos really have; else by the nominal one.
    closed: the driver's own loops are closed (``hw.feedback``). control: a closed loop in place of all that.
    """
    stiffness = disturbance.stiffness if known_stiffness else SimSettings.stiffness
    if closed and control is None:
        control = feedback(robot, stiffness, period_of(plan.time))
    result = simulate(
        robot,
        plan.time,
        plan.q,
        plan.base_pos,
        plan.base_quat,
        plan.support,
        hand_opening=plan.hand_opening,
        stiffness=stiffness,
        disturbance=disturbance,
        control=control,
        until_tipped=True,
    )
    return _outcome(plan, result)


def _outcome(plan: Plan, result: SimResult) -> Outcome:
    count = len(result.time) if result.survived else int(np.argmax(result.fell)) + 1
    margins = result.cop_margin[:count]
    away = result.base_pos[:count, :2] - plan.base_pos[:count, :2]
    return Outcome(
        failure=None if result.survived else _failure(result, count - 1),
        at=float(result.time[count - 1]),
        tipped=bool(has_tipped(result.tilt, result.height_ratio).any()),
        tilt=float(result.tilt[:count].max()),
        height=float(result.height_ratio[:count].min()),
        swing_load=float(result.swing_load[:count].max()),
        cop_margin=float(np.nanmin(margins)) if np.isfinite(margins).any() else float("nan"),
        drift=float(np.linalg.norm(away, axis=1).max()),
    )


def _failure(result: SimResult, frame: int) -> str:
    if result.tilt[frame] > TILT_LIMIT:
        return TIPPED
    return SANK if result.height_ratio[frame] < HEIGHT_LIMIT else LOADED

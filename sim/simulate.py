"""Play a planned motion on the servos of the simulated robot, and measure whether it survives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from naoimitate.core.falling import has_fallen, has_tipped, swing_load, tilt
from naoimitate.core.frames import SIDES, Array
from naoimitate.core.geometry import convex_hull, polygon_margin
from naoimitate.hw.servo_command import servo_command
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot.model import RobotModel
from naoimitate.sim.disturbance import Disturbance, disturb_model, disturbed_settings
from naoimitate.sim.disturbance_line import CommandLine
from naoimitate.sim.disturbance_sensors import NoisySensors
from naoimitate.sim.ground import Ground, set_heights, split_floor
from naoimitate.sim.physics import Physics
from naoimitate.sim.settings import SimSettings

DEFAULT = SimSettings()

SETTLE_TIME, STAND_TIME = 1.0, 3.0
"""s for which the robot settles in its first pose, so that servos and soles reach equilibrium, and then stands there
before the motion starts: closed loops get to know their servos, as on a robot that waits for its operator."""


@dataclass(frozen=True)
class SimResult:
    """A motion as it really moved, T frames at the times of the plan.

    time: (T,) s. q: (T, J) rad. base_pos (T, 3) m, base_quat (T, 4): torso in the world.
    tilt: (T,) rad between the torso's up-axis and its planned direction. height_ratio: (T,) torso height over plan.
    load: (T, 2) N on the left and right sole, mean since the frame before. fsr: (T, 2, 4) N that their force sensors
    read, as ``RobotState.fsr``. swing_load: (T,) share of the weight on the foot planned in the air. cop_margin: (T,) m
    from the centre of pressure to the edge of the planned stance soles where they really are, negative outside, NaN
    while the soles carry nothing.
    hand_opening: (T, 2) left and right, 0 closed to 1 open, NaN for a robot without fingers.
    fell: (T,) bool, the measure ``survival``: True from the first failure on (see ``falling.has_fallen``).
    """

    time: Array
    q: Array
    base_pos: Array
    base_quat: Array
    tilt: Array
    height_ratio: Array
    load: Array
    fsr: Array
    swing_load: Array
    cop_margin: Array
    hand_opening: Array
    fell: npt.NDArray[np.bool_]

    @property
    def survived(self) -> bool:
        """Whether the robot never fell and no foot in the air carried weight."""
        return not self.fell.any()


def simulate(
    robot: RobotModel,
    time: Array,
    q: Array,
    base_pos: Array,
    base_quat: Array,
    support: npt.NDArray[np.str_],
    *,
    hand_opening: Array | None = None,
    stiffness: float = DEFAULT.stiffness,
    compensation: bool = True,
    settings: SimSettings = DEFAULT,
    progress: Callable[[float], None] | None = None,
    disturbance: Disturbance | None = None,
    control: ServoCommand | None = None,
    ground: Ground | None = None,
    until_tipped: bool = False,
) -> SimResult:
    """Simulate a plan of T frames: time (T,) s, q (T, J) rad, torso (T, 3) m and (T, 4), support (T,) ``D L R``.

    hand_opening: (T, 2) of the hands, as in the run file; NaN keeps the last, without one they stay closed.
    stiffness: N m/rad of every servo, in place of the settings'. compensation: the driver's load compensation.
    progress: told the share that is done. Each frame's command is under way from the time of the frame before, and is
    due at its own.
    disturbance: how the robot, its servos and its world really are, in place of the settings; the plan and the driver
    do not know it (``stiffness`` is then what the driver takes the servos for). control: stands in for compensation.
    ground: the floor's height under each foot, level at 0 without one; neither plan nor driver know it.
    until_tipped: end with the frame in which the torso tips.
    """
    postures = zip(q, base_pos, base_quat, support.tolist(), strict=True)
    plan = [Target(*posture, time=moment) for posture, moment in zip(postures, time.tolist(), strict=True)]
    openings = np.full((len(time), 2), np.nan) if hand_opening is None else hand_opening
    if disturbance is None:
        disturbance, settings = Disturbance(), replace(settings, stiffness=stiffness)
    else:
        settings = disturbed_settings(settings, disturbance)
    physics = Physics(robot, settings, None if ground is None else split_floor)
    disturb_model(physics.model, physics.data, physics.torso, disturbance)
    physics.place(*plan[0][:3], openings[0])
    control = control or servo_command(robot, stiffness if compensation else None, period_of(time))
    samples = []
    for target in _play(physics, plan, time - time[0], openings, disturbance, control, ground):
        samples.append(_sample(robot, physics, target.support))
        if progress is not None:
            progress(len(samples) / len(time))
        if until_tipped and _tipped(physics, target):
            break
    count = len(samples)
    sim_q, sim_pos, sim_quat, load, fsr, margin, opened = (np.array(column) for column in zip(*samples, strict=True))
    lean, height = tilt(base_quat[:count], sim_quat), sim_pos[:, 2] / base_pos[:count, 2]
    swing = swing_load(support[:count], load, physics.weight)
    fell = has_fallen(lean, height, swing)
    return SimResult(time[:count], sim_q, sim_pos, sim_quat, lean, height, load, fsr, swing, margin, opened, fell)


def _play(
    physics: Physics,
    plan: list[Target],
    moments: Array,
    openings: Array,
    disturbance: Disturbance,
    control: ServoCommand,
    ground: Ground | None,
) -> Iterator[Target]:
    """Let time pass up to each frame of a plan in turn; moments: (T,) s from the first frame."""
    sensors = NoisySensors(physics, disturbance)
    duration = float(moments[-1])
    line = CommandLine(disturbance.delay, disturbance.drop_at * duration, disturbance.drop_time)
    early = _before(moments)
    start = SETTLE_TIME - min(early, default=0.0)
    stand = ((plan[0], moment, openings[0]) for moment in early)
    for target, moment, opening in chain(stand, zip(plan, moments.tolist(), openings, strict=True)):
        servos = line.through(moment, control(target, sensors.read(target.base_pos, target.base_quat)))
        now, due = physics.time, moment + start
        physics.push(disturbance.push_force(now - start, due - start, duration))
        if ground is not None:
            set_heights(physics.model, physics.data, ground(now - start))
        physics.advance(servos, due - now, opening)
        if moment >= 0.0:
            yield target


def period_of(time: Array) -> float:
    """The usual time between two frames at (T,) s, in s."""
    return float(np.median(np.diff(time))) if len(time) > 1 else DEFAULT.period


def _before(moments: Array) -> list[float]:
    """Moments (s) before the first frame at which a robot that stands there is sent it, as often as the others."""
    period = period_of(moments)
    return [-period * count for count in range(round(STAND_TIME / period), 0, -1)]


def _tipped(physics: Physics, target: Target) -> bool:
    height = physics.base_pos[2] / target.base_pos[2]
    return bool(has_tipped(tilt(target.base_quat, physics.base_quat), height))


def _sample(robot: RobotModel, physics: Physics, support: str) -> tuple[Array | float, ...]:
    """Joints, torso (position, orientation), foot loads, force sensors, margin of the centre of pressure, hands: see
    ``SimResult``."""
    margin = _cop_margin(robot, physics, support)
    torso = physics.base_pos, physics.base_quat
    return physics.q, *torso, physics.foot_load.copy(), physics.fsr, margin, physics.opening


def _cop_margin(robot: RobotModel, physics: Physics, support: str) -> float:
    """Distance (m) of the centre of pressure to the edge of the soles that should stand; NaN without contact."""
    point = physics.center_of_pressure()
    if point is None:
        return np.nan
    origins, axes = physics.sole_frames()
    corners = [
        origin[:2] + robot.soles[side] @ axis[:2, :2].T
        for side, origin, axis in zip(SIDES, origins, axes, strict=True)
        if support in ("D", side.upper())
    ]
    return float(polygon_margin(convex_hull(np.concatenate(corners)), *point))

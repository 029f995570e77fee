"""Accelerations of a plan, told from its targets whenever those are taken up; nothing from a plan that is none."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from naoimitate import imitate, load_motion
from naoimitate.hw.driver import RobotState
from naoimitate.hw.inertia import APART, Inertia
from naoimitate.hw.pacing import Pacing
from naoimitate.hw.servo_command import servo_command
from naoimitate.hw.target import Target
from naoimitate.robot import load_robot
from naoimitate.robot.model import Array
from naoimitate.run.replay import replay
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.simulate import SimResult, simulate

NAO = load_robot("nao")
STAND = NAO.postures["stand"]
PERIOD = 0.01
YAW = math.radians(90.0)
TURNED = np.array([math.cos(YAW / 2.0), 0.0, 0.0, math.sin(YAW / 2.0)])


@dataclass
class Heard:
    """What a compensation hears of the accelerations of targets."""

    period: float = PERIOD
    told: list[Array] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.inertia = Inertia(NAO, self._listen, self.period)

    def _listen(self, target: Target, state: object) -> Array:
        assert target.acceleration is not None
        self.told.append(target.acceleration)
        return target.q

    def at(self, time: float, place: Array, quat: Array = TURNED) -> Array:
        """The acceleration (3,) that all links are told to have when the torso is at (3,) m in the world."""
        self.inertia(Target(STAND, place, quat, "D", None, time), None)  # type: ignore[arg-type]  # looks at no state
        assert np.ptp(self.told[-1], axis=0).max() < 1e-6, "a body that does not turn moves as one"
        return self.told[-1][0]


def place(time: float) -> Array:
    """An even acceleration of 0.8 m/s^2 along x and -0.4 along z."""
    return np.array([0.4 * time**2, 0.1 * time, 0.3 - 0.2 * time**2])


HERE = np.array([0.0, -0.8, -0.4])
"""The same along the axes of a torso that looks along y."""


def test_an_even_acceleration_is_told_exactly_along_the_torsos_axes() -> None:
    heard = Heard()
    for k in range(5):
        assert not heard.at(k * PERIOD, place(k * PERIOD)).any() or k >= round(2.0 * APART / PERIOD)
    for k in range(5, 50):
        assert heard.at(k * PERIOD, place(k * PERIOD)) == pytest.approx(HERE, abs=1e-6)


@pytest.mark.parametrize("rate", [20.0, 50.0, 240.0])
def test_plans_of_any_rate(rate: float) -> None:
    heard = Heard(min(PERIOD, 1.0 / rate))
    for k in range(20 if rate < 100.0 else 40):
        told = heard.at(k / rate, place(k / rate))
    assert told == pytest.approx(HERE, abs=1e-6)


def test_it_does_not_matter_when_a_target_is_taken_up() -> None:
    """A driver whose clock beats against the plan's: some targets twice, some never."""
    heard, rng, time = Heard(), np.random.default_rng(0), 0.0
    for k in range(300):
        time = max(time, math.floor((k + rng.uniform(-1.0, 1.0)) / 1.1) * PERIOD)
        told = heard.at(time, place(time))
        if k > 20:
            assert told == pytest.approx(HERE, abs=1e-6)


def test_a_plan_that_stops_no_longer_accelerates() -> None:
    heard = Heard()
    for k in range(20):
        heard.at(k * PERIOD, place(k * PERIOD))
    for _ in range(5):
        told = heard.at(19 * PERIOD, place(19 * PERIOD))
    assert not told.any()


def test_a_plan_that_was_held_starts_from_rest() -> None:
    """The speed before the hold is none of the motion after it."""
    heard, speed = Heard(), np.array([0.15, 0.0, 0.0])
    for k in range(20):
        heard.at(k * PERIOD, k * PERIOD * speed)
    for _ in range(10):
        heard.at(19 * PERIOD, 19 * PERIOD * speed)
    for k in range(30, 60):
        told = heard.at(k * PERIOD, (19 * PERIOD + 0.2 * (k - 29) * PERIOD) * speed)
        assert np.abs(told).max() < 1e-6


def test_a_slow_plan_among_quick_calls() -> None:
    """20 commands a second for a driver of 100: five calls for each, and its accelerations all the same."""
    heard = Heard()
    for k in range(200):
        told = heard.at((k // 5) * 0.05, place((k // 5) * 0.05))
    assert told == pytest.approx(HERE, abs=1e-6)


def test_a_plan_that_waits_and_catches_up_has_no_rough_accelerations() -> None:
    """The legs stand still for 0.2 s under an even turn of the torso; what is sent then are mixtures of its frames."""
    heard = Heard()
    pacing = Pacing(NAO, heard.inertia, PERIOD)
    nan = np.full(3, np.nan)
    for k in range(400):
        q = STAND.copy()
        legs = [j for side in "lr" for j in NAO.chains[f"{side}_leg"]]
        q[legs] += 0.3 * k * PERIOD
        pitch = 0.3 * k * PERIOD
        quat = np.array([math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0])
        seen = q - 0.012 if not 40 <= k < 60 else np.where(np.isin(np.arange(len(q)), legs), STAND + 0.108, q)
        state = RobotState(
            k * PERIOD, seen, np.full(len(q), np.nan), np.zeros(2), nan, nan, np.zeros((2, 4)), fell=False
        )
        pacing(Target(q, np.zeros(3), quat, "D", None, k * PERIOD), state)
    told = np.array(heard.told)
    assert pacing.behind > 0.0, "it catches up"
    even = np.abs(told[10:35]).max()
    assert np.abs(told[120:]).max() < 1.5 * even


def test_a_plan_that_jumps_or_goes_back_or_has_no_time_does_not_accelerate() -> None:
    heard, end = Heard(), 20
    for k in range(end):
        heard.at(k * PERIOD, place(k * PERIOD))
    far = np.array([0.5, 0.0, 0.0])
    for k in range(end, end + 40):
        told = heard.at(k * PERIOD, place(k * PERIOD) + far)
        assert not told.any() or told == pytest.approx(HERE, abs=1e-6), "before or after, and no part of the jump"
    assert told == pytest.approx(HERE, abs=1e-6)
    assert not heard.at(0.1, place(0.1)).any()
    assert not heard.at(math.nan, place(0.2)).any()
    assert not heard.at(math.nan, place(0.3)).any()
    assert not heard.at(0.2, place(0.2)).any()


def test_soft_servos_that_are_told_of_accelerations_hardly_sway() -> None:
    """The walk at speed on servos of 60 N m/rad: how far the torso is from where it is planned."""
    run = imitate(load_motion("builtin:walk"), NAO)
    soft = Disturbance(stiffness=60.0)

    def played(told: bool) -> SimResult:
        control = servo_command(NAO, 60.0, PERIOD)
        still = lambda target, state: control(target._replace(time=math.nan), state)  # noqa: E731
        plan = (run.time, run.q, run.base_pos, run.base_quat, run.support)
        return simulate(NAO, *plan, disturbance=soft, control=control if told else still)

    swaying, calm = played(False), played(True)
    assert swaying.tilt.max() > math.radians(3.0)
    assert calm.tilt.max() < math.radians(2.0)
    assert calm.survived
    com = replay(NAO, calm.q, calm.base_pos, calm.base_quat).com
    assert np.abs(com - run.com)[:, :2].max() < 0.008

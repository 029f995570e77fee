"""Load compensation learns how soft the servos are, within bounds, and from nothing that it cannot believe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sim_poses import one_foot_pose

from naoimitate.hw.driver import RobotState
from naoimitate.hw.lean import UPRIGHT
from naoimitate.hw.learning import LearningCompensation, LearningSettings
from naoimitate.hw.planted_shift import PlantedShift
from naoimitate.hw.servo_command import servo_command
from naoimitate.hw.target import ServoCommand, Target
from naoimitate.robot import RobotModel, load_robot
from naoimitate.robot.model import Array
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.simulate import SimResult, simulate

PERIOD, NOMINAL = 0.01, 300.0
NAO = load_robot("nao")
BOUNDS = LearningSettings()
STAND = Target(NAO.postures["stand"], *stand_on_floor(NAO, NAO.postures["stand"]), "D")


def hold(robot: RobotModel, q: Array, support: str, control: ServoCommand, **disturbance: float) -> SimResult:
    """Stand as q for 4 s."""
    frames = 400
    pos, quat = stand_on_floor(robot, q, None if support == "D" else support.lower())
    plan = [np.tile(row, (frames, 1)) for row in (q, pos, quat)]
    time, supports = PERIOD * np.arange(frames), np.full(frames, support)
    return simulate(robot, time, *plan, supports, disturbance=Disturbance(**disturbance), control=control)


def hanging(factor: float, target: Target = STAND, moment: float = 0.0) -> RobotState:
    """A robot at rest on both feet whose servos hang ``factor`` times as far as nominal ones below their command."""
    nominal = servo_command(NAO, NOMINAL, PERIOD)(target, None)  # type: ignore[arg-type]  # looks at no state
    q = target.q + (1.0 - factor) * (nominal - target.q)
    nan, fsr = np.full(len(q), np.nan), np.full((2, 4), NAO.mass * 9.81 / 8.0)
    return RobotState(moment, q, nan, np.zeros(2), np.zeros(3), np.zeros(3), fsr, fell=False)


def listen(learning: LearningCompensation, change: Callable[[RobotState], RobotState], count: int = 200) -> float:
    """The factor after some periods of standing on servos three times as soft, as far as ``change`` lets it be seen."""
    for i in range(count):
        learning(STAND, change(hanging(3.0, moment=PERIOD * (i + 1))))
    return learning.factor


@pytest.mark.parametrize("stiffness", [60.0, 100.0, 150.0])
@pytest.mark.parametrize("support", ["D", "L"])
def test_soft_servos_are_learned_and_the_robot_stands_where_it_should(stiffness: float, support: str) -> None:
    q = NAO.postures["stand"] if support == "D" else one_foot_pose(NAO, "l")
    learning = LearningCompensation(NAO, NOMINAL, PERIOD)
    result = hold(NAO, q, support, learning, stiffness=stiffness)
    assert learning.factor == pytest.approx(NOMINAL / stiffness, rel=0.25)
    legs = [j for side in "lr" for j in NAO.chains[f"{side}_leg"]]
    off = np.abs(result.q[-1] - q)[legs].max()
    plain = hold(NAO, q, support, servo_command(NAO, NOMINAL, PERIOD), stiffness=stiffness)
    assert off < 0.5 * np.abs(plain.q[-1] - q)[legs].max()


def test_any_robot_learns(robot: RobotModel) -> None:
    learning = LearningCompensation(robot, NOMINAL, PERIOD)
    hold(robot, robot.postures["stand"], "D", learning, stiffness=100.0)
    assert learning.factor == pytest.approx(3.0, rel=0.15)


@pytest.mark.parametrize("support", ["D", "L"])
def test_at_rest_on_servos_as_supposed_it_does_nothing(support: str) -> None:
    q = NAO.postures["stand"] if support == "D" else one_foot_pose(NAO, "l")
    learning = LearningCompensation(NAO, NOMINAL, PERIOD)
    hold(NAO, q, support, learning, noise=1.0)
    assert learning.factor == 1.0
    state = hanging(1.0, moment=99.0)
    np.testing.assert_array_equal(learning(STAND, state), servo_command(NAO, NOMINAL, PERIOD)(STAND, state))


def test_what_it_hears_in_this_file_is_otherwise_believed() -> None:
    assert listen(LearningCompensation(NAO, NOMINAL, PERIOD), lambda state: state) > 2.0


@pytest.mark.parametrize(
    "change",
    [
        lambda s: replace(s, q=np.full_like(s.q, np.nan)),
        lambda s: replace(s, angles=np.full(2, np.nan)),
        lambda s: replace(s, fsr=np.full((2, 4), np.nan)),
        lambda s: replace(s, time=1.0),
        lambda s: replace(s, fsr=np.zeros((2, 4))),
        lambda s: replace(s, fsr=s.fsr * [[2.0], [0.0]]),
        lambda s: replace(s, angles=np.array([0.0, 0.3])),
        lambda s: replace(s, q=s.q + np.where(np.arange(len(s.q)) == NAO.joint("LKneePitch"), 0.3, 0.0)),
    ],
    ids=["joints", "torso", "feet", "stale", "in the air", "other stance", "leaning", "blocked"],
)
def test_nothing_is_learned_from_a_state_that_is_not_known(change: Callable[[RobotState], RobotState]) -> None:
    learning = LearningCompensation(NAO, NOMINAL, PERIOD)
    learning(STAND, replace(hanging(1.0), time=1.0))
    assert listen(learning, change) == 1.0


def test_balance_that_trembles_does_not_keep_it_from_learning() -> None:
    """Its target is a little elsewhere in every period, as far as a stabiliser moves it for its sensors' noise."""
    learning, rng = LearningCompensation(NAO, NOMINAL, PERIOD), np.random.default_rng(0)
    planted = PlantedShift(NAO)
    for i in range(200):
        q = planted.moved(STAND, rng.normal(0.0, 0.001, 2), 0.0, NAO.lower, NAO.upper)
        assert q is not None
        learning(STAND._replace(q=q), hanging(3.0, moment=PERIOD * (i + 1)))
    assert learning.factor > 2.0


def test_on_one_foot_the_other_leg_may_move_while_it_learns() -> None:
    learning, q = LearningCompensation(NAO, NOMINAL, PERIOD), one_foot_pose(NAO, "l")
    base = stand_on_floor(NAO, q, "l")
    fsr = np.array([[NAO.mass * 9.81 / 4.0] * 4, [0.0] * 4])
    for i in range(200):
        kicking = q.copy()
        kicking[NAO.joint("RKneePitch")] += 0.3 * np.sin(0.1 * i)
        target = Target(kicking, *base, "L")
        learning(target, replace(hanging(3.0, target, PERIOD * (i + 1)), fsr=fsr, angles=np.zeros(2)))
    assert learning.factor > 2.0


def test_what_was_learned_stays_when_the_state_gets_lost() -> None:
    learning = LearningCompensation(NAO, NOMINAL, PERIOD)
    learned = listen(learning, lambda state: state)
    assert listen(learning, lambda s: replace(s, q=np.full_like(s.q, np.nan))) == learned


@given(st.lists(st.tuples(st.floats(-5.0, 50.0), st.floats(-0.4, 0.4), st.integers(0, 2)), min_size=1, max_size=60))
def test_whatever_it_senses_its_commands_stay_within_their_bounds(seen: list[tuple[float, float, int]]) -> None:
    """Sags of any size, and postures anywhere in the range of the legs."""
    learning, plain = LearningCompensation(NAO, NOMINAL, PERIOD), servo_command(NAO, NOMINAL, PERIOD)
    last = np.zeros(len(STAND.q))
    for i, (factor, bend, support) in enumerate(seen):
        q = STAND.q.copy()
        for side, leg in ((1.0, "l_leg"), (-1.0, "r_leg")):
            q[list(NAO.chains[leg])] += bend * side
        target = Target(np.clip(q, NAO.lower, NAO.upper), STAND.base_pos, UPRIGHT, "DLR"[support])
        state = hanging(factor, target, PERIOD * (i + 1))
        command, nominal = learning(target, state), plain(target, state)
        offset = command - nominal
        assert BOUNDS.firmest <= learning.factor <= BOUNDS.softest
        assert np.abs(offset).max() <= BOUNDS.most + 1e-12
        assert (command <= np.maximum(NAO.upper, nominal) + 1e-12).all()
        assert (command >= np.minimum(NAO.lower, nominal) - 1e-12).all()
        assert np.abs(learning._offset - last).max() <= BOUNDS.speed * PERIOD + 1e-12
        last = learning._offset

"""What was given up of the similarity, and for what: every bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from judge import ARM_UP, LEFT_LIFTED, Judge, imitate, still, stream
from people import person, tpose, without

from naoimitate.core.frames import GivenUp
from naoimitate.imitator import Imitator
from naoimitate.robot.model import RobotModel


def test_reach_is_given_up_when_the_arm_cannot_get_there(nao: RobotModel) -> None:
    """Both arms straight behind the back: no shoulder of this robot goes there."""
    behind = (-1.5, 0.0, 0.0, 0.0)
    judge = imitate(nao, still(150, frame=person(arms=[behind, behind])))
    assert GivenUp.REACH in judge.commands[-1].given_up


def test_collision_is_given_up_when_the_body_is_in_the_way(nao: RobotModel) -> None:
    """Hands folded inside the belly."""
    inside = (0.3, -0.9, 1.9, -0.5)
    judge = imitate(nao, still(200, frame=person(arms=[inside, inside])))
    assert GivenUp.COLLISION in judge.given_up


def test_speed_is_given_up_when_an_arm_is_thrown_up(nao: RobotModel) -> None:
    judge = imitate(nao, still(10) + still(10, frame=person(arms=[ARM_UP, ARM_UP]), start=0.2))
    assert GivenUp.SPEED in judge.commands[-1].given_up


def test_balance_is_given_up_when_planted_feet_hold_the_torso(nao: RobotModel) -> None:
    """A twist of the body over planted feet cannot show in the torso of a robot with coupled hips."""
    judge = imitate(nao, still(100, frame=person(trunk=[0.5, 0.5, 0.1], height=0.7)))
    assert GivenUp.BALANCE in judge.commands[-1].given_up


def test_support_is_given_up_while_the_robot_shifts_its_weight(nao: RobotModel) -> None:
    frames = still(20) + [replace(f, support="R") for f in still(150, frame=person(**LEFT_LIFTED), start=0.4)]
    judge = imitate(nao, frames)
    assert GivenUp.SUPPORT in judge.commands[25].given_up
    assert GivenUp.SUPPORT not in judge.commands[-1].given_up
    assert judge.supports == "DR"


def test_support_is_given_up_in_a_flight(nao: RobotModel) -> None:
    judge = imitate(nao, still(5) + [replace(f, support="F") for f in still(50, start=0.1)])
    assert all(GivenUp.SUPPORT in c.given_up for c in judge.commands[5:])
    assert judge.supports == "D"


def test_landing_is_given_up_when_the_step_is_too_long(nao: RobotModel) -> None:
    far = {
        "feet": [[0.5, 0.1, 0.05, 0.0, 0.0, 0.0], [0.0, -0.1, 0.0, 0.0, 0.0, 0.0]],
        "com": [0.04, -0.1],
        "height": 0.75,
    }
    up = [replace(f, support="R") for f in still(200, frame=person(**far))]
    down = [replace(f, support="D") for f in still(150, frame=person(**far), start=4.0)]
    judge = imitate(nao, up + down)
    assert GivenUp.LANDING in judge.given_up
    assert judge.supports == "DRD"


def test_input_is_given_up_when_landmarks_are_missing(nao: RobotModel) -> None:
    judge = imitate(nao, still(5) + [without(f, "l_wrist") for f in still(5, start=0.1)])
    assert [GivenUp.INPUT in c.given_up for c in judge.commands] == [False] * 5 + [True] * 5


def test_hold_is_given_up_when_no_step_passes_the_gate(nao: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """A gate that refuses everything: the last safe pose is repeated until it opens again."""
    from naoimitate.gate import Gate

    imitator, judge = Imitator(nao), Judge(nao)
    imitator.calibrate(tpose())
    moving = stream("squat", 50.0, 2.0, 4.0)
    for frame in moving[:20]:
        safe = judge.take(imitator.step(frame))
    with monkeypatch.context() as patch:
        patch.setattr(Gate, "passes", lambda *_: False)
        held = [judge.take(imitator.step(frame)) for frame in moving[20:40]]
    assert all(GivenUp.HOLD in c.given_up and np.array_equal(c.q, safe.q) for c in held)
    after = [judge.take(imitator.step(frame)) for frame in moving[40:]]
    assert not any(GivenUp.HOLD in c.given_up for c in after)
    assert np.abs(after[-1].q - safe.q).max() > 0.05

"""The pipeline: every command is possible and balanced, whoever is imitated and however fast."""

from __future__ import annotations

import numpy as np
import pytest
from judge import ARM_UP, Judge, imitate, steps, still, stream
from people import person, tpose, turned

from naoimitate.core.errors import CalibrationError
from naoimitate.core.frames import GivenUp
from naoimitate.imitator import Imitator
from naoimitate.motion.builtin import HANGING, builtin_motion
from naoimitate.robot.model import RobotModel
from naoimitate.settings import PAPER, Settings


@pytest.mark.parametrize("rate", [20.0, 60.0, 120.0, 240.0])
def test_limits_hold_at_any_frame_rate(robot: RobotModel, rate: float) -> None:
    """The march, from its first lift-off to its second, as a live stream: dt from the frames' own times."""
    judge = imitate(robot, stream("march", rate, 3.0, 7.0))
    assert judge.commands[-1].time == pytest.approx(4.0, abs=0.1)
    assert "L" in judge.supports


@pytest.mark.parametrize("rate", [20.0, 60.0, 120.0, 240.0])
def test_a_fast_arm_is_held_back_by_the_clock_and_not_by_the_frames(nao: RobotModel, rate: float) -> None:
    """Arms thrown up within a frame: the hand arrives when its speed allows, whatever the frame rate."""
    up = person(arms=[ARM_UP, ARM_UP])
    frames = still(int(0.5 * rate), 1.0 / rate) + still(int(2.5 * rate), 1.0 / rate, up, 0.5)
    judge = imitate(nao, frames)
    assert GivenUp.SPEED in judge.given_up
    hands = np.array([c.q[nao.joint("LShoulderPitch")] for c in judge.commands])
    times = np.array([c.time for c in judge.commands])
    half = times[np.argmax(hands < 0.5 * (hands[0] + hands[-1]))]
    assert 0.6 < half < 1.5


def test_frames_without_a_needed_calibration_are_refused(nao: RobotModel) -> None:
    with pytest.raises(CalibrationError, match="calibrate"):
        Imitator(nao).step(person())


def test_the_first_command_is_a_double_support_stand_near_the_person(robot: RobotModel) -> None:
    judge = imitate(robot, [person(arms=[(1.2, 0.2, 0.5, 0.0), HANGING])])
    command = judge.commands[0]
    assert command.support == "D" and command.time == 0.0
    assert command.soles[:, 2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert abs(command.soles[:, 1].mean()) < 1e-6


def test_calibrating_again_starts_again(nao: RobotModel) -> None:
    imitator = Imitator(nao)
    imitator.calibrate(tpose())
    first = [imitator.step(f) for f in still(20)]
    imitator.calibrate(tpose())
    again = [imitator.step(f) for f in still(20)]
    for a, b in zip(first, again, strict=True):
        assert np.array_equal(a.q, b.q) and a.time == b.time


def test_the_same_stream_gives_the_same_commands(robot: RobotModel) -> None:
    frames = stream("side-kick", 50.0, 2.0, 6.0)
    a, b = imitate(robot, frames), imitate(robot, frames)
    for x, y in zip(a.commands, b.commands, strict=True):
        assert np.array_equal(x.q, y.q) and np.array_equal(x.base_pos, y.base_pos) and x.given_up == y.given_up


def test_the_person_may_face_any_way_and_walk_off(nao: RobotModel) -> None:
    frames = stream("paper", 50.0, 6.0, 10.0)
    here = imitate(nao, frames)
    there = imitate(nao, [turned(f, 2.1, 30.0, -70.0) for f in frames])
    for x, y in zip(here.commands, there.commands, strict=True):
        assert x.q == pytest.approx(y.q, abs=1e-5) and x.support == y.support, "rounding of 1e-14 m, grown in 200 steps"


def test_a_person_who_stands_still_gets_a_robot_that_stands_still(robot: RobotModel) -> None:
    judge = imitate(robot, still(300))
    last = np.array([c.q for c in judge.commands[150:]])
    assert np.abs(np.diff(last, axis=0)).max() < 2e-4
    assert judge.supports == "D"


def test_the_robot_is_never_stuck_wherever_the_person_steps(robot: RobotModel) -> None:
    """Five random steps; 4 s on each foot and on both are enough to get there every time."""
    imitator, judge = Imitator(robot), Judge(robot)
    imitator.calibrate(tpose())
    for support, frames in steps(5, seed=0):
        for frame in frames:
            judge.take(imitator.step(frame))
        assert judge.commands[-1].support == support, f"stuck at {judge.commands[-1].time:.1f} s"
    assert GivenUp.LANDING in judge.given_up


# Other settings.


@pytest.mark.parametrize("orientation", ["free", "upright", "follow"])
def test_every_hand_orientation_is_safe(robot: RobotModel, orientation: str) -> None:
    imitate(robot, stream("wave", 50.0, 2.0, 8.0), Settings(hand_orientation=orientation))


def test_the_papers_settings_keep_limits_and_balance(nao: RobotModel) -> None:
    """Its feet are shifted over the floor, so slip is not judged."""
    imitator, judge = Imitator(nao, PAPER), Judge(nao)
    imitator.calibrate(tpose())
    for frame in stream("paper", 30.0, 0.0, 12.0):
        command = imitator.step(frame)
        judge._numbers(command)
        judge._ranges(command)
        if judge.commands:
            judge._motion(judge.commands[-1], command)
        judge.commands.append(command)
    assert judge.supports.startswith("DL")


@pytest.mark.parametrize("retarget", ["planted", "paper"])
def test_a_robot_that_stands_blends_in_without_a_jump(robot: RobotModel, retarget: str) -> None:
    imitator = Imitator(robot, Settings(retarget=retarget))
    frame = still(1)[0]
    imitator.calibrate(tpose())
    imitator.stand()
    imitator.blend(1.0)
    q, speed = robot.postures["stand"], np.zeros(len(robot.joint_names))
    for _ in range(150):
        command = imitator.step(frame, 0.01)
        assert command.support == "D"
        after = (command.q - q) / 0.01
        assert (np.abs(after) <= 0.9 * robot.speed).all()
        assert np.abs(after - speed).max() * 0.01 < 0.02, "rad of a step that were not in the one before"
        q, speed = command.q, after
    assert not imitator.blending


def test_who_takes_over_is_imitated_from_where_the_robot_is(nao: RobotModel) -> None:
    imitator = Imitator(nao)
    first = imitator.calibrate(tpose())
    frames = still(30)
    last = [imitator.step(f, 0.01) for f in frames][-1]
    imitator.turn_to(first)
    imitator.blend(0.5)
    command = imitator.step(frames[-1], 0.01)
    assert np.abs(command.q - last.q).max() < 0.01
    assert command.time == pytest.approx(last.time + 0.01)


def test_the_upper_body_alone_is_imitated_by_a_robot_that_stands(robot: RobotModel) -> None:
    imitator = Imitator(robot, Settings(upper_body=True))
    imitator.calibrate(tpose())
    commands = [imitator.step(f, 0.02) for f in stream("side-kick", 50.0, 0.0, 8.0)]
    assert {c.support for c in commands} == {"D"}
    q = np.array([c.q for c in commands])
    legs, arms = (robot.chains[f"l_{part}"] for part in ("leg", "arm"))
    assert np.ptp(q[50:, list(legs)], axis=0).max() < 0.1 * np.ptp(q[:, list(arms)], axis=0).max()


def test_a_robot_that_holds_stays_in_its_pose_and_goes_on_from_there(robot: RobotModel) -> None:
    motion = builtin_motion("march")
    imitator = Imitator(robot)
    with pytest.raises(CalibrationError, match="use"):
        imitator.hold(motion.at(0.0), 0.01)
    imitator.calibrate(motion.tpose)
    before = [imitator.step(motion.at(0.01 * k), 0.01) for k in range(150)][-1]
    held = [imitator.hold(motion.at(1.5 + 0.01 * k), 0.01) for k in range(100)]
    for command in held:
        np.testing.assert_array_equal(command.q, before.q)
        assert command.given_up is GivenUp.HOLD and command.support == before.support
    np.testing.assert_allclose(np.diff([before.time, *(c.time for c in held)]), 0.01, atol=1e-9)
    after = imitator.step(motion.at(2.5), 0.01)
    assert (np.abs(after.q - before.q) <= 0.9 * robot.speed * 0.01).all()

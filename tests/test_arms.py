"""Arms on their way: every target they can reach is reached, through singular shoulders too, within every limit."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from naoimitate.arms import Arms
from naoimitate.balance.retarget import Reach
from naoimitate.limb import LimbWeights, build_limb
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

DT, SHARE, ACCELERATION = 0.01, 0.85, 40.0
RESERVE = 0.002
SECONDS, PATIENT = 8.0, 30.0
"""An arm without a spare joint leaves its target for another posture only after a while."""
NOTHING_NEAR = SimpleNamespace(limb_rows=lambda pose, joints: (np.zeros((0, len(joints))), np.zeros(0)))


class Walker:
    """Both arms of a robot with nothing in their way, moved frame by frame; checks speed, acceleration and range."""

    def __init__(self, robot: RobotModel) -> None:
        robot = self.robot = replace(robot, pairs=np.zeros((0, 2), dtype=np.int64))
        self.arms = Arms(robot, LimbWeights(), RESERVE, "free", None)
        self.limbs = [build_limb(robot, f"{side}_arm", RESERVE) for side in "lr"]
        self.joints = np.concatenate([limb.joints for limb in self.limbs])
        self.start(robot.postures["stand"])

    def start(self, q: np.ndarray) -> None:
        self.arms.reset()
        self.q, self.velocity = q.copy(), np.zeros(len(q))

    def hands(self) -> np.ndarray:
        """Hands from the shoulders, (2, 3) m."""
        return np.array(self.arms.hands(posed(self.robot, self.q)))

    def step(self, targets: np.ndarray, elbows: np.ndarray) -> np.ndarray:
        """One frame; distances (2,) m of the hands to their targets (2, 3) m."""
        reach = self._reach()
        seen = SimpleNamespace(body=SimpleNamespace(elbows=elbows), hands=None)
        q, _ = self.arms.solve(posed(self.robot, self.q), targets, seen, reach, NOTHING_NEAR)
        inside = self.joints
        assert np.isfinite(q).all()
        assert (q >= reach.smooth_low - 1e-9)[inside].all() and (q <= reach.smooth_high + 1e-9)[inside].all()
        assert (q >= self.robot.lower - 1e-9)[inside].all() and (q <= self.robot.upper + 1e-9)[inside].all()
        self.velocity, self.q = (q - self.q) / DT, q
        return np.asarray(np.linalg.norm(self.hands() - targets, axis=1))

    def _reach(self) -> Reach:
        turn, change = self.robot.speed * (SHARE * DT), ACCELERATION * DT * DT
        low, high, coasting = self.q - turn, self.q + turn, self.q + self.velocity * DT
        lower, upper = self.robot.lower + RESERVE, self.robot.upper - RESERVE
        brake_low = self.q - DT * np.sqrt(2.0 * ACCELERATION * np.maximum(self.q - lower, 0.0))
        brake_high = self.q + DT * np.sqrt(2.0 * ACCELERATION * np.maximum(upper - self.q, 0.0))
        smooth_low = np.clip(np.maximum(coasting - change, brake_low), low, np.minimum(high, brake_high))
        smooth_high = np.clip(np.minimum(coasting + change, brake_high), np.maximum(low, brake_low), high)
        return Reach(DT, low, high, smooth_low, smooth_high)


def posed(robot: RobotModel, q: np.ndarray) -> SimpleNamespace:
    """What the arms look at of a pose."""
    n = len(q)
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    return SimpleNamespace(q=q, link_pos=pos, link_rot=rot, base_rot=np.eye(3))


def anywhere(walker: Walker, rng: np.random.Generator) -> np.ndarray:
    """A standing posture (J,) with the arms anywhere in their ranges."""
    q = walker.robot.postures["stand"].copy()
    for limb in walker.limbs:
        q[limb.joints] = rng.uniform(limb.lower + 0.02, limb.upper - 0.02)
    return q


def directions(rng: np.random.Generator) -> np.ndarray:
    """Elbow directions (2, 3) that have nothing to do with the targets."""
    v = rng.normal(size=(2, 3))
    return np.asarray(v / np.linalg.norm(v, axis=1)[:, None])


def test_any_reachable_target_is_reached_from_anywhere(robot: RobotModel) -> None:
    """Two hands at a time, elbows asked for something else. At a joint's end an arm may rest 2 mm off: for less it does
    not take another posture."""
    walker, rng = Walker(robot), np.random.default_rng(0)
    late, far = 0, 0
    count, seconds = 200, SECONDS if len(robot.chains["l_arm"]) > 3 else PATIENT
    for _ in range(count):
        goal, start = anywhere(walker, rng), anywhere(walker, rng)
        walker.start(goal)
        targets, elbows = walker.hands(), directions(rng)
        walker.start(start)
        settled, errors = 0, np.zeros(2)
        for _ in range(round(seconds / DT)):
            errors = walker.step(targets, elbows)
            settled = settled + 1 if errors.max() < 5e-4 else 0
            if settled == 5:
                break
        late, far = late + (settled < 5), far + (errors.max() > 2.5e-3)
    assert late <= 0.1 * count
    assert far <= 0.02 * count


@pytest.mark.parametrize("radius", [0.01, 0.03, 0.06, 0.1])
def test_hand_that_circles_the_shoulder_axis_is_followed_but_while_the_joints_unwind(
    nao: RobotModel, radius: float
) -> None:
    """Twice around the axis through both shoulders: no joint can turn that far, so the arm has to unwind once a turn.

    That takes about 1 s at the motors' speed, at most three times here; all the other time the hand is near.
    """
    walker, period, elbows = Walker(nao), 6.0, np.zeros((2, 3))
    side = np.sqrt((0.97 * nao.limb_length["l_arm"]) ** 2 - radius**2)
    far, frames = [], round(2.0 * period / DT)
    for k in range(frames + 200):
        angle = 2.0 * np.pi * max(k - 200, 0) * DT / period
        x, z = radius * np.cos(angle), -radius * np.sin(angle)
        errors = walker.step(np.array([[x, side, z], [x, -side, z]]), elbows)
        if k >= 200:
            far.append(errors)
    out_of_reach = 0.035 if radius < 0.05 else 0.01
    share = np.mean(np.array(far) > out_of_reach, axis=0)
    assert (share < 3.6 / (2.0 * period)).all()


def test_the_same_hands_give_the_same_arms(nao: RobotModel) -> None:
    paths = []
    for _ in range(2):
        walker, rng = Walker(nao), np.random.default_rng(3)
        for _ in range(5):
            target = anywhere(walker, rng)
            keep = walker.q.copy()
            walker.q = target
            targets = walker.hands()
            walker.q = keep
            for _ in range(60):
                walker.step(targets, np.zeros((2, 3)))
        paths.append(walker.q)
    assert np.array_equal(*paths)


def test_an_arm_that_fits_stays_in_its_posture(nao: RobotModel) -> None:
    """A slow hand inside the workspace is followed to a tenth of a millimetre, without any change."""
    walker, rng = Walker(nao), np.random.default_rng(4)
    middle = np.array([[0.14, 0.08, -0.08], [0.14, -0.08, -0.08]])
    for _ in range(200):
        walker.step(middle, np.zeros((2, 3)))
    elbows = directions(rng)
    for k in range(300):
        shift = 0.03 * np.sin(0.02 * k * np.array([1.0, 1.3, 0.7]))
        assert walker.step(middle + shift, elbows).max() < 5e-4

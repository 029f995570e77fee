"""Distances of the body to itself and to the floor, as rows that a step must keep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from naoimitate.balance.clearance import Clearance, ClearanceSettings
from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.collision import distances, lowest_points, shape_arrays
from naoimitate.limb import LimbWeights, build_limb, solve_limb
from naoimitate.robot.model import RobotModel

SETTINGS = ClearanceSettings()
ARM_SAFE = SETTINGS.safe + SETTINGS.arms
"""m that arms keep."""
TINY = 1e-6
"""[rad] of a step by which rows are compared with what really happens."""


class Body:
    """A robot and its clearance."""

    def __init__(self, robot: RobotModel, settings: ClearanceSettings = SETTINGS) -> None:
        self.robot, self.legs = robot, build_legs(robot, LegLimits())
        self.maker = PoseMaker(robot, self.legs)
        self.clearance = Clearance(robot, settings)
        self.shapes = shape_arrays(robot)

    def stand(self, q: np.ndarray) -> Pose:
        return self.maker.stand(q)

    def gaps(self, pose: Pose) -> np.ndarray:
        """Distances of all pairs, and heights of all shapes, m."""
        pairs, count = np.ascontiguousarray(self.robot.pairs), len(self.robot.pairs)
        d, a, b, n = np.empty(count), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
        distances(self.shapes, pairs, pose.link_pos, pose.link_rot, 1.0, d, a, b, n)
        low = np.empty((len(self.robot.shapes), 3))
        lowest_points(self.shapes, pose.link_pos, pose.link_rot, pose.base_pos, pose.base_rot, low)
        return np.concatenate([d, low[:, 2]])


def poses(robot: RobotModel, count: int, seed: int) -> list[np.ndarray]:
    """Standing legs, arms anywhere: many of them near the body."""
    rng, found = np.random.default_rng(seed), []
    arms = [*robot.chains["l_arm"], *robot.chains["r_arm"]]
    for _ in range(count):
        q = robot.postures["stand"].copy()
        q[arms] = rng.uniform(robot.lower[arms], robot.upper[arms])
        found.append(q)
    return found


def test_nearest_is_the_least_distance_of_pairs_and_of_all_but_the_feet_to_the_floor(robot: RobotModel) -> None:
    body = Body(robot)
    feet = {robot.points[f"{s}_sole"].joint for s in "lr"}
    counted = [*[True] * len(robot.pairs), *[shape.joint not in feet for shape in robot.shapes]]
    for q in poses(robot, 60, 0):
        pose = body.stand(q)
        body.clearance.look(pose)
        assert min(body.clearance.nearest, 0.03) == pytest.approx(min(body.gaps(pose)[counted].min(), 0.03), abs=1e-12)


def test_the_standing_robot_is_clear(robot: RobotModel) -> None:
    body = Body(robot)
    body.clearance.look(body.stand(robot.postures["stand"].copy()))
    assert body.clearance.nearest > SETTINGS.safe
    for side in "lr":
        assert not body.clearance.touching(np.array(robot.chains[f"{side}_arm"]))


def slopes(body: Body, make: Callable[[np.ndarray], Pose], x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives (G, n) of all gaps with respect to the joints x (n,), and which gaps (G,) have one (no kink)."""
    here = body.gaps(make(x))
    forwards, backwards = np.empty((len(here), len(x))), np.empty((len(here), len(x)))
    for i in range(len(x)):
        for sign, out in ((1.0, forwards), (-1.0, backwards)):
            moved = x.copy()
            moved[i] += sign * TINY
            out[:, i] = sign * (body.gaps(make(moved)) - here) / TINY
    return forwards, np.abs(forwards - backwards).max(axis=1) < 1e-4


@pytest.mark.parametrize("name", ["l_arm", "r_arm"])
def test_rows_of_an_arm_are_the_slopes_of_the_watched_distances(robot: RobotModel, name: str) -> None:
    """Every gap within reach that the arm can change has its row; the bound lets it shrink to the safe distance."""
    body, joints = Body(robot, ClearanceSettings(reach=0.08)), np.array(robot.chains[name])
    watched, feet = 0, {robot.points[f"{s}_sole"].joint for s in "lr"}
    counted = np.array([*[True] * len(robot.pairs), *[shape.joint not in feet for shape in robot.shapes]])
    for q in poses(robot, 25, 1):
        pose = body.stand(q)

        def make(x: np.ndarray, q: np.ndarray = q, pose: Pose = pose) -> Pose:
            moved = q.copy()
            moved[joints] = x
            hung = body.stand(moved)
            return replace(hung, base_pos=pose.base_pos, base_rot=pose.base_rot)

        body.clearance.look(pose)
        rows, bounds = body.clearance.limb_rows(pose, joints)
        slope, smooth = slopes(body, make, q[joints])
        gaps = body.gaps(pose)
        for g in np.flatnonzero(counted & smooth & (gaps < 0.08) & (np.abs(slope).max(axis=1) > 1e-4)):
            errors = np.abs(rows - slope[g]).max(axis=1)
            assert errors.min() < 1e-3
            assert np.isclose(bounds[errors < 1e-3], min(ARM_SAFE - gaps[g], SETTINGS.arms)).any()
            watched += 1
    assert watched > 20


def test_rows_of_the_legs_are_the_slopes_of_the_watched_distances(robot: RobotModel) -> None:
    """With the base hung on a sole, arms and trunk move with the legs."""
    body = Body(robot, ClearanceSettings(reach=0.06))
    legs, flat, watched = body.legs, np.stack([np.eye(3)] * 2), 0
    for side, q in enumerate(poses(robot, 2, 4)):

        def make(x: np.ndarray, q: np.ndarray = q, side: int = side) -> Pose:
            moved = np.where(legs.variable >= 0, x[np.maximum(legs.variable, 0)], q)
            return body.maker.hang(moved, side, np.zeros((2, 3)), flat)

        x = q[legs.joints] + 0.05 * np.sign(robot.postures["stand"][legs.joints])
        pose = make(x)
        body.clearance.look(pose)
        rows, _ = body.clearance.leg_rows(pose, legs, side)
        slope, smooth = slopes(body, make, x)
        near = body.gaps(pose)[: len(robot.pairs)] < 0.06
        for g in np.flatnonzero(near & smooth[: len(near)] & (np.abs(slope[: len(near)]).max(axis=1) > 1e-4)):
            assert np.abs(rows - slope[g]).max(axis=1).min() < 1e-3
            watched += 1
    assert watched >= 2


@pytest.mark.parametrize("name", ["l_arm", "r_arm"])
def test_an_arm_led_into_the_body_stops_short_of_it(nao: RobotModel, name: str) -> None:
    """Frame by frame towards points inside the trunk: what a step of 0.02 rad bends is all that is lost."""
    body, limb = Body(nao), build_limb(nao, name, 0.002)
    rng = np.random.default_rng(2)
    touched = 0
    for _ in range(15):
        pose = body.stand(nao.postures["stand"].copy())
        target = rng.uniform([-0.05, -0.03, -0.1], [0.05, 0.03, 0.1]) - limb.root * [0.0, 1.0, 0.5]
        for _ in range(120):
            body.clearance.look(pose)
            assert body.clearance.nearest > -1e-3
            rows, bounds = body.clearance.limb_rows(pose, limb.joints)
            q = pose.q.copy()
            task = (target, np.zeros(3), np.eye(3), 0)
            solve_limb(nao.tree, limb, LimbWeights(), *task, q, q - 0.02, q + 0.02, rows, bounds)
            pose = body.stand(q)
        touched += body.clearance.touching(limb.joints)
    assert touched > 5


def test_a_distance_that_no_joint_changes_has_no_row(robot: RobotModel) -> None:
    body = Body(robot, ClearanceSettings(reach=1.0))
    pose = body.stand(robot.postures["stand"].copy())
    body.clearance.look(pose)
    for name in ("l_arm", "r_leg", "head"):
        rows, _ = body.clearance.limb_rows(pose, np.array(robot.chains[name]))
        assert (np.abs(rows).max(axis=1) >= 1e-9).all()


def test_overlaps_are_opened_gently_and_distances_may_shrink_to_the_safe_one(nao: RobotModel) -> None:
    """Arms hanging straight down lie in the thighs of this robot."""
    body = Body(nao)
    q, arms = nao.postures["stand"].copy(), [*nao.chains["l_arm"], *nao.chains["r_arm"]]
    q[arms] = nao.postures["arms_down"][arms]
    pose = body.stand(q)
    body.clearance.look(pose)
    assert body.clearance.nearest < 0.0
    _, bounds = body.clearance.limb_rows(pose, np.array(nao.chains["l_arm"]))
    assert bounds.max() == SETTINGS.arms
    assert bounds.min() >= ARM_SAFE - SETTINGS.reach - 0.02
    _, bounds = body.clearance.leg_rows(pose, body.legs, 1)
    assert bounds.max() == SETTINGS.push


def test_arms_leave_the_legs_room_to_move(nao: RobotModel) -> None:
    """Where an arm may come no nearer, a leg still may: hands give way to feet, or both would wait for ever."""
    body = Body(nao)
    q, roll = nao.postures["stand"].copy(), nao.joint("LShoulderRoll")
    arms = [*nao.chains["l_arm"], *nao.chains["r_arm"]]
    q[arms] = nao.postures["arms_down"][arms]
    for angle in np.arange(0.0, 0.4, 0.002):
        q[roll], q[nao.joint("RShoulderRoll")] = angle, -angle
        pose = body.stand(q.copy())
        body.clearance.look(pose)
        if body.clearance.nearest > SETTINGS.safe + 0.5 * SETTINGS.arms:
            break
    assert body.clearance.touching(np.array(nao.chains["l_arm"]))
    assert body.clearance.limb_rows(pose, np.array(nao.chains["l_arm"]))[1].max() > 0.0
    assert body.clearance.leg_rows(pose, body.legs, 1)[1].max() < 0.0

"""The last check: every violation alone is refused, and a way out stays open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from naoimitate.balance.clearance import Clearance, ClearanceSettings
from naoimitate.balance.legs import LegLimits, build_legs
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.core.geometry import convex_hull, polygon_margin, yaw_matrix
from naoimitate.gate import Gate, GateLimits, build_gate, range_excess, speed_ratio
from naoimitate.robot.model import RobotModel

BOTH, LEFT, RIGHT = (True, True), (True, False), (False, True)
DT = 0.02
LIMITS = GateLimits()


class Guarded:
    """A robot that stands, and its gate."""

    def __init__(self, robot: RobotModel) -> None:
        self.robot = robot
        legs = build_legs(robot, LegLimits())
        self.maker = PoseMaker(robot, legs)
        self.gate = Gate(robot, legs, Clearance(robot, ClearanceSettings()), LIMITS)
        self.pose = self.maker.stand(robot.postures["stand"].copy())
        self.places, self.turns = self.pose.sole_pos.copy(), self.pose.sole_rot.copy()

    def passes(self, pose: Pose, before: Pose | None = None, stances: tuple[bool, bool] = BOTH, dt: float = DT) -> bool:
        return self.gate.passes(pose, before or self.pose, stances, self.places, self.turns, dt)

    def with_joint(self, j: int, angle: float) -> Pose:
        """The standing pose with one joint elsewhere, hung on the right sole."""
        q = self.pose.q.copy()
        q[j] = angle
        return self.maker.hang(q, 1, self.places, self.turns)

    def leaning(self, way: np.ndarray) -> Pose:
        """The standing pose with its CoM elsewhere, as a heavy load would put it."""
        return replace(self.pose, com=self.pose.com + way)


@pytest.fixture
def guarded(robot: RobotModel) -> Guarded:
    return Guarded(robot)


def test_a_robot_that_stands_still_passes(guarded: Guarded) -> None:
    assert guarded.passes(guarded.pose)
    assert guarded.gate.safe(guarded.pose)


def test_a_joint_out_of_its_range_is_refused(guarded: Guarded) -> None:
    robot = guarded.robot
    for j in [*robot.chains["l_arm"], *robot.chains["r_arm"], *robot.chains["head"]]:
        for limit, beyond in ((robot.lower[j], -1e-6), (robot.upper[j], 1e-6)):
            outside = guarded.with_joint(j, limit + beyond)
            assert not guarded.passes(outside, outside), robot.joint_names[j]
            assert not guarded.gate.safe(outside)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_angles_that_are_no_numbers_are_refused(guarded: Guarded, value: float) -> None:
    for j in range(len(guarded.robot.joint_names)):
        q = guarded.pose.q.copy()
        q[j] = value
        assert not guarded.passes(replace(guarded.pose, q=q))
        assert not guarded.gate.safe(replace(guarded.pose, q=q))


def test_a_pose_outside_a_coupling_table_is_refused(nao: RobotModel) -> None:
    model = build_gate(nao)
    for table in nao.tables:
        for x in np.linspace(table.rows[0, 0], table.rows[-1, 0], 30):
            q = nao.postures["stand"].copy()
            q[table.x] = x
            low, high = table.bounds(x)
            for bound, outwards in ((low, -1.0), (high, 1.0)):
                q[table.y] = bound + outwards * 1e-6
                assert range_excess(model, q) > 0.0
                q[table.y] = bound - outwards * 1e-6
                inside = nao.lower[table.y] <= q[table.y] <= nao.upper[table.y]
                inside &= nao.lower[table.x] <= x <= nao.upper[table.x]
                assert not inside or range_excess(model, q) <= 0.0


def test_a_joint_that_is_too_fast_is_refused(guarded: Guarded) -> None:
    robot = guarded.robot
    j = robot.chains["l_arm"][0]
    most = LIMITS.speed_share * robot.speed[j] * DT
    assert guarded.passes(guarded.with_joint(j, guarded.pose.q[j] - 0.99 * most))
    assert not guarded.passes(guarded.with_joint(j, guarded.pose.q[j] - 1.01 * most))
    assert guarded.passes(guarded.with_joint(j, guarded.pose.q[j] - 1.01 * most), dt=2.0 * DT)


def test_speed_is_that_of_the_worst_joint(robot: RobotModel) -> None:
    model, q = build_gate(robot), robot.postures["stand"]
    rng = np.random.default_rng(0)
    for _ in range(50):
        step = rng.uniform(-0.1, 0.1, len(q))
        expected = (np.abs(step) / (DT * robot.speed)).max()
        assert speed_ratio(model, q + step, q, DT) == pytest.approx(expected)


@pytest.mark.parametrize("side", [0, 1])
def test_a_stance_sole_that_slips_or_turns_is_refused(guarded: Guarded, side: int) -> None:
    moves = [np.array(v) for v in ([2e-4, 0.0, 0.0], [0.0, 2e-4, 0.0], [0.0, 0.0, 2e-4])]
    other = (side == 1, side == 0)
    for move in moves:
        places = guarded.pose.sole_pos.copy()
        places[side] += move
        slipped = replace(guarded.pose, sole_pos=places)
        assert not guarded.passes(slipped)
        assert guarded.gate.moves(slipped, guarded.pose, other, guarded.places, guarded.turns, DT), "a swing foot may"
    turns = guarded.pose.sole_rot.copy()
    turns[side] = yaw_matrix(2e-3) @ turns[side]
    assert not guarded.passes(replace(guarded.pose, sole_rot=turns))


def test_a_com_without_margin_is_refused(guarded: Guarded) -> None:
    for way in ([0.2, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, -0.2, 0.0]):
        assert not guarded.passes(guarded.leaning(np.array(way)))
        assert not guarded.gate.safe(guarded.leaning(np.array(way)))
    for stances in (LEFT, RIGHT):
        assert not guarded.passes(guarded.pose, guarded.leaning(self_over(guarded, stances)), stances), (
            "between the feet"
        )
        assert guarded.passes(guarded.leaning(self_over(guarded, stances)), stances=stances)


def self_over(guarded: Guarded, stances: tuple[bool, bool]) -> np.ndarray:
    """The way of the CoM to the centre of one foot."""
    centre = guarded.maker.centres(guarded.places, guarded.turns)[0 if stances == LEFT else 1]
    return (centre - guarded.pose.com) * [1.0, 1.0, 0.0]


def test_margin_is_the_distance_to_the_edge_of_the_stance_outlines(guarded: Guarded) -> None:
    rng = np.random.default_rng(1)
    outlines = []
    for side, name in enumerate("lr"):
        outlines.append(guarded.places[side, :2] + guarded.robot.soles[name] @ guarded.turns[side][:2, :2].T)
    for stances in (BOTH, LEFT, RIGHT):
        hull = convex_hull(np.concatenate([o for o, carries in zip(outlines, stances, strict=True) if carries]))
        for _ in range(50):
            pose = guarded.leaning(np.array([*rng.uniform(-0.15, 0.15, 2), 0.0]))
            assert guarded.gate.margin(pose, stances) == pytest.approx(polygon_margin(hull, *pose.com[:2]), abs=1e-9)


def test_a_way_back_into_balance_is_let_through(guarded: Guarded) -> None:
    """A pose without margin may follow a worse one, but not a better one."""
    outside = [guarded.leaning(np.array([x, 0.0, 0.0])) for x in (0.10, 0.11)]
    assert guarded.passes(outside[0], outside[1])
    assert not guarded.passes(outside[1], outside[0])


def test_an_overlap_of_the_body_is_refused_but_for_a_way_out(nao: RobotModel) -> None:
    guarded = Guarded(nao)
    roll, names = nao.joint("LShoulderRoll"), ("LShoulderPitch", "LElbowYaw", "LElbowRoll")
    straight = guarded.pose.q.copy()
    straight[[nao.joint(name) for name in names]] = 1.5708, 0.0, -0.0349
    arms = []
    for angle in (0.35, 0.0, -0.05):
        straight[roll] = angle
        arms.append(guarded.maker.hang(straight.copy(), 1, guarded.places, guarded.turns))
    clear, deep, deeper = arms
    assert guarded.passes(clear, clear)
    assert not guarded.passes(deep, clear, dt=10.0)
    assert guarded.passes(deep, deeper, dt=10.0)
    assert not guarded.passes(deeper, deep, dt=10.0)
    assert not guarded.gate.safe(deep)

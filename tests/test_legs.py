"""The torso over planted soles: closure, balance, limits, and the nearest feet."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from naoimitate.balance.leg_solver import solve_legs
from naoimitate.balance.legs import (
    DOWN,
    FREE,
    POSE,
    LegGoal,
    LegLimits,
    Legs,
    LegWeights,
    Stance,
    build_legs,
    free_goal,
    table_bounds,
)
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Reach
from naoimitate.core.geometry import yaw_matrix
from naoimitate.robot.model import RobotModel

CLOSED = 1e-8
"""Sum of m and rad by which a planted sole may be off after a solve."""
STEP = 0.05
"""[rad] of every joint in one solve of these tests."""
STILL = LegWeights()._replace(rest=0.0, still=0.0)


@dataclass
class Body:
    """A robot in double support, its base hung on one sole."""

    robot: RobotModel
    side: int = 1
    weights: LegWeights = field(default_factory=LegWeights)

    def __post_init__(self) -> None:
        self.legs: Legs = build_legs(self.robot, LegLimits())
        self.maker = PoseMaker(self.robot, self.legs)
        self.pose: Pose = self.maker.stand(self.robot.postures["stand"].copy())
        self.soles = self.pose.sole_pos * [1.0, 1.0, 0.0]
        self.rot = np.stack([np.eye(3), np.eye(3)])
        self.no_rows = (np.zeros((0, len(self.legs.joints))), np.zeros(0))

    def centre(self, offset: float) -> np.ndarray:
        """Where the CoM belongs for an offset, (2,) m."""
        left, right = self.maker.centres(self.soles, self.rot)[:, :2]
        return left + offset * (right - left)

    def goal(self, feet: np.ndarray, offset: float) -> LegGoal:
        return free_goal(feet, self.centre(offset), np.ones(2), np.array([1.0 - offset, offset]))

    @property
    def feet(self) -> np.ndarray:
        """Hip to sole in the torso frame, (2, 3) m."""
        return self.pose.soles_in_base - self.legs.hip

    def solve(
        self, goal: LegGoal, kind: int = POSE, min_height: float = 0.0, rows: object = None
    ) -> tuple[int, float, float]:
        """One solve from the present pose; every bound is checked."""
        before, q = self.pose.q, self.pose.q.copy()
        stance = Stance(self.side, self.soles, self.rot, kind, min_height)
        extra = self.no_rows if rows is None else rows
        reach = Reach(1.0, before - STEP, before + STEP, before - STEP, before + STEP)
        found = solve_legs(self.robot.tree, self.legs, self.weights, stance, goal, q, reach, *extra)
        self.pose = self.maker.hang(q, self.side, self.soles, self.rot)
        self._check(q, before)
        return found.iterations, found.closure, found.com_error

    def _check(self, q: np.ndarray, before: np.ndarray) -> None:
        moved = self.legs.variable >= 0
        assert np.array_equal(q[~moved], before[~moved]), "a joint that is none of the legs' moved"
        assert (np.abs(q - before) <= STEP + 1e-9).all()
        assert (q >= np.minimum(self.legs.lower, before) - 1e-9)[moved].all()
        assert (q <= np.maximum(self.legs.upper, before) + 1e-9)[moved].all()
        for leader, follower in self.robot.coupled:
            assert q[leader] == q[follower]
        for table in self.robot.tables:
            if moved[table.y]:
                low, high = table.bounds(q[table.x])
                assert low - 1e-3 <= q[table.y] <= high + 1e-3

    def follow(self, goal: LegGoal, frames: int = 60) -> tuple[float, float]:
        """Some frames towards a goal; the worst closure, and the last CoM error."""
        worst, com_error = 0.0, 0.0
        for _ in range(frames):
            done, closure, com_error = self.solve(goal)
            assert done > 0
            worst = max(worst, closure)
        return worst, com_error


def random_goals(robot: RobotModel, count: int, seed: int) -> list[tuple[np.ndarray, float]]:
    """Feet (2, 3) m and offsets that the robot can take, because it has been there."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        body, offset = Body(robot, weights=STILL), float(rng.uniform(0.0, 1.0))
        size = robot.limb_length["l_leg"]
        shift = rng.uniform(-1.0, 1.0, 3) * [0.1, 0.1, 0.0] * size + [0.0, 0.0, rng.uniform(0.02, 0.15) * size]
        body.follow(body.goal(body.feet + shift, offset), 60)
        _, _, com_error = body.solve(body.goal(body.feet, offset))
        if com_error < 1e-6:
            found.append((body.feet.copy(), offset))
    return found


def test_legs_are_flattened_with_shared_and_bent_joints(robot: RobotModel) -> None:
    legs = build_legs(robot, LegLimits())
    chain = {*robot.chains["l_leg"], *robot.chains["r_leg"]}
    assert len(legs.joints) == len(chain) - len(robot.coupled)
    assert set(np.flatnonzero(legs.variable >= 0)) == chain
    for leader, follower in robot.coupled:
        assert legs.variable[leader] == legs.variable[follower]
    stand = robot.postures["stand"]
    for side in "lr":
        knee = robot.points[f"{side}_knee"].joint
        bend = np.array([legs.lower[knee], legs.upper[knee]]) * np.sign(stand[knee])
        assert bend.min() == pytest.approx(LegLimits().knee_min), "the knee bends, whichever way"
        assert legs.lower[knee] <= stand[knee] <= legs.upper[knee]


@pytest.mark.parametrize("side", [0, 1])
def test_the_base_hangs_exactly_on_the_stance_sole(robot: RobotModel, side: int) -> None:
    rng = np.random.default_rng(0)
    body = Body(robot)
    for _ in range(50):
        q = rng.uniform(robot.lower, robot.upper)
        places = rng.uniform(-1.0, 1.0, (2, 3))
        turns = np.stack([yaw_matrix(a) for a in rng.uniform(-3.0, 3.0, 2)])
        pose = body.maker.hang(q, side, places, turns)
        assert pose.sole_pos[side] == pytest.approx(places[side], abs=1e-12)
        assert pose.sole_rot[side] == pytest.approx(turns[side], abs=1e-12)


@pytest.mark.parametrize("side", [0, 1])
def test_random_feasible_goals_are_reached_with_closed_feet_and_the_com_in_place(robot: RobotModel, side: int) -> None:
    for feet, offset in random_goals(robot, 10, 1):
        body = Body(robot, side, STILL)
        worst, com_error = body.follow(body.goal(feet, offset), 80)
        assert worst < CLOSED
        assert com_error < 1e-5
        assert body.feet == pytest.approx(feet, abs=1e-4)


def test_every_solve_closes_the_feet_whatever_the_goal(robot: RobotModel) -> None:
    """Impossible feet in every direction: each frame's soles are where they were planted."""
    rng = np.random.default_rng(2)
    for _ in range(12):
        body = Body(robot)
        goal = body.goal(body.feet + rng.normal(0.0, 0.3, (2, 3)), float(rng.uniform(0.0, 1.0)))
        for _ in range(30):
            _, closure, _ = body.solve(goal)
            assert closure < CLOSED
            assert body.pose.sole_pos == pytest.approx(body.soles, abs=1e-8)


def test_the_com_comes_before_the_feet(robot: RobotModel) -> None:
    """Feet asked for half a metre away: the CoM stays within its slack."""
    rng = np.random.default_rng(3)
    for _ in range(8):
        body = Body(robot)
        middle = body.goal(body.feet, 0.5)
        body.follow(middle, 20)
        body.follow(body.goal(body.feet + rng.normal(0.0, 0.5, (2, 3)), 0.5), 40)
        along, across = np.abs(body.pose.com[:2] - body.centre(0.5))[::-1]
        assert along <= LegWeights().com_slack + 1e-3
        assert across <= LegWeights().com_slack_across + 1e-3


def test_the_com_goes_over_either_foot(robot: RobotModel) -> None:
    for offset in (0.0, 1.0):
        body = Body(robot)
        for k in range(100):
            body.solve(body.goal(body.feet, 0.5 + min(k / 60.0, 1.0) * (offset - 0.5)))
        assert body.pose.com[:2] == pytest.approx(body.centre(offset), abs=5e-4)


def test_bounds_of_sway_hold(robot: RobotModel) -> None:
    """The torso's way, here: it goes up for lower feet, slowly where it must."""
    body = Body(robot)
    wide = body.goal(body.feet + np.array([0.0, 0.0, 0.05]), 0.5)
    low, high = wide.sway_low.copy(), wide.sway_high.copy()
    low[2:5], high[2:5] = -2e-4, 2e-4
    for _ in range(10):
        before = body.pose
        body.solve(wide._replace(sway_low=low, sway_high=high))
        way = before.base_rot.T @ (body.pose.base_pos - before.base_pos)
        assert np.abs(way).max() <= 2.2e-4
    free = Body(robot)
    free.solve(wide)
    assert np.linalg.norm(free.pose.base_pos - Body(robot).pose.base_pos) > 5e-4


def test_a_body_that_cannot_keep_its_bounds_passes_them_as_little_as_it_must(robot: RobotModel) -> None:
    """A bound of sway that asks for more than the joints give in a frame is no dead end."""
    body = Body(robot)
    goal = body.goal(body.feet, 0.5)
    low, high = goal.sway_low.copy(), goal.sway_high.copy()
    low[4], high[4] = 0.05, 0.06
    done, closure, _ = body.solve(goal._replace(sway_low=low, sway_high=high))
    assert done > 0
    assert closure < 1e-4


def test_a_sole_that_cannot_get_there_leaves_the_legs_unchanged_or_open(robot: RobotModel) -> None:
    """The other sole asked 10 cm away in a frame whose joints move 0.05 rad: said by the closure, never hidden."""
    body = Body(robot)
    body.soles = body.soles.copy()
    body.soles[0] += [0.1, 0.0, 0.0]
    q = body.pose.q
    done, closure, _ = body.solve(body.goal(body.feet, 0.5))
    assert closure > 1e-3
    assert done > 0 or np.array_equal(body.pose.q, q)


def test_extra_rows_are_kept(robot: RobotModel) -> None:
    """A row that forbids a joint to move by more than a milliradian either way."""
    body = Body(robot)
    knee = body.legs.variable[robot.points["l_knee"].joint]
    rows = np.zeros((2, len(body.legs.joints)))
    rows[:, knee] = 1.0, -1.0
    before = body.pose.q.copy()
    body.solve(body.goal(body.feet + np.array([0.0, 0.0, 0.03]), 0.5), rows=(rows, np.array([-1e-3, -1e-3])))
    moved = body.pose.q - before
    assert abs(moved[robot.points["l_knee"].joint]) <= 1e-3 + 1e-9


def test_contradicting_rows_leave_the_legs_unchanged(robot: RobotModel) -> None:
    body = Body(robot)
    rows = np.zeros((2, len(body.legs.joints)))
    rows[:, 0] = 1.0, -1.0
    before = body.pose.q.copy()
    done, _, _ = body.solve(body.goal(body.feet, 0.5), rows=(rows, np.array([1e-3, 1e-3])))
    assert done == 0
    assert np.array_equal(body.pose.q, before)


def test_a_free_sole_swings_to_its_target_and_not_below_its_height(robot: RobotModel) -> None:
    """The left foot 6 cm up; then asked for 10 cm below the floor."""
    body = Body(robot, side=1)
    for k in range(60):
        body.solve(body.goal(body.feet, 0.5 + 0.5 * min(k / 40.0, 1.0)))
    body.weights = STILL
    stance_foot = body.feet[1].copy()
    up = np.array([stance_foot + np.array([0.0, 0.0, 0.06]), stance_foot])
    for height in np.minimum(np.arange(60) * 1e-3, 0.01):
        body.solve(body.goal(up, 1.0), FREE, float(height))
    assert body.feet[0] == pytest.approx(up[0], abs=5e-3)
    down = up - [[0.0, 0.0, 0.16], [0.0, 0.0, 0.0]]
    for _ in range(60):
        body.solve(body.goal(down, 1.0), FREE, 0.01)
        outline = body.pose.sole_pos[0] + body.legs.outline[0] @ body.pose.sole_rot[0][:, :2].T
        assert outline[:, 2].min() >= 0.01 - 2e-4


def lifted(robot: RobotModel, height: float) -> Body:
    """A body on its right sole, the other one level at a height in m, still asked for where it stood."""
    body = Body(robot, side=1)
    for k in range(80):
        body.soles[0][2] = height * min(k / 40.0, 1.0)
        body.solve(body.goal(body.feet, 0.5 + 0.5 * min(k / 40.0, 1.0)))
    body.soles = body.soles.copy()
    body.soles[0][2] -= 1e-3
    return body


def test_a_foot_comes_down_exactly_as_asked_while_the_body_may_move(robot: RobotModel) -> None:
    body = lifted(robot, 0.02)
    _, closure, _ = body.solve(body.goal(body.feet, 1.0), DOWN)
    assert closure < CLOSED
    assert body.pose.sole_pos[0] == pytest.approx(body.soles[0], abs=1e-8)


def test_a_foot_stays_higher_where_the_body_would_have_to_jump(robot: RobotModel) -> None:
    """The leg is stiff and the torso may not move: the foot does not get its millimetre down."""
    body = lifted(robot, 0.02)
    goal, leg = body.goal(body.feet, 1.0), body.legs.variable[list(robot.chains["l_leg"])]
    rows = np.zeros((2 * len(leg), len(body.legs.joints)))
    rows[np.arange(len(leg)), leg], rows[len(leg) + np.arange(len(leg)), leg] = 1.0, -1.0
    stiff = (rows, np.full(2 * len(leg), -2e-5))
    low, high = goal.sway_low.copy(), goal.sway_high.copy()
    low[2:], high[2:] = -2e-5, 2e-5
    before = body.pose
    done, closure, _ = body.solve(goal._replace(sway_low=low, sway_high=high), DOWN, rows=stiff)
    assert done > 0
    assert closure < 2e-5
    assert body.soles[0][2] + 5e-4 < body.pose.sole_pos[0][2] <= before.sole_pos[0][2] + 1e-4
    assert np.linalg.norm(body.pose.base_pos - before.base_pos) < 1e-4


def test_table_bounds_are_those_of_the_coupling_table(nao: RobotModel) -> None:
    rng = np.random.default_rng(4)
    for table in nao.tables:
        for x in rng.uniform(table.rows[0, 0] - 0.3, table.rows[-1, 0] + 0.3, 100):
            low, low_slope, high, high_slope = table_bounds(table.rows, x)
            assert (low, high) == pytest.approx(table.bounds(x))
            d = 1e-7
            inside = table.rows[0, 0] < x - d and x + d < table.rows[-1, 0]
            if inside and np.abs(table.rows[:, 0] - x).min() > 2.0 * d:
                a, b = table_bounds(table.rows, x - d), table_bounds(table.rows, x + d)
                assert (low_slope, high_slope) == pytest.approx(
                    ((b[0] - a[0]) / (2 * d), (b[2] - a[2]) / (2 * d)), abs=1e-5
                )

"""One limb to its target: the paper's iterations and ours, on the arms and legs of both robots."""

from __future__ import annotations

import numpy as np
import pytest

from naoimitate.limb import Limb, LimbWeights, build_limb, solve_limb, solve_limb_fixed
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

RESERVE = 0.002
TIP_ONLY = LimbWeights(bend=0.0, rest=0.0)
PAPER_DAMPING, PAPER_ITERATIONS = 0.3, 30
FRAME = 0.05
"""[rad] that a joint may move in one frame of these tests."""


def place(robot: RobotModel, limb: Limb, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tip from the root (3,) m, direction to the bend (3,), and rotation of the tip's link (3, 3), base frame."""
    n = len(q)
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    forward(robot.tree, q, pos, rot)
    tip = pos[limb.tip_joint + 1] + rot[limb.tip_joint + 1] @ limb.tip - limb.root
    bend = pos[limb.bend_joint + 1] + rot[limb.bend_joint + 1] @ limb.bend - limb.root
    return tip, bend / np.linalg.norm(bend), rot[limb.tip_joint + 1].copy()


def unit(v: np.ndarray) -> np.ndarray:
    """A direction."""
    return np.asarray(v / np.linalg.norm(v))


def follow(
    robot: RobotModel,
    limb: Limb,
    q: np.ndarray,
    target: np.ndarray,
    settings: LimbWeights = TIP_ONLY,
    bend: np.ndarray | None = None,
    tip: tuple[np.ndarray, int] = (np.eye(3), 0),
    frames: int = 60,
    rows: tuple[np.ndarray, np.ndarray] | None = None,
) -> float:
    """Some frames of ``solve_limb`` on q, which is written; every bound is checked. Returns the tip's error in m."""
    wanted = np.zeros(3) if bend is None else bend
    extra = (np.zeros((0, len(limb.joints))), np.zeros(0)) if rows is None else rows
    others = np.setdiff1d(np.arange(len(q)), limb.joints)
    for _ in range(frames):
        before = q.copy()
        low, high = q - FRAME, q + FRAME
        iterations, _ = solve_limb(robot.tree, limb, settings, target, wanted, *tip, q, low, high, *extra)
        assert 0 <= iterations <= settings.iterations
        assert np.isfinite(q).all() and np.array_equal(q[others], before[others])
        assert (np.abs(q - before) <= FRAME + 1e-9).all()
        assert (q[limb.joints] >= limb.lower - 1e-9).all() and (q[limb.joints] <= limb.upper + 1e-9).all()
    return float(np.linalg.norm(place(robot, limb, q)[0] - target))


def random_poses(robot: RobotModel, limb: Limb, count: int, seed: int) -> list[np.ndarray]:
    """Standing postures (J,) with this limb anywhere inside its limits."""
    rng, poses = np.random.default_rng(seed), []
    for _ in range(count):
        q = robot.postures["stand"].copy()
        q[limb.joints] = rng.uniform(limb.lower + 0.02, limb.upper - 0.02)
        poses.append(q)
    return poses


def beside(limb: Limb, pose: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A start 0.2 rad around a pose in every joint."""
    q = pose.copy()
    q[limb.joints] = np.clip(q[limb.joints] + rng.uniform(-0.2, 0.2, len(limb.joints)), limb.lower, limb.upper)
    return q


@pytest.mark.parametrize("name", ["l_arm", "r_arm", "l_leg"])
def test_reachable_targets_are_reached_within_a_tenth_of_a_millimetre(robot: RobotModel, name: str) -> None:
    limb, rng = build_limb(robot, name, RESERVE), np.random.default_rng(1)
    for pose in random_poses(robot, limb, 120, 0):
        target = place(robot, limb, pose)[0]
        assert follow(robot, limb, beside(limb, pose, rng), target, frames=150) < 1e-4


@pytest.mark.parametrize("name", ["l_arm", "r_arm"])
def test_elbow_and_rest_never_cost_the_hand_half_a_millimetre(robot: RobotModel, name: str) -> None:
    """Joint limits included: half of the poses are at one, and the elbow is asked for something else."""
    limb, rng = build_limb(robot, name, RESERVE), np.random.default_rng(2)
    for pose in random_poses(robot, limb, 200, 3):
        if rng.random() < 0.5:
            k = rng.integers(len(limb.joints))
            pose[limb.joints[k]] = (limb.lower if rng.random() < 0.5 else limb.upper)[k]
        bend = unit(rng.normal(size=3))
        target, start = place(robot, limb, pose)[0], beside(limb, pose, rng)
        alone = follow(robot, limb, start.copy(), target)
        assert follow(robot, limb, start, target, LimbWeights(), bend) < max(alone + 1e-6, 5e-4)


def test_a_joint_at_its_end_costs_the_elbow_not_the_hand(robot: RobotModel) -> None:
    """The hand moves alike with and without an elbow to follow, in every single frame, bounds active or not."""
    limb, rng = build_limb(robot, "l_arm", RESERVE), np.random.default_rng(11)
    for pose in random_poses(robot, limb, 60, 12):
        start, target = beside(limb, pose, rng), place(robot, limb, pose)[0]
        errors = []
        for settings, bend in ((TIP_ONLY, None), (LimbWeights(), unit(rng.normal(size=3)))):
            errors.append(follow(robot, limb, start.copy(), target, settings, bend, frames=1))
        assert errors[1] <= errors[0] + 5e-4


@pytest.mark.parametrize("name", ["l_arm", "r_arm"])
@pytest.mark.parametrize("beyond", [1.02, 1.3, 2.0])
def test_limb_comes_near_a_target_out_of_reach_and_rests(robot: RobotModel, name: str, beyond: float) -> None:
    """Stretched, the Jacobian is singular: steps stay bounded (see ``follow``), and the arm does not swing about."""
    limb, rng = build_limb(robot, name, RESERVE), np.random.default_rng(3)
    for pose in random_poses(robot, limb, 25, 4):
        direction = place(robot, limb, pose)[0]
        target = direction * (beyond * robot.limb_length[name] / np.linalg.norm(direction))
        q = beside(limb, pose, rng)
        first = np.linalg.norm(place(robot, limb, q)[0] - target)
        assert follow(robot, limb, q, target, LimbWeights(), frames=150) <= first
        before = q.copy()
        follow(robot, limb, q, target, LimbWeights(), frames=1)
        assert np.abs(q - before).max() < 0.01, "the arm swings about at the singularity"


def test_stretched_arm_takes_small_steps_for_a_millimetre(robot: RobotModel) -> None:
    """Along a straight arm no joint moves the hand to first order: the step must not grow for it."""
    limb = build_limb(robot, "l_arm", RESERVE)
    q = robot.postures["calibration"].copy()
    q[limb.joints] = np.clip(q[limb.joints], limb.lower, limb.upper)
    tip = place(robot, limb, q)[0]
    follow(robot, limb, q, tip, LimbWeights(), frames=60)
    start = q.copy()
    follow(robot, limb, q, tip * (1.0 + 1e-3 / np.linalg.norm(tip)), LimbWeights(), frames=1)
    assert np.abs(q - start).max() < 0.035


def test_elbow_goes_where_the_person_has_it(nao: RobotModel) -> None:
    """The five joints of the arm leave one free: the elbow's circle about the line from shoulder to hand."""
    limb, rng = build_limb(nao, "l_arm", RESERVE), np.random.default_rng(5)
    soft = LimbWeights()._replace(rest=0.001)
    without, towards, softly = [], [], []
    for pose in random_poses(nao, limb, 40, 6):
        target, bend, _ = place(nao, limb, pose)
        for errors, settings, wanted in ((without, soft, None), (towards, LimbWeights(), bend), (softly, soft, bend)):
            q = beside(limb, pose, rng)
            follow(nao, limb, q, target, settings, wanted)
            errors.append(np.arccos(np.clip(place(nao, limb, q)[1] @ bend, -1.0, 1.0)))
    assert np.median(softly) < 0.02
    assert np.median(towards) < np.median(without)


def test_hand_orientation_is_followed_where_the_wrist_can(nao: RobotModel) -> None:
    limb, rng = build_limb(nao, "l_arm", RESERVE), np.random.default_rng(7)
    angles = {0: [], 2: [], 3: []}
    for pose in random_poses(nao, limb, 30, 8):
        target, _, wanted = place(nao, limb, pose)
        for rows, found in angles.items():
            q = beside(limb, pose, rng)
            error = follow(nao, limb, q, target, LimbWeights(), None, (wanted, rows))
            assert error < 0.02
            turned = place(nao, limb, q)[2]
            cosine = turned[:, 2] @ wanted[:, 2] if rows == 2 else (np.trace(turned @ wanted.T) - 1.0) / 2.0
            found.append(np.arccos(np.clip(cosine, -1.0, 1.0)))
    assert np.median(angles[3]) < 0.25 * np.median(angles[0])
    assert np.median(angles[2]) < 0.25 * np.median(angles[0])


def test_extra_rows_hold_the_limb_back(robot: RobotModel) -> None:
    limb = build_limb(robot, "r_arm", RESERVE)
    row, bound = np.zeros((1, len(limb.joints))), np.array([-1e-3])
    row[0, 1] = 1.0
    start = robot.postures["stand"].copy()
    target = place(robot, limb, start)[0] + [0.05, 0.05, 0.05]
    for sign in (1.0, -1.0):
        q = start.copy()
        follow(robot, limb, q, target, LimbWeights(), frames=1, rows=(sign * row, bound))
        assert sign * (q - start)[limb.joints[1]] >= -1e-3 - 1e-9


def test_contradicting_rows_leave_the_limb_where_it_is(robot: RobotModel) -> None:
    limb = build_limb(robot, "l_arm", RESERVE)
    rows = np.zeros((2, len(limb.joints)))
    rows[:, 0] = 1.0, -1.0
    q = robot.postures["stand"].copy()
    target = place(robot, limb, q)[0] + [0.05, 0.0, 0.0]
    follow(robot, limb, q, target, LimbWeights(), frames=1, rows=(rows, np.array([1e-3, 1e-3])))
    assert np.array_equal(q, robot.postures["stand"])


def test_a_joint_outside_its_reserve_comes_back_without_a_contradiction(robot: RobotModel) -> None:
    """Data may put a posture at the very limit; the reserve must not make the frame infeasible."""
    limb = build_limb(robot, "l_arm", 0.05)
    q = robot.postures["stand"].copy()
    j = limb.joints[-1]
    q[j] = robot.upper[j]
    target = place(robot, limb, q)[0]
    low, high = q - 0.01, q + 0.01
    no_rows = (np.zeros((0, len(limb.joints))), np.zeros(0))
    done, _ = solve_limb(robot.tree, limb, LimbWeights(), target, np.zeros(3), np.eye(3), 0, q, low, high, *no_rows)
    assert done > 0
    assert q[j] < robot.upper[j]


@pytest.mark.parametrize("name", ["l_arm", "r_arm", "l_leg", "r_leg"])
def test_the_papers_iterations_approach_within_the_limits(robot: RobotModel, name: str) -> None:
    limb, rng = build_limb(robot, name, 0.0), np.random.default_rng(9)
    for pose in random_poses(robot, limb, 60, 10):
        target = place(robot, limb, pose)[0]
        q = beside(limb, pose, rng)
        first = np.linalg.norm(place(robot, limb, q)[0] - target)
        error = solve_limb_fixed(robot.tree, limb, target, q, PAPER_DAMPING, PAPER_ITERATIONS)
        assert error == pytest.approx(np.linalg.norm(place(robot, limb, q)[0] - target))
        assert (q[limb.joints] >= limb.lower).all() and (q[limb.joints] <= limb.upper).all()
        assert error <= first + 1e-9


def test_one_of_the_papers_steps_by_hand(nao: RobotModel) -> None:
    """dq = J^T (J J^T + 0.09 E)^-1 e with unit weights: the first step has no previous one."""
    limb = build_limb(nao, "l_arm", 0.0)
    q = nao.postures["stand"].copy()
    tip, d = place(nao, limb, q)[0], 1e-6
    J = np.empty((3, len(limb.joints)))
    for i, j in enumerate(limb.joints):
        for sign in (1.0, -1.0):
            moved = q.copy()
            moved[j] += sign * d
            J[:, i] = (J[:, i] if sign < 0 else 0.0) + sign * place(nao, limb, moved)[0] / (2.0 * d)
    error = np.array([0.02, -0.01, 0.03])
    expected = J.T @ np.linalg.solve(J @ J.T + 0.09 * np.eye(3), error)
    before = q.copy()
    solve_limb_fixed(nao.tree, limb, tip + error, q, PAPER_DAMPING, 1)
    assert (q - before)[limb.joints] == pytest.approx(expected, abs=1e-6)


def test_a_limb_knows_its_measures(robot: RobotModel) -> None:
    """Mirror images of each other, with the reserve taken from both limits."""
    for kind in ("arm", "leg"):
        left, right = (build_limb(robot, f"{s}_{kind}", 0.1) for s in "lr")
        assert left.root == pytest.approx(right.root * [1.0, -1.0, 1.0], abs=1e-4)
        assert left.upper_length == pytest.approx(right.upper_length, abs=1e-4)
        for limb in (left, right):
            assert limb.lower == pytest.approx(robot.lower[limb.joints] + 0.1)
            assert limb.upper == pytest.approx(robot.upper[limb.joints] - 0.1)

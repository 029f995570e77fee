"""The head looks at a hand of the robot wherever its neck can, and as near as it can elsewhere; within every limit."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from judge import imitate, stream

from naoimitate.arms import Arms
from naoimitate.cli import run as command
from naoimitate.core.errors import RobotModelError, StreamError
from naoimitate.gaze import HANDS, TURN_BACK, Gaze, build_gaze
from naoimitate.limb import LimbWeights
from naoimitate.live.setup import Setup
from naoimitate.robot.model import RobotModel
from naoimitate.run.replay import place, replay
from naoimitate.settings import Settings

RESERVE = 0.002
TOLERANCE = math.radians(2.0)
HEADS = sorted(HANDS)
SHARES = st.lists(st.floats(0.0, 1.0), min_size=12, max_size=12)


def posture(robot: RobotModel, shares: list[float]) -> np.ndarray:
    """Stand, the arms at shares of their ranges."""
    q = robot.postures["stand"].copy()
    arms = [*robot.chains["l_arm"], *robot.chains["r_arm"]]
    for joint, share in zip(arms, shares, strict=False):
        q[joint] = robot.lower[joint] + share * (robot.upper[joint] - robot.lower[joint])
    return q


def allowed(robot: RobotModel, q: np.ndarray, reserve: float = RESERVE - 1e-9) -> bool:
    """Whether the head keeps to its limits and to its coupling table."""
    head = list(robot.chains["head"])
    inside = (q[head] >= robot.lower[head] + reserve).all() and (q[head] <= robot.upper[head] - reserve).all()
    for table in robot.tables:
        if table.y in head:
            low, high = table.bounds(q[table.x])
            inside &= low + reserve <= q[table.y] <= high - reserve
    return bool(inside)


def views(robot: RobotModel, count: int = 41) -> tuple[np.ndarray, np.ndarray]:
    """Places (N, 3) m of the eye and its axes (N, 3), in the base frame, for the allowed directions on a grid of two
    head joints; the arms do not matter."""
    gaze, head = Gaze(robot, "l_hand", RESERVE), list(robot.chains["head"])
    axes = [np.linspace(robot.lower[j] + RESERVE, robot.upper[j] - RESERVE, count) for j in head]
    q = np.tile(robot.postures["stand"], (count**2, 1))
    q[:, head] = list(product(*axes))
    q = q[[allowed(robot, row) for row in q]]
    still = replay(robot, q, np.zeros((len(q), 3)), np.tile([1.0, 0.0, 0.0, 0.0], (len(q), 1)))
    pos, rot = still.links_pos[:, gaze._eye + 1], still.links_rot[:, gaze._eye + 1]
    return pos + rot @ gaze.at, rot @ gaze.axis


@pytest.fixture(scope="module")
def seen(robot: RobotModel) -> tuple[np.ndarray, np.ndarray]:
    return views(robot)


def nearest(robot: RobotModel, seen: tuple[np.ndarray, np.ndarray], q: np.ndarray, hand: str) -> float:
    """Smallest angle (rad) between an axis that is allowed and the direction to the hand."""
    still = replay(robot, q[None], np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]))
    there, axes = place(robot, still, hand) - seen[0], seen[1]
    return float(np.arctan2(np.linalg.norm(np.cross(axes, there), axis=1), np.sum(axes * there, axis=1)).min())


def looked(robot: RobotModel, gaze: Gaze, q: np.ndarray) -> np.ndarray:
    """The posture with the head where the gaze wants it."""
    q = q.copy()
    q[list(robot.chains["head"])] = gaze.angles(q)
    return q


@settings(max_examples=100, deadline=None)
@given(shares=SHARES, head=st.sampled_from(HEADS))
def test_no_allowed_direction_is_nearer_to_the_hand(
    robot: RobotModel, seen: tuple[np.ndarray, np.ndarray], shares: list[float], head: str
) -> None:
    gaze = Gaze(robot, HANDS[head], RESERVE)
    q = looked(robot, gaze, posture(robot, shares))
    assert np.isfinite(q).all() and allowed(robot, q)
    assert gaze.miss(q) <= nearest(robot, seen, q, HANDS[head]) + TURN_BACK + math.radians(0.2)


@settings(max_examples=200, deadline=None)
@given(shares=SHARES, head=st.sampled_from(HEADS))
def test_a_hand_that_can_be_looked_at_is_on_the_axis(robot: RobotModel, shares: list[float], head: str) -> None:
    """Wherever the head ends inside its range, nothing kept it from looking straight at the hand."""
    gaze = Gaze(robot, HANDS[head], RESERVE)
    q = looked(robot, gaze, posture(robot, shares))
    assert np.isfinite(q).all() and allowed(robot, q)
    assert gaze.miss(q) < TOLERANCE or not allowed(robot, q, RESERVE + 1e-4)


@settings(max_examples=50, deadline=None)
@given(shares=SHARES, before=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2), head=st.sampled_from(HEADS))
def test_the_head_turns_no_faster_than_it_may(
    robot: RobotModel, shares: list[float], before: list[float], head: str
) -> None:
    """From anywhere in its range, by the limit of the task and by that of the frame; it arrives, table and all."""
    gaze, step = Gaze(robot, HANDS[head], RESERVE), 0.05
    arms, joints = Arms(robot, LimbWeights(), RESERVE, "free", None, gaze), list(robot.chains["head"])
    q = posture(robot, shares)
    q[joints[0]] = robot.lower[joints[0]] + before[0] * (robot.upper - robot.lower)[joints[0]]
    for k in range(160):
        share, last = 0.5 if k % 2 else 2.0, q.copy()
        arms.head(q, (9.0, 9.0), step, q - share * step, q + share * step)
        assert np.abs(q - last).max() <= min(1.0, share) * step + 1e-12
    assert q[joints] == pytest.approx(gaze.angles(q), abs=1e-3) and allowed(robot, q)


def test_both_hands_can_be_looked_at_in_front(robot: RobotModel) -> None:
    """Something is looked at: of random postures, a good part."""
    rng = np.random.default_rng(0)
    for head in HEADS:
        gaze = Gaze(robot, HANDS[head], RESERVE)
        misses = [gaze.miss(looked(robot, gaze, posture(robot, list(rng.random(12))))) for _ in range(200)]
        assert np.mean(np.array(misses) < 1e-3) > 0.2


def test_the_axis_is_that_of_the_first_camera_and_without_one_that_of_the_head(nao: RobotModel) -> None:
    front = nao.postures["stand"]
    blind = replace(nao, data={key: value for key, value in nao.data.items() if key != "cameras"})
    gaze, other = Gaze(nao, "l_hand", RESERVE), Gaze(blind, "l_hand", RESERVE)
    assert gaze.at == pytest.approx([0.05871, 0.0, 0.06364]) and math.asin(-gaze.axis[2]) == pytest.approx(0.020944)
    assert other.axis == pytest.approx([1.0, 0.0, 0.0]) and np.isfinite(other.angles(front)).all()
    lost = replace(nao, data={**nao.data, "cameras": {"top": {"link": "none"}}})
    with pytest.raises(RobotModelError, match="none"):
        Gaze(lost, "l_hand", RESERVE)


def test_a_robot_without_a_neck_does_nothing(nao: RobotModel) -> None:
    stiff = replace(nao, chains={name: chain for name, chain in nao.chains.items() if name != "head"})
    gaze, q = Gaze(stiff, "l_hand", RESERVE), stiff.postures["stand"].copy()
    assert gaze.angles(q).shape == (0,)
    Arms(stiff, LimbWeights(), RESERVE, "free", None, gaze).head(q, (1.0, 1.0), 1.0, q - 1.0, q + 1.0)
    assert np.array_equal(q, stiff.postures["stand"])


@pytest.mark.parametrize("head", HEADS)
def test_an_imitating_robot_looks_at_its_hand(robot: RobotModel, head: str) -> None:
    """The right hand waves; every command is judged. A head that has caught up is on it or where its range ends."""
    choice = Settings(head=head)
    judge = imitate(robot, stream("wave", 50.0, 1.0, 5.0), choice)
    gaze, reserve, joints = Gaze(robot, HANDS[head], RESERVE), choice.legs.range_reserve, list(robot.chains["head"])
    before, turn = judge.commands[0], 0.0
    for now in judge.commands[1:]:
        step = np.abs(now.q - before.q)[joints].max()
        assert step <= choice.limits.head_speed * (now.time - before.time) + 1e-9
        turn, before = turn + step, now
        if now.time > 1.0:
            assert gaze.miss(now.q) < TOLERANCE or not allowed(robot, now.q, reserve + 1e-4)
    assert turn > 0.05 or head == "left-hand"


def test_a_head_follows_the_person_unless_told_otherwise(nao: RobotModel) -> None:
    assert Settings().head == "follow" and build_gaze(nao, "follow", RESERVE) is None


def test_a_recording_keeps_what_the_head_looked_at(nao: RobotModel) -> None:
    kept = Setup.of(Setup(head="left-hand").header())
    assert kept.head == "left-hand" and Setup.of({}).head == "follow"
    assert kept.session(nao) is not None
    with pytest.raises(StreamError, match="record it anew"):
        Setup.of({"head": "foot"})


@pytest.mark.parametrize(
    "arguments",
    [
        ["imitate", "builtin:wave", "--out", "run.npz"],
        ["live", "--source", "replay:builtin:wave", "--driver", "none"],
    ],
)
def test_an_unknown_choice_of_the_head_is_a_mistake(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert command([*arguments, "--head", "foot"]) == 2
    assert "foot" in capsys.readouterr().err

"""Distances between shapes agree with coal on thousands of random pairs, and what is known of the robots' bodies."""

from __future__ import annotations

import time

import coal
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.collision import BOX, CAPSULE, ShapeArrays, distances, lowest_points, shape_arrays
from naoimitate.robot import RobotModel
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import Array

ORACLE_TOLERANCE = 2e-6
"""m; coal iterates to about 1e-6, ours is exact to rounding."""
KINDS = [(CAPSULE, CAPSULE), (CAPSULE, BOX), (BOX, CAPSULE), (BOX, BOX)]


def rotations(rng: np.random.Generator, count: int) -> Array:
    turned, triangle = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    turned = turned * np.sign(np.diagonal(triangle, axis1=1, axis2=2))[:, None, :]
    turned[np.linalg.det(turned) < 0.0] *= -1.0
    return np.asarray(turned)


def random_shapes(rng: np.random.Generator, kinds: tuple[int, int], count: int) -> tuple[ShapeArrays, Array, Array]:
    """2 count shapes, each on its own link: alternately of the two kinds; a fifth of the capsules are spheres."""
    total = 2 * count
    kind = np.array(kinds * count, dtype=np.int64)
    box = (kind == BOX)[:, None]
    p0 = rng.uniform(-0.05, 0.05, (total, 3))
    along = rng.uniform(-0.1, 0.1, (total, 3)) * (rng.random((total, 1)) > 0.2)
    p1 = np.where(box, p0, p0 + along)
    half = np.where(box, rng.uniform(0.01, 0.08, (total, 3)), 0.0)
    radius = np.where(box[:, 0], 0.0, rng.uniform(0.005, 0.05, total))
    bound = 0.5 * np.linalg.norm(p1 - p0, axis=1) + radius + np.linalg.norm(half, axis=1)
    shapes = ShapeArrays(np.arange(total), kind, p0, p1, radius, half, 0.5 * (p0 + p1), bound)
    return shapes, rng.uniform(-0.08, 0.08, (total, 3)), rotations(rng, total)


class Found:
    """Distances of pairs of shapes, computed by ``distances``."""

    def __init__(self, shapes: ShapeArrays, pairs: Array, pos: Array, rot: Array, reach: float = np.inf) -> None:
        count = len(pairs)
        self.d = np.full(count, np.nan)
        self.a, self.b, self.normal = (np.full((count, 3), np.nan) for _ in range(3))
        distances(shapes, pairs, pos, rot, reach, self.d, self.a, self.b, self.normal)


def pairs_of(count: int) -> Array:
    return np.arange(2 * count, dtype=np.int64).reshape(count, 2)


def oracle(shapes: ShapeArrays, i: int, pos: Array, rot: Array) -> tuple[coal.ShapeBase, coal.Transform3s]:
    """Shape i in coal, with its place."""
    turn, p0, p1 = rot[shapes.link[i]], shapes.p0[i], shapes.p1[i]
    centre = pos[shapes.link[i]] + turn @ (0.5 * (p0 + p1))
    if shapes.kind[i] == BOX:
        return coal.Box(*(2.0 * shapes.half[i])), coal.Transform3s(turn, centre)
    length = float(np.linalg.norm(p1 - p0))
    if length == 0.0:
        return coal.Sphere(shapes.radius[i]), coal.Transform3s(turn, centre)
    z = (p1 - p0) / length
    x = np.cross(z, [1.0, 0.0, 0.0] if abs(z[0]) < 0.7 else [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    return coal.Capsule(shapes.radius[i], length), coal.Transform3s(
        turn @ np.column_stack((x, np.cross(z, x), z)), centre
    )


@pytest.mark.parametrize("kinds", KINDS)
def test_signed_distance_equals_coals(kinds: tuple[int, int]) -> None:
    count = 2000
    shapes, pos, rot = random_shapes(np.random.default_rng(7), kinds, count)
    found = Found(shapes, pairs_of(count), pos, rot)
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    expected = np.empty(count)
    for p, (i, j) in enumerate(pairs_of(count)):
        result.clear()
        expected[p] = coal.distance(*oracle(shapes, i, pos, rot), *oracle(shapes, j, pos, rot), request, result)
    assert 300 < np.sum(expected < 0.0) < count - 300
    np.testing.assert_allclose(found.d, expected, atol=ORACLE_TOLERANCE)


@pytest.mark.parametrize("kinds", KINDS)
def test_points_and_normal_span_the_distance_and_lie_on_the_shapes(kinds: tuple[int, int]) -> None:
    count = 2000
    shapes, pos, rot = random_shapes(np.random.default_rng(8), kinds, count)
    found = Found(shapes, pairs_of(count), pos, rot)
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(found.b - found.a, found.d[:, None] * found.normal, atol=1e-12)
    for points, column in ((found.a, 0), (found.b, 1)):
        for point, i in zip(points, pairs_of(count)[:, column], strict=True):
            assert abs(depth_of(point, shapes, i, pos, rot)) < 1e-8


def depth_of(point: Array, shapes: ShapeArrays, i: int, pos: Array, rot: Array) -> float:
    """Signed distance of a point from the surface of shape i, computed plainly."""
    local = rot[i].T @ (point - pos[i])
    if shapes.kind[i] == BOX:
        excess = np.abs(local - shapes.p0[i]) - shapes.half[i]
        return float(np.linalg.norm(np.maximum(excess, 0.0)) + min(excess.max(), 0.0))
    along = shapes.p1[i] - shapes.p0[i]
    length = along @ along
    s = 0.0 if length == 0.0 else np.clip((local - shapes.p0[i]) @ along / length, 0.0, 1.0)
    return float(np.linalg.norm(local - shapes.p0[i] - s * along) - shapes.radius[i])


@pytest.mark.parametrize("kinds", KINDS)
def test_moving_a_body_by_the_distance_along_the_normal_makes_them_touch(kinds: tuple[int, int]) -> None:
    count = 1000
    shapes, pos, rot = random_shapes(np.random.default_rng(9), kinds, count)
    found = Found(shapes, pairs_of(count), pos, rot)
    moved = pos.copy()
    moved[1::2] -= found.d[:, None] * found.normal
    assert np.abs(Found(shapes, pairs_of(count), moved, rot).d).max() < 1e-8


@given(seed=st.integers(0, 2**32 - 1), kinds=st.sampled_from(KINDS), step=st.floats(1e-7, 1e-3))
@settings(max_examples=200, deadline=None)
def test_distance_changes_no_faster_than_the_bodies_move(seed: int, kinds: tuple[int, int], step: float) -> None:
    rng = np.random.default_rng(seed)
    shapes, pos, rot = random_shapes(rng, kinds, 20)
    before = Found(shapes, pairs_of(20), pos, rot).d
    direction = rng.normal(size=3)
    pos[1::2] += step * direction / np.linalg.norm(direction)
    assert np.abs(Found(shapes, pairs_of(20), pos, rot).d - before).max() <= step + 1e-8


@pytest.mark.parametrize("kinds", KINDS)
def test_exchanging_the_two_shapes_only_turns_the_normal(kinds: tuple[int, int]) -> None:
    shapes, pos, rot = random_shapes(np.random.default_rng(10), kinds, 500)
    one, other = Found(shapes, pairs_of(500), pos, rot), Found(shapes, pairs_of(500)[:, ::-1].copy(), pos, rot)
    np.testing.assert_allclose(one.d, other.d, atol=1e-9)


def aligned(kinds: tuple[int, int], offset: Array, half: float = 0.03) -> Found:
    """Two shapes with parallel axes and a given offset: capsules along x, or cubes."""
    along = np.array([0.05, 0.0, 0.0])
    box = np.array(kinds) == BOX
    p0 = np.where(box[:, None], 0.0, -along)
    sizes = np.where(box[:, None], half, 0.0) * np.ones((2, 3))
    radius = np.where(box, 0.0, 0.02)
    shapes = ShapeArrays(np.arange(2), np.array(kinds), p0, -p0, radius, sizes, np.zeros((2, 3)), np.ones(2))
    return Found(shapes, pairs_of(1), np.array([np.zeros(3), offset]), np.tile(np.eye(3), (2, 1, 1)))


@pytest.mark.parametrize(
    ("kinds", "offset", "expected"),
    [
        ((CAPSULE, CAPSULE), [0.0, 0.05, 0.0], 0.01),
        ((CAPSULE, CAPSULE), [0.0, 0.0, 0.0], -0.04),
        ((CAPSULE, CAPSULE), [0.2, 0.0, 0.0], 0.06),
        ((CAPSULE, BOX), [0.0, 0.0, 0.06], 0.01),
        ((CAPSULE, BOX), [0.0, 0.0, 0.0], -0.05),
        ((BOX, BOX), [0.07, 0.0, 0.0], 0.01),
        ((BOX, BOX), [0.05, 0.0, 0.0], -0.01),
        ((BOX, BOX), [0.0, 0.0, 0.0], -0.06),
        ((BOX, BOX), [0.09, 0.1, 0.0], 0.05),
    ],
)
def test_parallel_and_concentric_shapes_are_no_special_case(
    kinds: tuple[int, int], offset: list[float], expected: float
) -> None:
    found = aligned(kinds, np.array(offset))
    assert found.d[0] == pytest.approx(expected, abs=1e-9)
    np.testing.assert_allclose(found.b - found.a, found.d[:, None] * found.normal, atol=1e-9)
    assert np.linalg.norm(found.normal[0]) == pytest.approx(1.0)


class Body:
    """A robot in a posture, with its shapes."""

    def __init__(self, robot: RobotModel, q: Array) -> None:
        count = len(robot.joint_names) + 1
        self.robot, self.shapes = robot, shape_arrays(robot)
        self.pos, self.rot = np.empty((count, 3)), np.empty((count, 3, 3))
        forward(robot.tree, q, self.pos, self.rot)

    def found(self, reach: float = np.inf) -> Found:
        return Found(self.shapes, self.robot.pairs, self.pos, self.rot, reach)

    def overlaps(self, margin: float = 0.0) -> dict[frozenset[str], float]:
        names = [shape.name for shape in self.robot.shapes]
        found = self.found()
        pairs = zip(self.robot.pairs, found.d, strict=True)
        return {frozenset((names[i], names[j])): float(d) for (i, j), d in pairs if d < margin}


def test_pairs_beyond_reach_are_infinite_and_all_nearer_ones_are_found(robot: RobotModel) -> None:
    rng = np.random.default_rng(11)
    for _ in range(300):
        body = Body(robot, rng.uniform(robot.lower, robot.upper))
        everything, near = body.found(), body.found(0.03)
        finite = np.isfinite(near.d)
        assert np.all(everything.d[~finite] > 0.03)
        assert np.array_equal(near.d[finite], everything.d[finite])
        assert np.isnan(near.a[~finite]).all() and np.isfinite(near.normal[finite]).all()


@pytest.mark.parametrize("name", ["stand", "calibration"])
def test_the_stances_are_clear_of_the_body(robot: RobotModel, name: str) -> None:
    assert Body(robot, robot.postures[name]).overlaps(margin=0.005) == {}


def test_arms_hanging_straight_down_overlap_the_thighs(nao: RobotModel) -> None:
    overlaps = Body(nao, nao.postures["arms_down"]).overlaps()
    assert set(overlaps) == {frozenset(("l_hand", "l_thigh")), frozenset(("r_hand", "r_thigh"))}
    assert all(d == pytest.approx(-0.0049, abs=2e-4) for d in overlaps.values())


def test_the_wider_the_legs_the_deeper_the_hanging_hand_is_in_the_thigh(nao: RobotModel) -> None:
    q, depths = nao.postures["arms_down"].copy(), []
    q[nao.joint("LElbowRoll")] = nao.upper[nao.joint("LElbowRoll")]
    for hip_roll in np.linspace(0.0, 0.3, 7):
        q[nao.joint("LHipRoll")] = hip_roll
        depths.append(-Body(nao, q).overlaps()[frozenset(("l_hand", "l_thigh"))])
    assert np.all(np.diff(depths) > 0.0)
    assert depths[0] > 0.005 and depths[-1] < 0.026


def test_crouch_brings_the_foot_boxes_into_contact(nao: RobotModel) -> None:
    assert set(Body(nao, nao.postures["Crouch"]).overlaps()) == {frozenset(("l_foot", "r_foot"))}


def test_feet_apart_by_the_hip_width_keep_twenty_three_millimetres(nao: RobotModel) -> None:
    body = Body(nao, nao.postures["zero"])
    clearance = body.overlaps(margin=0.05)[frozenset(("l_foot", "r_foot"))]
    assert clearance == pytest.approx(0.1 + 2.0 * (0.0056 - 0.044), abs=1e-9)


def test_lowest_points_lie_on_the_shapes_and_nothing_is_below_them(robot: RobotModel) -> None:
    rng = np.random.default_rng(12)
    for _ in range(100):
        body = Body(robot, rng.uniform(robot.lower, robot.upper))
        base_pos, base_rot = rng.uniform(-1.0, 1.0, 3), rotations(rng, 1)[0]
        out = np.full((len(robot.shapes), 3), np.nan)
        lowest_points(body.shapes, body.pos, body.rot, base_pos, base_rot, out)
        for i, shape in enumerate(robot.shapes):
            turn = base_rot @ body.rot[shape.joint + 1]
            place = base_pos + base_rot @ body.pos[shape.joint + 1]
            down = turn.T @ [0.0, 0.0, -1.0]
            ends = np.array([shape.p0, shape.p1]) + shape.radius * down + np.sign(down) * shape.half
            expected = place + turn @ ends[np.argmax(ends @ down)]
            np.testing.assert_allclose(out[i], expected, atol=1e-12)


def test_a_standing_robot_touches_the_floor_with_its_foot_boxes_only(nao: RobotModel) -> None:
    body = Body(nao, nao.postures["stand"])
    sole = nao.points["l_sole"]
    height = -(body.pos[sole.joint + 1] + body.rot[sole.joint + 1] @ sole.offset)[2]
    out = np.empty((len(nao.shapes), 3))
    lowest_points(body.shapes, body.pos, body.rot, np.array([0.0, 0.0, height]), np.eye(3), out)
    low = {shape.name for shape, z in zip(nao.shapes, out[:, 2], strict=True) if z < 0.01}
    assert low == {"l_foot", "r_foot"} and np.abs(out[:, 2]).min() < 1e-9


def test_all_pairs_cost_some_microseconds(nao: RobotModel) -> None:
    body = Body(nao, nao.postures["stand"])
    count = len(nao.pairs)
    d, a, b, n = np.empty(count), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    best = np.inf
    for _ in range(20):
        start = time.perf_counter()
        for _ in range(50):
            distances(body.shapes, nao.pairs, body.pos, body.rot, 0.05, d, a, b, n)
        best = min(best, (time.perf_counter() - start) / 50)
    assert best < 15e-6

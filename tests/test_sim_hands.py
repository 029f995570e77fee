"""The simulated hands open, close and hold a ball; the body does not notice that they are there."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from test_sim_driver import command

from naoimitate.core.errors import RenderingUnavailable, RobotModelError
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.fingers import read_hands
from naoimitate.sim.model import build_model
from naoimitate.sim.physics import Physics
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.settings import SimSettings
from naoimitate.sim.simulate import simulate
from naoimitate.sim.stage import Stage, View

PERIOD = 0.01
SEAT = np.array([0.75, 0.0, -0.66])
"""Direction from the middle between the knuckles to that of the grip, in the right hand's frame."""
KEEP, OPEN, SHUT = np.full(2, np.nan), np.array([np.nan, 1.0]), np.array([np.nan, 0.0])


def reaching(robot: RobotModel) -> Array:
    """The right hand in front of the body."""
    q = robot.postures["stand"].copy()
    for name, angle in (("ShoulderPitch", 0.6), ("ShoulderRoll", -0.1), ("ElbowRoll", 0.5), ("ElbowYaw", 1.2)):
        q[robot.joint(f"R{name}")] = angle
    return q


def with_ball(robot: RobotModel, radius: float, out: float, mass: float = 0.06) -> Physics:
    """The robot with its hands open, and a ball in front of the right palm, ``out`` (m) from where 5 cm would rest."""
    q = reaching(robot)
    place = (q, *stand_on_floor(robot, q), np.ones(2))
    empty = Physics(robot, SimSettings())
    empty.place(*place)
    grip = empty.data.site("r_grip")
    where = grip.xpos + grip.xmat.reshape(3, 3) @ (out * SEAT)

    def scene(spec: mujoco.MjSpec) -> None:
        ball = spec.worldbody.add_body(name="ball", pos=where)
        ball.add_freejoint(name="ball")
        ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0], mass=mass)

    physics = Physics(robot, SimSettings(), scene)
    physics.place(*place)
    return physics


def in_hand(physics: Physics) -> Array:
    """Where the ball is from the grip, (3,) m in the frame of the right hand."""
    grip = physics.data.site("r_grip")
    return np.asarray(grip.xmat.reshape(3, 3).T @ (physics.data.body("ball").xpos - grip.xpos))


def shaken(robot: RobotModel, q: Array, time: float) -> Array:
    """Shoulder, elbow and wrist that wave about, (J,) rad."""
    moved = q.copy()
    moved[robot.joint("RShoulderPitch")] += 0.5 * np.sin(2 * np.pi * time)
    moved[robot.joint("RElbowRoll")] += 0.4 * np.sin(5.0 * time)
    moved[robot.joint("RWristYaw")] += 1.2 * np.sin(4.4 * time)
    return moved


def weightless(physics: Physics, act: Callable[[], None]) -> None:
    """Do something before gravity is there: nothing but the hand holds the ball."""
    gravity = physics.model.opt.gravity.copy()
    physics.model.opt.gravity[:] = 0.0
    act()
    physics.model.opt.gravity[:] = gravity


@pytest.mark.parametrize(("radius", "out"), [(0.02, 0.0), (0.02, 0.005), (0.025, 0.003), (0.03, 0.008)])
def test_a_ball_stays_in_a_closed_hand_that_is_waved_about_and_drops_when_it_opens(
    nao: RobotModel, radius: float, out: float
) -> None:
    physics, q = with_ball(nao, radius, out), reaching(nao)
    weightless(physics, lambda: physics.advance(q, 1.0, SHUT))
    assert 0.05 < physics.opening[1] < 0.9 and physics.opening[0] == pytest.approx(1.0, abs=0.03)
    held = in_hand(physics)
    for step in range(600):
        physics.advance(shaken(nao, q, step * PERIOD), PERIOD, KEEP)
        assert np.linalg.norm(in_hand(physics) - held) < 0.015
    assert physics.data.body("ball").xpos[2] > 0.2
    physics.advance(q, 1.0, OPEN)
    assert physics.opening[1] == pytest.approx(1.0, abs=0.03)
    assert physics.data.body("ball").xpos[2] < 0.05


def test_a_ball_that_is_held_does_not_fall_out_in_half_a_minute(nao: RobotModel) -> None:
    physics, q = with_ball(nao, 0.025, 0.003), reaching(nao)
    weightless(physics, lambda: physics.advance(q, 1.0, SHUT))
    held = in_hand(physics)
    physics.advance(q, 30.0)
    assert np.linalg.norm(in_hand(physics) - held) < 0.005


def test_a_hand_takes_half_a_second_from_closed_to_open_and_nan_keeps_it(nao: RobotModel) -> None:
    driver = MujocoDriver(nao, real_time=False)
    driver.connect()
    stand = command(nao, nao.postures["stand"])
    np.testing.assert_allclose(driver.hand_opening, 0.0, atol=1e-6)
    driver.write(replace(stand, hand_opening=np.array([np.nan, 1.0])))
    driver.write(replace(stand, hand_opening=np.array([np.nan, np.nan])))
    driver.advance(0.25)
    assert driver.hand_opening[0] == pytest.approx(0.0, abs=1e-3)
    assert driver.hand_opening[1] == pytest.approx(0.5, abs=0.06)
    driver.write(stand)
    driver.advance(0.5)
    np.testing.assert_allclose(driver.hand_opening, (0.0, 1.0), atol=1e-3)
    driver.write(replace(stand, hand_opening=np.array([0.3, 0.0])))
    driver.advance(1.0)
    np.testing.assert_allclose(driver.hand_opening, (0.3, 0.0), atol=1e-3)


def test_the_newest_positions_hold_robot_and_fingers_and_do_not_change_any_more(nao: RobotModel) -> None:
    driver = MujocoDriver(nao, real_time=False)
    driver.connect()
    begin, before = driver.snapshot
    kept = before.copy()
    driver.write(replace(command(nao, reaching(nao)), hand_opening=np.ones(2)))
    driver.advance(1.0)
    now, after = driver.snapshot
    assert now == pytest.approx(begin + 1.0) and before.shape == after.shape == (driver.model.nq,)
    assert (before == kept).all()
    data = mujoco.MjData(driver.model)
    data.qpos[:] = after
    for digit in ("index", "middle", "thumb"):
        assert data.joint(f"r_finger_{digit}").qpos[0] == pytest.approx(read_hands(nao)["r"].opening_angle, abs=1e-3)


def test_all_digits_of_a_hand_move_together(nao: RobotModel) -> None:
    physics, q = Physics(nao, SimSettings()), nao.postures["stand"]
    physics.place(q, *stand_on_floor(nao, q))
    for _ in range(30):
        physics.advance(q, PERIOD, np.array([1.0, np.nan]))
        angles = [physics.data.joint(f"l_finger_{digit}").qpos[0] for digit in ("index", "middle", "thumb")]
        assert np.ptp(angles) < 2e-3


def test_the_body_moves_as_without_fingers(nao: RobotModel) -> None:
    bare = replace(nao, data={key: value for key, value in nao.data.items() if key != "fingers"})
    frames = 300
    base_pos, base_quat = stand_on_floor(nao, nao.postures["stand"])
    time = PERIOD * np.arange(frames)
    plan = np.array([shaken(nao, nao.postures["stand"], moment) for moment in time])
    opening = np.tile(0.5 - 0.5 * np.cos(3.0 * time)[:, None], 2)
    stand = (np.tile(base_pos, (frames, 1)), np.tile(base_quat, (frames, 1)), np.full(frames, "D"))
    with_fingers = simulate(nao, time, plan, *stand, hand_opening=opening)
    without = simulate(bare, time, plan, *stand, hand_opening=opening)
    np.testing.assert_allclose(with_fingers.q, without.q, atol=1e-5)
    np.testing.assert_allclose(with_fingers.base_pos, without.base_pos, atol=1e-6)
    np.testing.assert_allclose(with_fingers.hand_opening[50:], opening[50:], atol=0.15)
    assert np.isnan(without.hand_opening).all()


def test_fingers_touch_objects_only(nao: RobotModel) -> None:
    model = build_model(nao)
    fists = {model.geom(hand.fist).id for hand in read_hands(nao).values()}
    fingers = [geom for geom in range(model.ngeom) if model.geom_priority[geom] == 1]
    assert len(fingers) == 24
    assert not (
        model.geom_contype[fingers].any() or (model.geom_conaffinity[fingers] & model.geom("floor").contype).any()
    )
    assert not set(fingers) & {*model.pair_geom1, *model.pair_geom2}
    assert fists <= {*model.pair_geom1, *model.pair_geom2}
    for geom in fists:
        assert model.geom_conaffinity[geom] & model.geom("floor").contype and not model.geom_conaffinity[geom] & 1


def test_the_right_hand_is_the_left_ones_mirror_image(nao: RobotModel) -> None:
    hands = read_hands(nao)
    for left, right in zip(hands["l"].digits, hands["r"].digits, strict=True):
        np.testing.assert_allclose(left.points * (1.0, -1.0, 1.0), right.points)
    assert (hands["r"].link, hands["r"].fist) == ("r_hand", "r_hand")
    physics = Physics(nao, SimSettings())
    q = nao.postures["zero"]
    physics.place(q, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.ones(2))
    thumbs = [physics.data.geom_xpos[physics.model.body(f"{side}_finger_thumb").geomadr[0] + 2] for side in "lr"]
    np.testing.assert_allclose(thumbs[0] * (1.0, -1.0, 1.0), thumbs[1], atol=1e-9)


def test_a_robot_without_fingers_has_no_hands_to_open(second_robot: RobotModel) -> None:
    driver = MujocoDriver(second_robot, real_time=False)
    driver.connect()
    driver.write(replace(command(second_robot, second_robot.postures["stand"]), hand_opening=np.ones(2)))
    assert not driver.advance(0.3).fell
    assert np.isnan(driver.hand_opening).all()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("link", "nowhere", "link 'nowhere'"),
        ("fist", "nothing", "no shape 'nothing'"),
        ("torque", -1.0, "above 0"),
        ("grip", [0.0, 1.0], "compare"),
        ("digits", {}, "give digits"),
    ],
)
def test_wrong_data_are_one_line(nao: RobotModel, key: str, value: object, message: str) -> None:
    fingers = deepcopy(nao.data["fingers"])
    fingers["l"][key] = value
    with pytest.raises(RobotModelError, match=message) as error:
        build_model(replace(nao, data={**nao.data, "fingers": fingers}))
    assert "\n" not in str(error.value)


def test_a_picture_shows_hands_open_and_closed(nao: RobotModel) -> None:
    pose = (reaching(nao), *stand_on_floor(nao, reaching(nao)))
    try:
        with Stage(nao, 320, 240) as stage:
            shut, opened = (stage.draw(pose, np.zeros(2), View(), opening=np.full(2, share)) for share in (0.0, 1.0))
    except RenderingUnavailable as reason:
        pytest.skip(str(reason))
    changed = (shut != opened).any(axis=2)
    assert 30 < changed.sum() < 0.1 * changed.size

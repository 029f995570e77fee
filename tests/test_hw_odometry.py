"""Odometry of the stance feet: near MuJoCo's truth on walks, exact on a plan carried out exactly, honest otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate import imitate, load_robot
from naoimitate.core.geometry import heading, matrix_from_quat, wrap
from naoimitate.core.physics import GRAVITY
from naoimitate.hw.driver import RobotState
from naoimitate.hw.odometry import Odometry, Place
from naoimitate.hw.servo_command import servo_command
from naoimitate.hw.target import Target
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.run.file import Run
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.sensors import roll_pitch
from naoimitate.sim.simulate import simulate

NAO = load_robot("nao")
STAND = NAO.postures["stand"]
PERIOD = 0.01
HALF_SECOND = 50
"""Frames at either end over which noise is averaged out of a drift."""


@cache
def run_of(name: str) -> Run:
    return imitate(builtin_motion(name), NAO)


@dataclass(frozen=True)
class Error:
    """Of an odometry against the truth, T frames: off (T, 3) m, turned (T,) rad, leaning (T,) rad."""

    off: Array
    turned: Array
    leaning: Array

    def drift(self, values: Array) -> Array:
        """By how much an error has grown from the beginning to the end."""
        return np.asarray(values[-HALF_SECOND:].mean(axis=0) - values[:HALF_SECOND].mean(axis=0))


Blind = Callable[[RobotState], RobotState]


def walked(name: str, stiffness: float, noise: float, blind: Blind = lambda state: state, seed: int = 0) -> Error:
    """The robot plays a built-in motion on simulated servos, and the odometry is told what it measures."""
    run, servos, odometry, places = run_of(name), servo_command(NAO, stiffness, PERIOD), Odometry(NAO), list[Place]()

    def control(target: Target, state: RobotState) -> Array:
        places.append(odometry.update(blind(state), target.support))
        return servos(target, state)

    plan = (run.time, run.q, run.base_pos, run.base_quat, run.support)
    world = Disturbance(stiffness=stiffness, noise=noise, seed=seed)
    result = simulate(NAO, *plan, disturbance=world, control=control)
    told = places[-len(result.time) + 1 :]  # after the stand; a state is read where the frame before it ended
    assert result.survived and all(place.known for place in told)
    quats = zip([place.quat for place in told], result.base_quat[:-1], strict=True)
    axes = [(matrix_from_quat(quat), matrix_from_quat(true)) for quat, true in quats]
    return Error(
        np.array([place.pos for place in told]) - result.base_pos[:-1],
        np.unwrap([wrap(heading(a) - heading(b)) for a, b in axes]),
        np.array([np.arccos(min(a[2] @ b[2], 1.0)) for a, b in axes]),
    )


# -- against MuJoCo


@pytest.mark.parametrize("name", ["stroll", "turn", "march", "sidestep"])
@pytest.mark.parametrize("stiffness", [300.0, 150.0])
def test_with_exact_sensors_a_walk_is_followed_to_two_millimetres(name: str, stiffness: float) -> None:
    """Soles that slip and pivot a little as they come down: 1.6 mm and 0.8 deg in four stands of the march, under
    0.8 mm and 0.25 deg elsewhere."""
    error = walked(name, stiffness, 0.0)
    assert np.linalg.norm(error.off[:, :2], axis=1).max() < 0.002
    assert np.abs(error.off[:, 2]).max() < 0.0005
    assert np.degrees(np.abs(error.turned).max()) < 1.0
    assert np.degrees(error.leaning.max()) < 0.2
    assert np.degrees(abs(error.drift(error.turned))) < 0.5


@pytest.mark.parametrize("stiffness", [300.0, 150.0])
def test_noise_hardly_adds_to_the_drift_of_a_stroll(stiffness: float) -> None:
    """20 cm: 0.7 mm and 0.12 deg at worst in six draws; at any moment the bias of the inertial board costs more."""
    for seed in (1, 2):
        error = walked("stroll", stiffness, 1.0, seed=seed)
        assert np.linalg.norm(error.drift(error.off)[:2]) < 0.0015
        assert np.degrees(abs(error.drift(error.turned))) < 0.25
        assert np.linalg.norm(error.off[:, :2], axis=1).max() < 0.012
        assert np.abs(error.off[:, 2]).max() < 0.002
        assert np.degrees(error.leaning.max()) < 2.5


@pytest.mark.parametrize("stiffness", [300.0, 150.0])
def test_noise_hardly_adds_to_the_drift_of_a_turn(stiffness: float) -> None:
    """A quarter: 0.16 deg at worst in six draws."""
    error = walked("turn", stiffness, 1.0, seed=2)
    assert np.degrees(abs(error.drift(error.turned))) < 0.4
    assert np.degrees(np.abs(error.turned).max()) < 1.0
    assert np.linalg.norm(error.off[:, :2], axis=1).max() < 0.012


@pytest.mark.parametrize("missing", ["fsr", "angles"])
def test_without_force_sensors_or_inertial_board_it_is_as_good(missing: str) -> None:
    def blind(state: RobotState) -> RobotState:
        return replace(state, **{missing: np.full_like(getattr(state, missing), np.nan)})

    error = walked("stroll", 150.0, 0.0, blind)
    assert np.linalg.norm(error.off[:, :2], axis=1).max() < 0.002
    assert np.degrees(np.abs(error.turned).max()) < 0.5


# -- a plan carried out exactly


def felt(q: Array, quat: Array, loads: tuple[float, float], time: float = 0.0, robot: RobotModel = NAO) -> RobotState:
    """What a robot measures in a posture; loads: shares of its weight on the left and right foot."""
    forces = GRAVITY * robot.mass * np.outer(loads, np.full(4, 0.25))
    nan = np.full(len(q), np.nan)
    return RobotState(time, q, nan, roll_pitch(quat), np.zeros(3), np.zeros(3), forces, fell=False)


def standing(loads: tuple[float, float] = (0.5, 0.5), time: float = 0.0) -> RobotState:
    return felt(STAND, stand_on_floor(NAO, STAND)[1], loads, time)


def exact(run: Run) -> Iterator[RobotState]:
    for i in range(len(run)):
        loads = {"L": (1.0, 0.0), "R": (0.0, 1.0)}.get(str(run.support[i]), (1.0 - run.offset[i], run.offset[i]))
        yield felt(run.q[i], run.base_quat[i], loads, float(run.time[i]))


@pytest.mark.parametrize("name", ["stroll", "turn", "sidestep"])
@pytest.mark.parametrize("forces", [True, False])
def test_a_plan_carried_out_exactly_is_told_exactly(name: str, forces: bool) -> None:
    """But for the last tenths of a millimetre that a foot comes down before it counts as planted."""
    run, odometry = run_of(name), Odometry(NAO)
    for i, state in enumerate(exact(run)):
        seen = state if forces else replace(state, fsr=np.full((2, 4), np.nan))
        place = odometry.update(seen, str(run.support[i]))
        assert place.known
        np.testing.assert_allclose(place.pos, run.base_pos[i], atol=5e-4)
        assert abs(place.quat @ run.base_quat[i]) > np.cos(0.5 * np.radians(0.1))


@settings(max_examples=30, deadline=None)
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.1, 3.1))
def test_it_begins_where_it_is_told(x: float, y: float, facing: float) -> None:
    odometry = Odometry(NAO)
    odometry.restart((x, y), facing)
    place = odometry.update(standing(), "D")
    pos, quat = stand_on_floor(NAO, STAND)
    c, s = np.cos(facing), np.sin(facing)
    np.testing.assert_allclose(place.pos, [x + c * pos[0] - s * pos[1], y + s * pos[0] + c * pos[1], pos[2]], atol=1e-9)
    turned = heading(matrix_from_quat(place.quat)) - heading(matrix_from_quat(quat))
    assert wrap(turned - facing) == pytest.approx(0.0, abs=1e-9)


def test_any_robot_knows_where_it_stands(robot: RobotModel) -> None:
    q = robot.postures["stand"]
    pos, quat = stand_on_floor(robot, q)
    place = Odometry(robot).update(felt(q, quat, (0.5, 0.5), robot=robot), "D")
    np.testing.assert_allclose(place.pos, pos, atol=1e-3)
    np.testing.assert_allclose(np.abs(place.quat), np.abs(quat), atol=1e-3)


# -- which foot


def test_the_heavier_foot_is_the_one_it_hangs_on_but_swaying_changes_nothing() -> None:
    odometry = Odometry(NAO)
    assert odometry.update(standing((0.2, 0.8)), "D").stance == "R"
    for k, left in enumerate([0.45, 0.58, 0.41, 0.59]):
        assert odometry.update(standing((left, 1.0 - left), PERIOD * k), "D").stance == "R"
    assert odometry.update(standing((0.7, 0.3), 1.0), "D").stance == "L"


def test_without_forces_it_hangs_on_the_foot_that_it_is_commanded_to_stand_on() -> None:
    odometry = Odometry(NAO)
    for k, support in enumerate("RDLDR"):
        state = replace(standing(time=PERIOD * k), fsr=np.full((2, 4), np.nan))
        stance = odometry.update(state, support).stance
        assert stance == {"R": "R", "L": "L"}.get(support, stance)
        assert support != "D" or stance == "RDLDR"[k - 1], "in the middle nothing changes"


def test_changing_feet_in_place_moves_nothing() -> None:
    odometry = Odometry(NAO)
    first = odometry.update(standing(), "D")
    for k in range(200):
        place = odometry.update(standing((1.0, 0.0) if k % 2 else (0.0, 1.0), PERIOD * k), "D")
    np.testing.assert_allclose(place.pos, first.pos, atol=1e-9)
    np.testing.assert_allclose(place.quat, first.quat, atol=1e-9)


def test_the_inertial_board_tells_how_the_torso_leans_once_it_has_said_so_for_long_enough() -> None:
    """A foot that rocks: encoders alone would have the torso upright."""
    odometry, lean = Odometry(NAO), np.array([0.05, -0.03])
    odometry.update(standing(), "D")
    for k in range(1, 301):
        place = odometry.update(replace(standing(time=PERIOD * k), angles=standing().angles + lean), "D")
        if k == 1:
            assert np.abs(roll_pitch(place.quat) - standing().angles).max() < 0.5 * lean[0] + 1e-9
    np.testing.assert_allclose(roll_pitch(place.quat), standing().angles + lean, atol=1e-3)


# -- what it does not know


def test_before_the_first_state_nothing_is_known() -> None:
    place = Odometry(NAO).place
    assert not place.known and np.isnan(place.pos).all() and np.isnan(place.quat).all()


@pytest.mark.parametrize(
    "lost",
    [
        lambda state: replace(state, q=np.where(np.arange(len(state.q)) == 3, np.nan, state.q)),
        lambda state: replace(state, fsr=np.zeros((2, 4))),
        lambda state: replace(state, fell=True),
    ],
    ids=["an encoder", "no weight on the feet", "a fall"],
)
def test_what_cannot_be_felt_keeps_the_last_place_and_says_so(lost: Blind) -> None:
    odometry = Odometry(NAO)
    odometry.restart((1.0, 2.0), 0.5)
    before = odometry.update(standing(), "D")
    elsewhere = replace(standing(time=PERIOD), q=STAND + 0.1)
    during = odometry.update(lost(elsewhere), "D")
    assert not during.known
    np.testing.assert_array_equal(during.pos, before.pos)
    np.testing.assert_array_equal(during.quat, before.quat)
    after = odometry.update(standing(time=2.0 * PERIOD), "D")
    assert after.known
    np.testing.assert_allclose(after.pos, before.pos, atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["q", "angles", "fsr"]), st.integers(0, 23)), max_size=12), st.data())
def test_nan_anywhere_never_comes_out_once_a_place_is_known(holes: list[tuple[str, int]], data: st.DataObject) -> None:
    odometry = Odometry(NAO)
    odometry.update(standing(), "D")
    for k, (name, index) in enumerate(holes):
        state = standing((0.3, 0.7), PERIOD * (k + 1))
        broken = getattr(state, name).copy()
        broken.flat[index % broken.size] = np.nan
        place = odometry.update(replace(state, **{name: broken}), data.draw(st.sampled_from("DLR")))
        assert np.isfinite(place.pos).all() and np.isfinite(place.quat).all()
        assert place.known == (name != "q")

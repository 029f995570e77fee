"""The swing foot's way: straight up, free, around to its landing place, straight down."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from naoimitate.balance.swing import Phase, Swing, SwingSettings
from naoimitate.core.geometry import matrix_from_rotation_vector, rotation_vector, yaw_matrix

S = SwingSettings()
CLEAR = 0.005
"""m from which a foot counts as clear of the floor, and s within which it must get there."""
ENDS = 0.15
START = np.array([0.1, 0.05, 0.0])
GOAL = np.array([0.16, 0.07])


@dataclass
class Foot:
    """A sole that does what it is told, no lower than it is bidden, and drifts where it is free to."""

    dt: float
    swing: Swing = field(default_factory=lambda: Swing(START, yaw_matrix(0.1), S))
    position: np.ndarray = field(default_factory=START.copy)
    rotation: np.ndarray = field(default_factory=lambda: yaw_matrix(0.1))
    down: bool = False
    time: float = 0.0

    def step(self, landing: bool, goal: np.ndarray = GOAL, yaw: float = -0.2) -> None:
        self.position, self.rotation, self.down = self.swing.step(
            self.position, self.rotation, goal, yaw, landing, self.dt
        )
        self.time += self.dt
        if self.swing.phase in (Phase.FREE, Phase.APPROACH):
            self.position[2] = max(self.position[2], self.swing.min_height)
        if self.swing.phase is Phase.FREE and not landing:
            self.position = self.position + np.array([0.0003, 0.0, 0.0002 if self.position[2] < 0.05 else 0.0])

    def until(self, landing: bool, phase: Phase) -> None:
        while self.swing.phase is not phase:
            self.step(landing)
            assert self.time < 10.0, f"never in {phase}"


@pytest.fixture(params=[20.0, 50.0, 100.0, 240.0])
def rate(request: pytest.FixtureRequest) -> float:
    return float(request.param)


def test_a_foot_lifts_straight_and_as_it_stood(rate: float) -> None:
    foot = Foot(1.0 / rate)
    while foot.swing.phase is Phase.LIFT:
        before = foot.position[2]
        foot.step(False)
        if foot.swing.phase is Phase.LIFT:
            assert np.array_equal(foot.position[:2], START[:2])
            assert np.array_equal(foot.rotation, yaw_matrix(0.1))
            assert before < foot.position[2]
    assert foot.position[2] >= S.lift_height


@pytest.mark.parametrize("rate", [50.0, 100.0])
@pytest.mark.parametrize("landing", [False, True])
def test_a_foot_is_clear_within_15_hundredths_of_a_second(rate: float, landing: bool) -> None:
    foot = Foot(1.0 / rate)
    while foot.position[2] < CLEAR:
        foot.step(landing)
    assert foot.time <= ENDS - 1.0 / rate + 1e-9


@pytest.mark.parametrize("rate", [50.0, 100.0])
def test_a_foot_is_down_within_15_hundredths_of_a_second(rate: float) -> None:
    foot = Foot(1.0 / rate)
    foot.until(False, Phase.FREE)
    foot.until(True, Phase.DESCEND)
    while foot.position[2] >= CLEAR:
        foot.step(True)
    low = 0.0
    while not foot.down:
        foot.step(True)
        low += foot.dt
    assert low <= ENDS - 1.0 / rate + 1e-9


def test_a_foot_lands_on_its_place_level_and_softly(rate: float) -> None:
    foot = Foot(1.0 / rate)
    foot.until(False, Phase.FREE)
    for _ in range(20):
        foot.step(False)
    last = foot.position
    while not foot.down:
        last = foot.position
        foot.step(True)
        assert foot.time < 5.0
    assert np.linalg.norm(foot.position[:2] - GOAL) < 2.0 * S.arrived
    assert np.linalg.norm(rotation_vector(yaw_matrix(-0.2) @ foot.rotation.T)) < 0.02
    assert foot.rotation[:, 2] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert 0.0 <= foot.position[2] <= S.touch_height
    touch = np.hypot(S.touch_speed, np.sqrt(2.0 * S.descend_acceleration * (S.touch_height + S.descend_speed / rate)))
    assert (last[2] - foot.position[2]) * rate <= touch


def test_a_foot_goes_straight_down_once_it_descends(rate: float) -> None:
    foot = Foot(1.0 / rate)
    foot.until(False, Phase.FREE)
    foot.until(True, Phase.DESCEND)
    foot.step(True)
    place, rotation = foot.position[:2], foot.rotation
    while not foot.down:
        before = foot.position[2]
        foot.step(True, goal=GOAL + 0.05, yaw=0.6)
        assert np.array_equal(foot.position[:2], place) and np.array_equal(foot.rotation, rotation)
        assert foot.position[2] <= before


def test_no_step_is_faster_than_its_settings(rate: float) -> None:
    foot = Foot(1.0 / rate)
    for k in range(int(4.0 * rate)):
        landing = k > 0.6 * rate
        before, turned = foot.position, foot.rotation
        foot.step(landing)
        if foot.swing.phase is Phase.FREE or foot.down:
            continue
        assert np.linalg.norm(foot.position - before) <= max(S.approach_speed, S.lift_speed) * foot.dt + 1e-5
        angle = np.linalg.norm(rotation_vector(foot.rotation @ turned.T))
        assert angle <= S.turn_speed * foot.dt + 0.02


def test_a_person_who_lifts_again_frees_the_foot(rate: float) -> None:
    foot = Foot(1.0 / rate)
    foot.until(False, Phase.FREE)
    for _ in range(3):
        foot.step(True)
    assert foot.swing.phase is Phase.APPROACH
    foot.step(False)
    assert foot.swing.phase is Phase.FREE


def test_a_free_foot_must_rise_to_its_clearance_but_not_at_once(rate: float) -> None:
    foot = Foot(1.0 / rate)
    foot.until(False, Phase.FREE)
    bounds = [foot.swing.min_height]
    for _ in range(int(rate)):
        foot.step(False)
        bounds.append(foot.swing.min_height)
    assert 0.0 < bounds[0] <= S.lift_height
    assert np.diff(bounds).max() <= S.lift_speed * foot.dt + 1e-12
    assert bounds[-1] == pytest.approx(S.clearance)


def test_a_landing_that_moves_is_followed() -> None:
    foot = Foot(0.01)
    foot.until(False, Phase.FREE)
    goal = GOAL.copy()
    for k in range(600):
        goal = GOAL + np.array([0.02 * np.sin(0.02 * k), 0.0]) if k < 150 else goal
        foot.step(True, goal=goal)
        if foot.down:
            break
    assert foot.down
    assert np.linalg.norm(foot.position[:2] - goal) < 0.03


@given(
    st.tuples(st.floats(-0.15, 0.15), st.floats(-0.1, 0.1), st.floats(0.011, 0.25)),
    st.tuples(*[st.floats(-0.6, 0.6)] * 3),
    st.floats(-0.8, 0.8),
    st.floats(0.002, 0.05),
)
@settings(max_examples=80, deadline=None)
def test_a_foot_lands_from_wherever_it_is(
    place: tuple[float, float, float], turn: tuple[float, float, float], yaw: float, dt: float
) -> None:
    foot = Foot(dt)
    foot.until(False, Phase.FREE)
    foot.position, foot.rotation = START + place, matrix_from_rotation_vector(np.array(turn))
    for _ in range(2):
        foot.step(False)
    begin = foot.time
    while not foot.down:
        foot.step(True, yaw=yaw)
        assert foot.time - begin < 4.0
        if foot.swing.phase is not Phase.DESCEND:
            far = np.linalg.norm(foot.position[:2] - GOAL) > S.close + S.approach_speed * dt
            lowest = S.clearance if far else S.hover_height
            assert foot.position[2] >= min(lowest, START[2] + place[2]) - 3e-3
    assert np.linalg.norm(foot.position[:2] - GOAL) < 2.0 * S.arrived


def test_a_refused_step_starts_again_from_rest() -> None:
    foot = Foot(0.01)
    for _ in range(4):
        foot.step(False)
    foot.swing.stop()
    before = foot.position[2]
    foot.step(False)
    assert foot.position[2] - before <= S.lift_acceleration * foot.dt**2 + 1e-12


def test_a_foot_that_is_refused_on_its_way_down_goes_up_again_and_gives_way() -> None:
    """Something is in the way under the landing place: every step down is refused."""
    foot = Foot(0.02)
    foot.until(False, Phase.FREE)
    foot.until(True, Phase.DESCEND)
    assert foot.swing.lateness == 0.0
    held, phases = foot.position, set()
    for _ in range(300):
        _, _, foot.down = foot.swing.step(held, foot.rotation, GOAL, -0.2, True, foot.dt)
        if foot.swing.phase is Phase.DESCEND:
            foot.swing.stop()
        phases.add(foot.swing.phase)
        assert not foot.down
    assert phases == {Phase.DESCEND, Phase.APPROACH}
    assert foot.swing.lateness == 1.0
    foot.step(False)
    assert foot.swing.lateness == 0.0


def test_a_foot_that_comes_down_less_than_asked_is_asked_for_less_and_goes_up_again() -> None:
    """Its leg stops it 3 mm over the floor."""
    foot = Foot(0.01)
    foot.until(False, Phase.FREE)
    foot.until(True, Phase.DESCEND)
    asked = []
    while foot.swing.phase is Phase.DESCEND:
        foot.position[2] = max(foot.position[2], 0.003)
        asked.append(foot.position[2])
        foot.step(True)
        asked[-1] -= foot.position[2]
        assert not foot.down
        assert foot.time < 10.0
    assert foot.swing.phase is Phase.APPROACH
    assert 0.0 <= asked[-2] <= S.descend_acceleration * foot.dt**2 + 1e-12

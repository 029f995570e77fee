"""The true frame rate: of known files by their names, of others by their fall."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skeleton_writer import FLAVOURS, Style, bvh

from naoimitate.core.frames import LANDMARK
from naoimitate.motion import load_motion
from naoimitate.motion.builtin import builtin_motion
from naoimitate.motion.flight import flights, rate_by_flight

pytestmark = pytest.mark.filterwarnings("ignore:Gimbal lock")
CMU_STYLE = Style(FLAVOURS["cmu with its thorax"], rate=120.0)


@cache
def standing() -> np.ndarray:
    return np.asarray(builtin_motion("wave").landmarks[0])


def jumping(rate: float, height: float, hops: int = 1) -> np.ndarray:
    """Landmarks of somebody who stands, and jumps so high (m), some times, at the given rate (Hz)."""
    span = np.sqrt(8.0 * height / 9.81)
    t = np.arange(0.0, span + 0.5 / rate, 1.0 / rate)
    rise = np.maximum(0.5 * 9.81 * t * (span - t), 0.0)
    wait = np.zeros(round(rate))
    path = np.concatenate([wait] + [np.concatenate([rise, wait])] * hops)
    return standing() + path[:, None, None] * np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("name", "rate"),
    [
        ("88_03_pose", 60.0),
        ("141_16", 60.0),
        ("clip_143_01_x", 60.0),
        ("88_3", 120.0),
        ("188_03", 120.0),
        ("12_01", 120.0),
    ],
)
def test_cmu_subjects_recorded_at_60_are_known_by_their_number(name: str, rate: float, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.bvh"
    path.write_text(bvh(builtin_motion("wave"), CMU_STYLE, 20))
    motion = load_motion(path)
    assert motion.rate == pytest.approx(rate)
    assert any(f"{rate:g} Hz" in note for note in motion.notes)


def test_the_number_counts_only_with_cmus_skeleton_and_wrong_label(tmp_path: Path) -> None:
    path = tmp_path / "88_03.bvh"
    for style, rate in ((replace(CMU_STYLE, names=FLAVOURS["mixamo"]), 120.0), (replace(CMU_STYLE, rate=60.0), 60.0)):
        path.write_text(bvh(builtin_motion("wave"), style, 20))
        assert load_motion(path).rate == pytest.approx(rate)
    assert load_motion(path, fps=50.0).rate == pytest.approx(50.0)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from([30.0, 60.0, 120.0, 240.0]), st.floats(0.2, 0.6), st.sampled_from([0.5, 1.0, 2.0]))
def test_whoever_falls_falls_with_g(rate: float, height: float, label: float) -> None:
    found, note = rate_by_flight(jumping(rate, height, hops=2), rate * label)
    assert found == pytest.approx(rate)
    assert bool(note) == (label != 1.0)


def test_the_measured_g_is_that_of_the_earth() -> None:
    found = flights(jumping(120.0, 0.4), 120.0)
    assert len(found) == 1 and found[0].gravity == pytest.approx(9.81, rel=0.01)


def test_who_is_carried_by_hands_or_moves_slowly_in_the_air_does_not_fall() -> None:
    hands = jumping(120.0, 0.5)
    hands[:, [LANDMARK["l_wrist"], LANDMARK["r_wrist"]], 2] = 0.05
    t = np.linspace(0.0, 6.0, 720)
    swinging = standing() + np.where(t < 1.0, 0.0, 0.5 + 0.1 * np.sin(3.0 * t))[:, None, None] * np.array(
        [0.0, 0.0, 1.0]
    )
    for landmarks in (hands, swinging):
        assert rate_by_flight(landmarks, 120.0) == (120.0, "")

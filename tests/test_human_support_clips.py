"""The support estimate against the facts that were measured independently on the recorded clips."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from naoimitate.core.frames import LANDMARK, Motion
from naoimitate.human.support import SupportEstimator, last_mode, raw_support
from naoimitate.motion import load_motion
from naoimitate.motion.load import recorded
from naoimitate.motion.scene import Options

MOCAP = Path(os.environ.get("NAOIMITATE_MOCAP", Path(__file__).parents[2] / "shared" / "mocap"))
pytestmark = pytest.mark.skipif(not (MOCAP / "INDEX.yaml").exists(), reason=f"no recorded clips in {MOCAP}")
CLIPS: list[dict[str, Any]] = (
    yaml.safe_load((MOCAP / "INDEX.yaml").read_text())["clips"] if (MOCAP / "INDEX.yaml").exists() else []
)
FRACTIONS = {"double": "D", "left": "L", "right": "R", "flight": "F", "feet_moving": "M"}
STRETCHES = {"longest_left_s": "L", "longest_right_s": "R"}
TOELESS = ("deepmimic",)
"""Clips whose skeleton ends at the ankle: the facts know no toes, the landmarks' toes are a person's proportions."""
every_clip = pytest.mark.parametrize("clip", CLIPS, ids=lambda clip: clip["file"])


def options(file: str) -> Options:
    clip = next(clip for clip in CLIPS if clip["file"] == file)
    skeleton = MOCAP / clip["asf_file"] if "asf_file" in clip else None
    return Options(fps=clip["fps_true"], skeleton=skeleton)


@cache
def motion(file: str) -> Motion:
    wishes = options(file)
    return load_motion(MOCAP / file, fps=wishes.fps, skeleton=wishes.skeleton)


@cache
def whole_clip(file: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and raw classes by the whole-clip analysis."""
    recording, feet = recorded(MOCAP / file, options(file))
    return recording.time, raw_support(recording, feet).classes


def runs(classes: np.ndarray, wanted: str) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.r_[0, (classes == wanted).astype(int), 0]))
    return list(zip(edges[::2], edges[1::2], strict=True))


def deviations(
    clip: dict[str, Any], time: np.ndarray, classes: np.ndarray, fraction: float, stretch: float
) -> list[str]:
    """What is outside its band by more than the tolerance."""
    counted = classes[time >= clip["frames_skipped_at_start"] / clip["fps_true"] - 1e-9]
    values = {name: float(np.mean(counted == mode)) for name, mode in FRACTIONS.items()}
    for name, mode in STRETCHES.items():
        values[name] = max((b - a for a, b in runs(classes, mode)), default=0) / clip["fps_true"]
    tolerance = {name: stretch if name in STRETCHES else fraction for name in values}
    return [
        f"{name} {values[name]:.3f} not in {low}..{high}"
        for name, (low, high) in clip["band_over_6_detectors"].items()
        if not low - tolerance[name] - 1e-9 <= values[name] <= high + tolerance[name] + 1e-9
    ]


@every_clip
def test_the_whole_clip_analysis_agrees_with_the_measured_bands(clip: dict[str, Any]) -> None:
    assert deviations(clip, *whole_clip(clip["file"]), 0.03, 0.1) == []


@every_clip
def test_the_whole_clip_analysis_is_near_the_measured_shares(clip: dict[str, Any]) -> None:
    classes = whole_clip(clip["file"])[1]
    off = {name: float(np.mean(classes == mode)) - clip["support"][name] for name, mode in FRACTIONS.items()}
    assert max(map(abs, off.values())) < 0.04, off


@every_clip
def test_single_support_windows_are_found_where_they_are(clip: dict[str, Any]) -> None:
    time, classes = whole_clip(clip["file"])
    for side, begin, end in clip["single_support_windows_ge_0p5s"]:
        found = [(time[a], time[min(b, len(time) - 1)]) for a, b in runs(classes, side[0].upper())]
        assert any(abs(a - begin) <= 0.1 and abs(b - end) <= 0.1 for a, b in found), (side, begin, end, found)


@every_clip
def test_the_loaded_support_is_that_of_the_whole_clip_analysis(clip: dict[str, Any]) -> None:
    loaded = motion(clip["file"])
    assert loaded.support is not None
    assert np.array_equal(loaded.support, last_mode(whole_clip(clip["file"])[1]))


@every_clip
def test_the_floor_of_a_loaded_clip_is_level_and_at_zero(clip: dict[str, Any]) -> None:
    m = motion(clip["file"])
    assert m.contacts is not None and m.tpose is not None
    stands = np.mean([m.tpose[f"{side}_ankle"][2] for side in "lr"])
    ankles = [m.landmarks[m.contacts[:, i], LANDMARK[f"{side}_ankle"], 2] for i, side in enumerate("lr")]
    lowest = min(np.quantile(ankle, 0.2) for ankle in ankles if len(ankle) > 0.2 * len(m))
    assert lowest == pytest.approx(stands, abs=0.015)


def live(m: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Raw classes and modes of the causal estimate, which sees nothing but landmarks."""
    estimator = SupportEstimator()
    seen = [(estimator.update(replace(frame, support=None, contacts=None)), estimator.raw) for frame in m]
    modes, raw = np.array(seen).T
    return raw, modes


def test_the_causal_estimate_follows_the_whole_clip_analysis() -> None:
    agreement = {clip["file"]: np.mean(live(motion(clip["file"]))[1] == motion(clip["file"]).support) for clip in CLIPS}
    assert np.mean(list(agreement.values())) > 0.91
    assert min(agreement.values()) > 0.75, agreement


def test_the_causal_estimate_is_near_the_bands() -> None:
    """Fractions within 0.05 of the band on every clip with toes; it cannot close gaps that it has not seen."""
    wrong = {}
    for clip in CLIPS:
        if not any(part in clip["file"] for part in TOELESS):
            m = motion(clip["file"])
            off = [text for text in deviations(clip, m.time, live(m)[0], 0.05, 0.2) if "longest" not in text]
            if off:
                wrong[clip["file"]] = off
    assert wrong == {}

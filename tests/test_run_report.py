"""The report and the pictures of motions and robots: whole, self-contained, drawn for every kind of run."""

from __future__ import annotations

import dataclasses
import html
from pathlib import Path

import numpy as np
import pytest
from synthetic import standing

from naoimitate.core.errors import RunFileError
from naoimitate.core.frames import LANDMARK
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot import RobotModel, load_robot
from naoimitate.run.check_motion import describe_motion, picture_motion
from naoimitate.run.check_robot import describe_robot, picture_robot
from naoimitate.run.figures import FIGURES, as_png, draw
from naoimitate.run.report import write_report
from naoimitate.run.scores import score_run


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return load_robot("nao")


def test_the_report_is_one_file_with_every_measure_and_figure(robot: RobotModel, tmp_path: Path) -> None:
    run = standing(robot, 60, source="<clip> & co.bvh")
    write_report(run, robot, tmp_path / "run.html")
    text = (tmp_path / "run.html").read_text()
    for measure in score_run(run, robot):
        assert html.escape(measure.label) in text
    for figure in FIGURES:
        assert html.escape(figure.caption) in text
    assert "&lt;clip&gt; &amp; co.bvh" in text
    assert "src=" in text
    assert text.count("src=") == text.count('src="data:image/png;base64,')
    assert "href=" not in text


def test_a_report_in_a_missing_folder_is_one_clear_error(robot: RobotModel, tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="choose another place"):
        write_report(standing(robot, 20), robot, tmp_path / "absent" / "run.html")


@pytest.mark.parametrize("kind", ["one frame", "untracked", "everything given up"])
def test_every_figure_draws_unusual_runs(robot: RobotModel, kind: str) -> None:
    run = standing(robot, 1 if kind == "one frame" else 40)
    if kind == "untracked":
        nothing = np.full(40, np.nan)
        run = dataclasses.replace(
            run, human_time=nothing, human_posture=np.full((40, 4, 3), np.nan), human_offset=nothing
        )
    if kind == "everything given up":
        run = dataclasses.replace(run, given_up=np.full(40, 255, dtype=np.uint8))
    for figure in FIGURES:
        assert as_png(draw(figure, run, robot)).startswith(b"\x89PNG")


def test_a_motion_is_described_and_drawn_with_what_is_missing() -> None:
    motion = builtin_motion("wave")
    landmarks = motion.landmarks.copy()
    landmarks[: len(motion) // 2, LANDMARK["l_toe"]] = np.nan
    broken = dataclasses.replace(motion, landmarks=landmarks, tpose=None, tpose_note="", support=None)
    lines = "\n".join(describe_motion(broken))
    assert "l_toe (50 %)" in lines
    assert "--tpose-at" in lines
    assert "support: unknown" in lines
    assert as_png(picture_motion(broken)).startswith(b"\x89PNG")
    whole = "\n".join(describe_motion(motion))
    assert "missing landmarks: none" in whole
    assert "height 1.75 m" in whole


def test_a_robot_is_described_and_drawn(robot: RobotModel) -> None:
    lines = "\n".join(describe_robot(robot))
    assert "RHipYawPitch = LHipYawPitch" in lines
    assert "5.195 kg" in lines
    assert as_png(picture_robot(robot)).startswith(b"\x89PNG")

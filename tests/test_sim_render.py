"""Pictures show the robot and the person, side by side, the right way round, at the right times."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import imageio.v2 as imageio
import mujoco
import numpy as np
import numpy.typing as npt
import pytest

from naoimitate.core.errors import RenderingUnavailable
from naoimitate.core.frames import LANDMARK, Motion
from naoimitate.core.geometry import yaw_matrix
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.sim.gl import Canvas, backends
from naoimitate.sim.model import build_model
from naoimitate.sim.person import person_height, stage_person
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.render import PANEL_SIZE, VIDEO_SIZE, render_strip, render_video
from naoimitate.sim.stage import Stage, View, standing_height

Image = npt.NDArray[np.uint8]


@pytest.fixture(scope="module")
def gl(nao: RobotModel) -> None:
    try:
        Canvas(build_model(nao), 64, 64).close()
    except RenderingUnavailable as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="module")
def person() -> Motion:
    return builtin_motion("paper")


def columns(picture: Image, side: str) -> Array:
    """Pixel columns of the colour of a side: left blue, right orange."""
    red, green, blue = (picture[..., channel].astype(int) for channel in range(3))
    mask = blue > red + 80 if side == "l" else (red > blue + 80) & (red > green + 40)
    return np.nonzero(mask)[1].astype(float)


def run(robot: RobotModel, frames: int = 60) -> tuple[Array, ...]:
    stand = robot.postures["stand"]
    base_pos, base_quat = stand_on_floor(robot, stand)
    shape = (frames, 1)
    return 0.1 * np.arange(frames), np.tile(stand, shape), np.tile(base_pos, shape), np.tile(base_quat, shape)


@pytest.mark.usefixtures("gl")
def test_from_the_front_the_left_side_is_on_the_right_of_the_picture(robot: RobotModel) -> None:
    stand = robot.postures["stand"]
    pose = (stand, *stand_on_floor(robot, stand))
    with Stage(robot, 320, 240) as stage:
        picture = stage.draw(pose, np.zeros(2), View(azimuth=180.0))
        behind = stage.draw(pose, np.zeros(2), View(azimuth=0.0))
    assert columns(picture, "r").max() < columns(picture, "l").min()
    assert columns(behind, "l").max() < columns(behind, "r").min()


@pytest.mark.usefixtures("gl")
def test_the_robot_fills_the_picture_and_stands_on_the_floor(robot: RobotModel) -> None:
    stand = robot.postures["stand"]
    pose = (stand, *stand_on_floor(robot, stand))
    with Stage(robot, 320, 320) as stage:
        with_robot, without = (stage.draw(pose, np.zeros(2), View(), robot=shown) for shown in (True, False))
    rows = np.nonzero((with_robot != without).any(axis=(1, 2)))[0]
    assert 0.4 < len(rows) / 320 < 1.0 and rows.min() > 0 and rows.max() < 319
    assert with_robot.mean() > 120  # well lit


def test_the_person_faces_the_same_way_is_as_tall_and_stands_beside(nao: RobotModel, person: Motion) -> None:
    time = np.arange(0.0, 10.0, 0.1)
    beside = np.tile([1.0, -0.5], (len(time), 1))
    turned = Motion("turned", person.time, person.landmarks @ yaw_matrix(2.0).T + np.array([3.0, 1.0, 0.0]))
    for motion in (person, turned):
        staged = stage_person(motion, time, time, 0.6, beside)
        across = staged[0, LANDMARK["l_hip"]] - staged[0, LANDMARK["r_hip"]]
        assert across[1] > 10.0 * abs(across[0])
        assert person_height(staged) == pytest.approx(0.6, rel=1e-6)
        assert 0.0 < staged[..., 2].min() < 0.03 and 0.5 < staged[0, :, 2].max() < 0.6
        np.testing.assert_allclose(staged[:, LANDMARK["pelvis"], :2], beside, atol=0.05)


def test_a_person_who_walks_away_is_kept_beside_the_robot() -> None:
    walk = builtin_motion("walk")
    time = np.arange(0.0, walk.duration, 0.1)
    staged = stage_person(walk, time, time, 0.6, np.zeros((len(time), 2)))
    assert np.ptp(walk.landmarks[:, LANDMARK["pelvis"], 0]) > 1.0
    assert np.abs(staged[:, LANDMARK["pelvis"], 0]).max() < 0.4


def test_a_person_without_legs_or_with_gaps_is_drawn_as_far_as_seen(person: Motion) -> None:
    time = np.arange(0.0, 5.0, 0.1)
    landmarks = person.landmarks.copy()
    landmarks[:, [LANDMARK[f"{side}_{name}"] for side in "lr" for name in ("knee", "ankle", "toe")]] = np.nan
    landmarks[5:8] = np.nan
    staged = stage_person(Motion("half", person.time, landmarks), time, time, 0.6, np.zeros((len(time), 2)))
    assert np.isfinite(staged[0, LANDMARK["head"]]).all()
    assert staged[0, LANDMARK["head"], 2] == pytest.approx(0.55, abs=0.04)


def test_the_person_holds_while_the_robot_imitates_nothing(person: Motion) -> None:
    time = np.array([0.0, 0.1, 0.2, 0.3])
    staged = stage_person(person, np.array([np.nan, 9.0, np.nan, 9.0]), time, 0.6, np.zeros((4, 2)))
    np.testing.assert_allclose(staged[2], staged[1])
    np.testing.assert_allclose(staged[3], staged[1])
    assert np.abs(staged[1] - staged[0]).max() > 0.01


@pytest.mark.usefixtures("gl")
def test_the_strip_has_a_column_a_moment_and_a_row_each_for_person_and_robot(
    nao: RobotModel, person: Motion, tmp_path: Path
) -> None:
    alone = imageio.imread(render_strip(nao, *run(nao), tmp_path / "alone.png", count=3))
    both = imageio.imread(render_strip(nao, *run(nao), tmp_path / "both.png", at=[0.0, 5.0], human=person))
    assert alone.shape == (PANEL_SIZE[1], 3 * PANEL_SIZE[0], 3)
    assert both.shape == (2 * PANEL_SIZE[1], 2 * PANEL_SIZE[0], 3)
    for row in range(2):
        panel = both[row * PANEL_SIZE[1] : (row + 1) * PANEL_SIZE[1], : PANEL_SIZE[0]]
        assert columns(panel, "r").mean() < columns(panel, "l").mean()


@pytest.mark.usefixtures("gl")
def test_the_video_lasts_as_long_as_the_run(nao: RobotModel, person: Motion, tmp_path: Path) -> None:
    time, *poses = run(nao, 9)
    path = render_video(nao, time, *poses, tmp_path / "run.mp4", fps=10.0, human=person)
    with imageio.get_reader(path) as video:
        frames = [np.asarray(frame) for frame in video]
    assert len(frames) == 9
    assert frames[0].shape == (VIDEO_SIZE[1], VIDEO_SIZE[0], 3)


def test_without_opengl_one_line_says_what_to_install(nao: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")
    with pytest.raises(RenderingUnavailable, match="apt install") as error:
        Stage(nao, 64, 64)
    assert "\n" not in str(error.value)


@pytest.mark.usefixtures("gl")
def test_a_broken_opengl_library_is_no_traceback(nao: RobotModel, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise mujoco.FatalError("gladLoadGL error\nmore")

    monkeypatch.setattr(mujoco, "MjrContext", broken)
    with pytest.raises(RenderingUnavailable, match="gladLoadGL"):
        Stage(nao, 64, 64)


def test_a_missing_software_renderer_does_not_spoil_the_others(tmp_path: Path) -> None:
    """In processes of their own, because MuJoCo and PyOpenGL read their variables when they are imported."""
    code = """
import importlib, os
from naoimitate.core.errors import RenderingUnavailable
from naoimitate.robot import load_robot
from naoimitate.sim.gl import Canvas
from naoimitate.sim.model import build_model
from naoimitate.sim import gl
real = importlib.import_module
def absent(name):
    real(name) if name == "mujoco.osmesa" else None
    raise ImportError(name)
gl.importlib.import_module = absent
try:
    Canvas(build_model(load_robot("nao")), 64, 64)
except RenderingUnavailable as error:
    assert "osmesa" in str(error), error
    print(os.environ.get("PYOPENGL_PLATFORM"))
"""
    for chosen in ("osmesa", "nonsense", ""):
        environment = {**os.environ, "MUJOCO_GL": chosen}
        environment.pop("PYOPENGL_PLATFORM", None)
        result = subprocess.run(
            [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
        )  # fmt: skip
        assert result.stdout == "None\n", result.stderr


def test_a_video_that_cannot_be_encoded_is_one_line(nao: RobotModel, tmp_path: Path, gl: None) -> None:
    time, *poses = run(nao, 3)
    with pytest.raises(RenderingUnavailable, match="No video") as error:
        render_video(nao, time, *poses, tmp_path / "absent" / "run.mp4", fps=10.0)
    assert "\n" not in str(error.value)


def test_without_a_screen_the_software_renderers_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert backends() == ("egl", "osmesa")
    monkeypatch.setenv("DISPLAY", ":0")
    assert backends()[0] == "glfw"
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert backends() == ("osmesa",)


def test_the_robots_height_is_that_of_its_highest_shape(nao: RobotModel) -> None:
    assert standing_height(nao) == pytest.approx(0.57, abs=0.01)

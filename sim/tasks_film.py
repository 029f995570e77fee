"""The film of a task: the scene from outside, and beside it what the robot's own cameras see."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np

from naoimitate.core.frames import Array
from naoimitate.sim.encoder import encoder
from naoimitate.sim.gl import Canvas, Image
from naoimitate.sim.tasks import Attempt

HEIGHT, OUTSIDE, INSIDE = 480, 640, 320
"""Pixels: of a picture, and the widths of the view from outside and of a camera's."""

RATE = 20.0
"""Pictures a second."""

MIDDLE, DISTANCE, AZIMUTH, ELEVATION = (0.10, -0.03, 0.22), 1.5, 130.0, -14.0
"""m and deg: what the view from outside looks at, and from where, as MuJoCo has them."""

MAX_GEOMS = 2000


class TaskStage:
    """Pictures of a task's world at any moment; a context manager. Raises RenderingUnavailable without OpenGL.

    cameras: names of the robot's own that are shown, above each other.
    """

    def __init__(self, model: mujoco.MjModel, cameras: Sequence[str]) -> None:
        self._model, self._data = model, mujoco.MjData(model)
        self._scene, self._options = mujoco.MjvScene(model, maxgeom=MAX_GEOMS), mujoco.MjvOption()
        self._eyes = [_eye(model.camera(name).id) for name in cameras]
        self._outside = Canvas(model, OUTSIDE, HEIGHT)
        self._inside = Canvas(model, INSIDE, HEIGHT // len(cameras)) if cameras else None

    def __enter__(self) -> TaskStage:
        return self

    def __exit__(self, *_: object) -> None:
        self._outside.close()
        if self._inside is not None:
            self._inside.close()

    def draw(self, positions: Array) -> Image:
        """Picture (H, W, 3) of the world at positions (n,), ``qpos`` of the model."""
        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        outside = self._look(_onlooker(), self._outside)
        if self._inside is None:
            return outside
        seen = [self._look(eye, self._inside) for eye in self._eyes]
        return np.concatenate([outside, np.concatenate(seen, axis=0)], axis=1)

    def _look(self, eye: mujoco.MjvCamera, canvas: Canvas) -> Image:
        every = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, self._data, self._options, None, eye, every, self._scene)
        return canvas.draw(self._scene)


def film_task(
    attempt: Attempt, cameras: Sequence[str], path: Path, progress: Callable[[float], None] | None = None
) -> Path:
    """Write an mp4 of an attempt at true speed; see ``TaskStage``. progress: told the share that is done."""
    time = attempt.time
    moments = np.arange(time[0], time[-1], 1.0 / RATE)
    attempt.model.vis.quality.offsamples = 0
    with TaskStage(attempt.model, cameras) as stage, encoder(path, RATE) as video:
        for number, frame in enumerate(np.searchsorted(time, moments)):
            video.append_data(stage.draw(attempt.moved.positions[frame]))
            if progress is not None:
                progress((number + 1) / len(moments))
    return path


def _eye(camera: int) -> mujoco.MjvCamera:
    eye = mujoco.MjvCamera()
    eye.type, eye.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera
    return eye


def _onlooker() -> mujoco.MjvCamera:
    eye = mujoco.MjvCamera()
    eye.lookat[:] = MIDDLE
    eye.distance, eye.azimuth, eye.elevation = DISTANCE, AZIMUTH, ELEVATION
    return eye

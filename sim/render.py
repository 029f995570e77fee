"""Videos and picture strips of a run: the robot as planned or as it moved, and the person beside it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw, ImageFont

from naoimitate.core.frames import Array, Motion
from naoimitate.robot.model import RobotModel
from naoimitate.sim.encoder import encoder
from naoimitate.sim.gl import Image
from naoimitate.sim.person import slow_part, stage_person
from naoimitate.sim.stage import Stage, View

VIDEO_SIZE = (960, 544)
PANEL_SIZE = (320, 400)
"""Width and height, pixels."""

BESIDE = 1.0
"""Distance of the person from the robot, in robot heights, to its right (left in a picture from the front)."""

CAMERA_TIME = 1.0
"""s: the camera follows the mean place of the robot over this time."""


def render_video(
    robot: RobotModel,
    time: Array,
    q: Array,
    base_pos: Array,
    base_quat: Array,
    path: str | Path,
    *,
    fps: float = 30.0,
    human: Motion | None = None,
    human_time: Array | None = None,
    hand_opening: Array | None = None,
    view: View | None = None,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write an mp4 of a run: time (T,) s, q (T, J) rad, torso (T, 3) m and (T, 4), as planned or as simulated.

    human: the person, as tall as the robot and at its right; human_time: (T,) s in their motion, default: since the
    first frame; hand_opening: (T, 2), 0 closed to 1 open, NaN as before, default closed; progress: told the share that
    is done. Raises RenderingUnavailable without OpenGL or an encoder.
    """
    frames = np.searchsorted(time, np.arange(time[0], time[-1] + 1e-9, 1.0 / fps), side="right") - 1
    path = Path(path)
    hands = _openings(hand_opening, len(time))
    with Stage(robot, *VIDEO_SIZE, smooth=False) as stage:
        people = _people(stage, human, human_time, time, base_pos)
        centre = _camera_path(base_pos, time)
        if people is not None:
            centre = centre - np.array([0.0, 0.5 * BESIDE * stage.robot_height])
        with encoder(path, fps) as video:
            for number, frame in enumerate(frames):
                pose = q[frame], base_pos[frame], base_quat[frame]
                person = None if people is None else people[frame]
                video.append_data(stage.draw(pose, centre[frame], view or View(), person, opening=hands[frame]))
                if progress is not None:
                    progress((number + 1) / len(frames))
    return path


def render_strip(
    robot: RobotModel,
    time: Array,
    q: Array,
    base_pos: Array,
    base_quat: Array,
    path: str | Path,
    *,
    count: int = 7,
    at: Sequence[float] | None = None,
    human: Motion | None = None,
    human_time: Array | None = None,
    hand_opening: Array | None = None,
    view: View | None = None,
) -> Path:
    """Write a PNG: the robot at equal steps of time, the person at the same moments in a row above.

    at: times (s) of the columns, in place of ``count`` even ones. The rest as ``render_video``.
    """
    moments = np.linspace(time[0], time[-1], count) if at is None else np.asarray(at, dtype=float)
    frames = np.clip(np.searchsorted(time, moments, side="right") - 1, 0, len(time) - 1)
    path = Path(path)
    hands = _openings(hand_opening, len(time))
    with Stage(robot, *PANEL_SIZE) as stage:
        people = _people(stage, human, human_time, time, base_pos, gap=0.0)
        view = view or View(distance=2.7)
        rows: list[list[Image]] = [[], []]
        for frame in frames:
            pose, centre = (q[frame], base_pos[frame], base_quat[frame]), base_pos[frame, :2]
            if people is not None:
                rows[0].append(stage.draw(pose, centre, view, people[frame], robot=False))
            rows[1].append(stage.draw(pose, centre, view, opening=hands[frame]))
    strip = np.concatenate([np.concatenate(row, axis=1) for row in rows if row], axis=0)
    _label(strip, [f"{moment:.1f} s" for moment in moments]).save(path)
    return path


def _people(
    stage: Stage,
    human: Motion | None,
    human_time: Array | None,
    time: Array,
    base_pos: Array,
    gap: float = BESIDE,
) -> Array | None:
    """Staged landmarks (T, 19, 3) m of the person, ``gap`` robot heights to the right of the robot."""
    if human is None:
        return None
    moments = time - time[0] if human_time is None else human_time
    beside = base_pos[:, :2] - np.array([0.0, gap * stage.robot_height])
    return stage_person(human, moments, time, stage.robot_height, beside)


def _camera_path(base_pos: Array, time: Array) -> Array:
    """Places on the floor (T, 2) m that the camera looks at: the robot's, without its sway."""
    return slow_part(base_pos[:, :2], time, CAMERA_TIME)


def _openings(hand_opening: Array | None, frames: int) -> Array:
    """Openings (T, 2) without NaN: the last known ones, at first closed."""
    if hand_opening is None:
        return np.zeros((frames, 2))
    known = np.where(np.isfinite(hand_opening), np.arange(frames)[:, None], -1)
    last = np.maximum.accumulate(known)
    return np.asarray(np.where(last < 0, 0.0, np.take_along_axis(hand_opening, np.maximum(last, 0), axis=0)))


def _label(strip: Image, labels: Sequence[str]) -> Pillow.Image:
    """Write one label under the top edge of each column."""
    picture = Pillow.fromarray(strip)
    pen = ImageDraw.Draw(picture)
    font = ImageFont.load_default(size=22)
    for column, label in enumerate(labels):
        pen.text(((column + 0.5) * PANEL_SIZE[0], 10), label, fill=(40, 44, 52), font=font, anchor="mt")
    return picture

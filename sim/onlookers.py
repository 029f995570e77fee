"""What the processes do that look at a running simulation: one has a window, one makes a film; see ``sim.watch``.

An onlooker gets the model, the shared positions and a line to its parent. Over the line it says ``None`` once it shows
something, and else a sentence. It ends when the parent says anything, and when the parent is no more.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import mujoco

from naoimitate.core.errors import RenderingUnavailable
from naoimitate.sim.encoder import encoder
from naoimitate.sim.gl import Canvas, Image, no_window
from naoimitate.sim.positions import Positions

Onlooker = Callable[..., None]
"""Called with model, positions, line, and what it needs itself."""

FREE = "free"
"""The camera that belongs to nobody: it looks at the robot's torso from the front."""

NICENESS = 10
"""Of the processes: a simulation on a machine with few cores goes before its pictures."""

FILM_RATE = 20.0
"""Pictures a second of a film."""

FILM_SIZE = (640, 480)
"""Width and height, pixels; the shape of most cameras of robots."""

FILM_OPTIONS = ("-preset", "veryfast", "-threads", "1")
"""Of the encoder: little work in each picture."""

WINDOW_PERIOD = 1.0 / 30.0
"""s between two looks of the window at the positions."""

CLOSING_TIME = 5.0
"""s that MuJoCo may take to close its window."""

FREE_DISTANCE, FREE_AZIMUTH, FREE_ELEVATION = 1.6, 150.0, -12.0
"""m and deg, of the free camera from the torso."""

MAX_GEOMS = 2000


def film(model: mujoco.MjModel, positions: Positions, line: Connection, camera: str, path: str) -> None:
    """Write an mp4 file of what a camera sees. Its clock is the wall's: a picture that comes late is made up for by
    repeating the one before."""
    _stand_back()
    model.vis.quality.offsamples = 0
    try:
        draw = _painter(model, positions, camera)
        with encoder(Path(path), FILM_RATE, FILM_OPTIONS) as video:
            picture = draw()
            video.append_data(picture)
            _say(line, None)
            written, repeated = _shoot(draw, video, picture, line)
        _say(line, f"{path}: {written / FILM_RATE:.1f} s, {repeated / written:.0%} of the pictures shown twice")
    except RenderingUnavailable as error:
        _say(line, str(error))


def _shoot(draw: Callable[[], Image], video: Any, picture: Image, line: Connection) -> tuple[int, int]:
    """Pictures until the parent ends it; returns how many there are, and how many of them are repetitions."""
    begin, written, repeated = time.monotonic(), 1, 0
    while not line.poll(max(0.0, begin + written / FILM_RATE - time.monotonic())):
        fresh = draw()
        due = max(1, int((time.monotonic() - begin) * FILM_RATE) + 1 - written)
        for _ in range(due - 1):
            video.append_data(picture)
        video.append_data(fresh)
        picture, written, repeated = fresh, written + due, repeated + due - 1
    return written, repeated


def _painter(model: mujoco.MjModel, positions: Positions, camera: str) -> Callable[[], Image]:
    """A function that draws the newest positions; RenderingUnavailable without OpenGL."""
    canvas, data = Canvas(model, *FILM_SIZE), mujoco.MjData(model)
    scene, options = mujoco.MjvScene(model, maxgeom=MAX_GEOMS), mujoco.MjvOption()
    eye = mujoco.MjvCamera()

    def draw() -> Image:
        _pose(model, data, positions)
        _aim(eye, model, camera)
        mujoco.mjv_updateScene(model, data, options, None, eye, mujoco.mjtCatBit.mjCAT_ALL, scene)
        return canvas.draw(scene)

    return draw


def window(model: mujoco.MjModel, positions: Positions, line: Connection, camera: str) -> None:
    """Show MuJoCo's viewer until it is closed or the parent ends it."""
    _stand_back()
    reason = no_window()
    if reason is not None:
        _say(line, f"No window: {reason}; all else goes on")
        return
    import mujoco.viewer

    data = mujoco.MjData(model)
    _pose(model, data, positions)
    viewer = mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    with viewer.lock():
        _aim(viewer.cam, model, camera)
    _say(line, None)
    while viewer.is_running() and not line.poll(WINDOW_PERIOD):
        with viewer.lock():
            _pose(model, data, positions)
        viewer.sync()
    if not line.poll():
        _say(line, "the window was closed; all else goes on")
    viewer.close()
    for thread in threading.enumerate():  # MuJoCo's own draws on: the program must not end under it
        if thread is not threading.current_thread():
            thread.join(CLOSING_TIME)


def _stand_back() -> None:
    """Leave the processor to others, and Ctrl-C to the parent, who says when to end; SIGTERM ends as properly."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    os.nice(NICENESS)
    os.environ.setdefault("LP_NUM_THREADS", "1")  # Mesa's software renderer would take every core


def _say(line: Connection, what: str | None) -> None:
    """Tell the parent, if it is still there."""
    with contextlib.suppress(OSError):
        line.send(what)


def _pose(model: mujoco.MjModel, data: mujoco.MjData, positions: Positions) -> None:
    """Move everything to the newest positions."""
    data.time, data.qpos[:] = positions.read()
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)


def _aim(eye: mujoco.MjvCamera, model: mujoco.MjModel, camera: str) -> None:
    """Look through a camera by name, or freely at the robot, following it."""
    if camera != FREE:
        eye.type, eye.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, model.camera(camera).id
        return
    eye.type = mujoco.mjtCamera.mjCAMERA_TRACKING
    eye.trackbodyid = int(model.jnt_bodyid[model.joint("base").id])
    eye.distance, eye.azimuth, eye.elevation = FREE_DISTANCE, FREE_AZIMUTH, FREE_ELEVATION

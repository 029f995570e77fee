"""Off-screen OpenGL: a canvas that turns a MuJoCo scene into an array of pixels, with or without a screen."""

from __future__ import annotations

import importlib
import os
import sys
import warnings
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt

from naoimitate.core.errors import RenderingUnavailable

Image = npt.NDArray[np.uint8]

NO_GL = (
    "No pictures: OpenGL does not work here ({reason}). Install a software renderer (Debian, Ubuntu: apt install "
    "libegl1 libgl1-mesa-dri, or libosmesa6), or set MUJOCO_GL to egl, osmesa or glfw; all but pictures works without"
)


PLATFORM = "PYOPENGL_PLATFORM"
"""Environment variable that PyOpenGL obeys; MuJoCo's modules set it for good when they are imported."""


class Canvas:
    """Draws scenes of one model. Raises RenderingUnavailable, with what to install, where no OpenGL works."""

    def __init__(self, model: mujoco.MjModel, width: int, height: int) -> None:
        reasons = []
        platform = os.environ.get(PLATFORM)
        for backend in backends():
            try:
                self._open(backend, model, width, height)
                break
            except Exception as error:  # every library fails in its own way
                reasons.append(f"{backend}: {_reason(error)}")
                _forget(backend, platform)
        else:
            raise RenderingUnavailable(NO_GL.format(reason="; ".join(reasons) or "MUJOCO_GL forbids it"))
        self._size = mujoco.MjrRect(0, 0, width, height)

    def _open(self, backend: str, model: mujoco.MjModel, width: int, height: int) -> None:
        if backend == "glfw":
            _need_display()
        self._context: Any = importlib.import_module(f"mujoco.{backend}").GLContext(width, height)
        self._context.make_current()
        self._painter: Any = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_150)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._painter)

    def draw(self, scene: mujoco.MjvScene) -> Image:
        """Picture (H, W, 3) of a scene."""
        self._context.make_current()
        mujoco.mjr_render(self._size, scene, self._painter)
        picture = np.empty((self._size.height, self._size.width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(picture, None, self._size, self._painter)
        return picture[::-1]  # OpenGL's first row is the lowest

    def close(self) -> None:
        """Give the graphics memory back."""
        self._context.make_current()
        self._painter.free()
        self._context.free()


def _need_display() -> None:
    """Raise RuntimeError where no window can be made: MuJoCo would go on without a context, and then abort."""
    reason = no_window()
    if reason is not None:
        raise RuntimeError(reason)


def no_window() -> str | None:
    """Why no window with OpenGL can be opened here; None when one can."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return "there is no display (DISPLAY is not set)"
    import glfw

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", glfw.GLFWError)
        if not glfw.init():
            return f"the display {os.environ.get('DISPLAY', '')} does not answer"
        glfw.window_hint(glfw.VISIBLE, False)
        trial = glfw.create_window(64, 64, "", None, None)
        if trial:
            glfw.destroy_window(trial)
        glfw.default_window_hints()
    return None if trial else f"OpenGL does not work on the display {os.environ.get('DISPLAY', '')}"


def _reason(error: Exception) -> str:
    """Why a backend failed, in a few words; PyOpenGL has a missing library as an attribute of None."""
    if isinstance(error, ImportError | AttributeError):
        return "not installed"
    return (str(error) or type(error).__name__).splitlines()[0]


def _forget(backend: str, platform: str | None) -> None:
    """Undo the import of a backend that failed: PyOpenGL stays with its first platform, and no other could be tried.

    platform: value of ``PYOPENGL_PLATFORM`` before the import.
    """
    for name in list(sys.modules):
        if name.split(".")[0] == "OpenGL" or name.startswith(f"mujoco.{backend}"):
            del sys.modules[name]
    os.environ.pop(PLATFORM, None)
    if platform is not None:
        os.environ[PLATFORM] = platform


def backends() -> tuple[str, ...]:
    """MuJoCo's OpenGL modules worth trying, in order: the user's ``MUJOCO_GL``, else what suits the machine.

    Chosen here and not left to MuJoCo, which reads the variable only once, when it is imported first.
    """
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    if chosen in ("off", "false", "0", "disable", "disabled"):
        return ()
    if chosen in ("egl", "osmesa", "glfw", "cgl"):
        return (chosen,)
    if not sys.platform.startswith("linux"):
        return ("cgl", "glfw") if sys.platform == "darwin" else ("glfw",)
    return ("glfw", "egl", "osmesa") if os.environ.get("DISPLAY") else ("egl", "osmesa")

"""The robot in MuJoCo: model, driver, simulation of a plan, pictures."""

from __future__ import annotations

import os


def _import_mujoco() -> None:
    """Import MuJoCo without its own choice of OpenGL, which fails where ``MUJOCO_GL`` names a library that is missing.

    ``sim.gl`` chooses when a picture is asked for; all the rest of MuJoCo needs no OpenGL.
    """
    chosen = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        import mujoco  # noqa: F401
    finally:
        del os.environ["MUJOCO_GL"]
        if chosen is not None:
            os.environ["MUJOCO_GL"] = chosen


_import_mujoco()

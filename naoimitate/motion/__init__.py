"""Recorded and built-in motions: ``load_motion`` makes one ``Motion`` of any of them."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Motion
from naoimitate.motion.stretch import stretch

__all__ = ["load_motion"]

BUILTIN = "builtin:"
"""Beginning of the names of built-in motions."""


def load_motion(
    spec: str | PathLike[str],
    *,
    fps: float | None = None,
    unit: float | None = None,
    up: str | None = None,
    skeleton: str | PathLike[str] | None = None,
    tpose_at: float | str = "auto",
    start: float | None = None,
    end: float | None = None,
) -> Motion:
    """A motion from a file (BVH, AMC with its ASF, MVNX, DeepMimic) or, as ``builtin:NAME``, from the program itself.

    fps: frames per second, unit: metres per unit of the file, up: its axis ``y`` or ``z``; None finds them out, and the
    motion's notes say what was found. skeleton: the ASF or character file of formats whose skeleton is a file of its
    own. tpose_at: second of the T-pose, ``auto`` finds one, ``none`` makes one of the skeleton's lengths. start, end:
    seconds from the file's first frame between which the motion is wanted; times keep counting from the first frame.

    Raises MotionFormatError, one line that says what to do, for whatever is wrong with the file or these wishes.
    """
    name = fspath(spec)
    if name.startswith(BUILTIN):
        chosen_tpose = None if tpose_at == "auto" else tpose_at
        wishes = {"fps": fps, "unit": unit, "up": up, "skeleton": skeleton, "tpose-at": chosen_tpose}
        motion = _builtin(name.removeprefix(BUILTIN), [key for key, wish in wishes.items() if wish is not None])
    else:
        from naoimitate.motion.load import load_file
        from naoimitate.motion.scene import Options

        chosen = None if skeleton is None else Path(skeleton)
        motion = load_file(Path(name), Options(fps, unit, up, chosen, tpose_at))
    return stretch(motion, start, end)


def _builtin(name: str, wishes: list[str]) -> Motion:
    from naoimitate.motion.builtin import builtin_motion

    if wishes:
        raise MotionFormatError(f"--{wishes[0]} is for files, the built-in motion {name} is exact: leave it away")
    return builtin_motion(name)

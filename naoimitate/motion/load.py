"""Any motion file to one ``Motion``: read, recognised, in metres, z up, at its true rate, with a T-pose."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, Array, Motion
from naoimitate.core.geometry import yaw_matrix
from naoimitate.human.support import annotate
from naoimitate.motion.calibration import Calibration, calibrate, calibration_frame
from naoimitate.motion.clip import Clip
from naoimitate.motion.person import landmarks_of, orientations_of, person
from naoimitate.motion.rate import true_rate
from naoimitate.motion.readers import read
from naoimitate.motion.repair import bridged, teleports
from naoimitate.motion.scene import Options, Scene, scene_of
from naoimitate.motion.tpose import heading


def load_file(path: Path, options: Options) -> Motion:
    """Read a motion file.

    Raises MotionFormatError, which names the file.
    """
    try:
        with np.errstate(all="ignore"):  # damaged numbers become gaps, and gaps are bridged or said
            return annotate(*recorded(path, options))
    except MotionFormatError as error:
        raise MotionFormatError(f"{path.name}: {error}" if path.name not in str(error) else str(error)) from error


def recorded(path: Path, options: Options) -> tuple[Motion, Array]:
    """The motion of a file over its own floor, which may be tilted or not at z = 0, and the points of its feet.

    These are (T, 2, 3, 3) m, ankle, ball and tip of the toes where the skeleton itself has them, else NaN.
    """
    clip, data = read(path, options.skeleton)
    scene = scene_of(clip, options)
    rate, rate_note = true_rate(clip, scene.motion[scene.added :].landmarks, path.name, scene.family, options.fps)
    whole, damage = bridged(scene.motion, rate)
    scene = replace(scene, motion=whole)
    time = _times(clip, rate, options.fps)
    calibration = calibrate(scene, time, rate, options.tpose_at)
    who = person(calibration.reference, scene.head_is_joint)
    turn, shift = _world(scene, calibration)
    kept, time = scene.motion[scene.added :].turned(turn), time[scene.added :]
    landmarks = landmarks_of(who, kept) + shift
    notes = [*scene.notes, rate_note, _left_out(scene.added), *damage, teleports(landmarks, time), who.note]
    motion = Motion(
        name=path.stem,
        time=time,
        landmarks=landmarks,
        orientations=orientations_of(who, kept),
        com=None if scene.com is None else scene.com[scene.added :] @ turn.T + shift,
        contacts=None if clip.contacts is None else clip.contacts[scene.added :],
        tpose=calibration_frame(who, calibration, np.zeros(2)),
        tpose_note=calibration.note,
        source=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        notes=tuple(note for note in notes if note),
    )
    return motion, kept.feet + shift


def _left_out(frames: int) -> str:
    """A sentence about frames at the start that are no motion, empty when there are none."""
    if not frames:
        return ""
    said = "The first frame is" if frames == 1 else f"The first {frames} frames are"
    return f"{said} no motion (a T-pose and what follows it) and left out."


def _times(clip: Clip, rate: float, asked: float | None) -> Array:
    """Time of every frame from the file's first one, s."""
    if clip.time is not None and asked is None and clip.rate is not None:
        return clip.time * (clip.rate / rate)
    return np.arange(len(clip)) / rate


def _world(scene: Scene, calibration: Calibration) -> tuple[Array, Array]:
    """Turn (3, 3) about z and shift (3,) that make the person face x and start with the hips over the origin.

    The heading is that of the T-pose when it is a moment of the motion, else that of the first frame.
    """
    known = np.isfinite(scene.motion.landmarks[scene.added :, LANDMARK["pelvis"]]).all(axis=-1)
    if not known.any():
        raise MotionFormatError("the hips are in no frame of the motion: export the clip again")
    start = scene.added + int(np.argmax(known))
    facing = calibration.frame if calibration.frame is not None else start
    turn = np.asarray(yaw_matrix(-heading(scene.motion.landmarks[facing])))
    origin = turn @ scene.motion.landmarks[start, LANDMARK["pelvis"]]
    return turn, np.array([-origin[0], -origin[1], 0.0])

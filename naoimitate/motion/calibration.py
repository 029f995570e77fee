"""The T-pose of a recording: where the user says, the file's own, an added or a held one, or one that is made."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, SEGMENT, Array, HumanFrame
from naoimitate.core.geometry import yaw_matrix
from naoimitate.motion.families import BOWED_HEAD
from naoimitate.motion.person import Person, landmarks_of, orientations_of, placed, reference_frame
from naoimitate.motion.reference import Reference, best_standing_frame, from_frame, from_rest
from naoimitate.motion.repair import NEEDED
from naoimitate.motion.scene import Scene
from naoimitate.motion.tpose import heading, held_tpose, is_tpose
from naoimitate.motion.track import Track

FROM_LENGTHS = "No T-pose in the file: made of the skeleton's own segment lengths"


@dataclass(frozen=True)
class Calibration:
    """A T-pose. reference: straightened. measured: as recorded (T = 1), None when it was made.

    frame: its number in the file when it is a moment of the motion. note: where it comes from, a sentence.
    """

    reference: Reference
    measured: Track | None
    frame: int | None
    note: str


def calibrate(scene: Scene, time: Array, rate: float, tpose_at: float | str) -> Calibration:
    """Find or make the T-pose of a recording whose frames are at ``time`` (T,) s.

    Raises MotionFormatError when the moment asked for is not in the file, or nobody stands at it.
    """
    if isinstance(tpose_at, (int, float)):
        chosen = _asked(scene, time, float(tpose_at))
    elif tpose_at in ("auto", "none"):
        chosen = (_found(scene, time, rate) if tpose_at == "auto" else None) or _made(scene, time)
    else:
        raise MotionFormatError(f"the T-pose moment {tpose_at!r} is unknown: give seconds, auto or none")
    if not _is_whole(chosen.reference.landmarks):
        raise MotionFormatError("the person does not stand where the T-pose is taken: say --tpose-at or --up")
    return chosen


def calibration_frame(who: Person, calibration: Calibration, place: Array) -> HumanFrame:
    """The T-pose as a frame over a place (2,) m on the floor, facing x: as measured, else as made."""
    frame = reference_frame(who)
    if calibration.measured is not None:
        turn = np.asarray(yaw_matrix(-heading(calibration.measured.landmarks[0])))
        measured = calibration.measured.turned(turn)
        points = landmarks_of(who, measured)[0]
        ankles = [LANDMARK["l_ankle"], LANDMARK["r_ankle"]]
        points[:, 2] += frame.landmarks[ankles, 2].mean() - points[ankles, 2].mean()
        frame = HumanFrame(0.0, points, orientations_of(who, measured)[0])
    return placed(frame, place)


def _found(scene: Scene, time: Array, rate: float) -> Calibration | None:
    """The file's own T-pose, an added first frame, or one that is held."""
    if scene.tpose is not None and bool(is_tpose(scene.tpose.landmarks)[0]):
        reference = from_frame(scene.tpose, 0, scene.rest)
        return Calibration(reference, scene.tpose, None, "The T-pose is the file's own calibration posture.")
    if scene.added and bool(is_tpose(scene.motion.landmarks[:1])[0]):
        added = _head_raised(scene.motion[:1]) if scene.family in BOWED_HEAD else scene.motion[:1]
        return Calibration(from_frame(added, 0, scene.rest), added, None, "The T-pose is the added first frame.")
    held = held_tpose(scene.motion.landmarks[scene.added :], rate)
    if held is None:
        return None
    frame = scene.added + held
    note = f"The T-pose is the one held at {time[frame]:.2f} s."
    return Calibration(from_frame(scene.motion, frame, scene.rest), scene.motion[frame : frame + 1], frame, note)


def _made(scene: Scene, time: Array) -> Calibration:
    """A T-pose of the skeleton's lengths, straightened from its rest pose or from its most upright frame."""
    reference = from_rest(scene.rest)
    if reference is not None:
        return Calibration(reference, None, None, f"{FROM_LENGTHS}.")
    frame = scene.added + best_standing_frame(scene.motion.landmarks[scene.added :])
    if not _is_whole(scene.motion.landmarks[frame]):
        raise MotionFormatError("limbs are missing in every frame: export the clip again")
    note = f"{FROM_LENGTHS}, from the most upright frame, at {time[frame]:.2f} s."
    return Calibration(from_frame(scene.motion, frame, scene.rest), None, None, note)


def _asked(scene: Scene, time: Array, moment: float) -> Calibration:
    if not (math.isfinite(moment) and 0.0 <= moment <= time[-1] + 1e-9):
        raise MotionFormatError(f"there is no T-pose at {moment:g} s: the file lasts {time[-1]:.2f} s")
    frame = int(np.argmin(np.abs(time - moment)))
    posture = scene.motion[frame : frame + 1]
    if not _is_whole(posture.landmarks[0]):
        raise MotionFormatError(f"limbs are missing at {moment:g} s: choose another moment with --tpose-at")
    note = f"The T-pose is the frame at {time[frame]:.2f} s as asked"
    note += "." if bool(is_tpose(posture.landmarks)[0]) else ", though the posture there is none."
    moving = frame if frame >= scene.added else None
    return Calibration(from_frame(scene.motion, frame, scene.rest), posture, moving, note)


def _is_whole(landmarks: Array) -> bool:
    """Whether no joint of arms and legs is missing in one posture (19, 3)."""
    return bool(np.isfinite(landmarks[[LANDMARK[name] for name in NEEDED]]).all())


def _head_raised(posture: Track) -> Track:
    """The posture with the head turned like the chest, as in the rest pose."""
    turns = posture.turns.copy()
    turns[:, SEGMENT["head"]] = turns[:, SEGMENT["chest"]]
    return replace(posture, turns=turns)

"""Any motion file to one ``Motion``: read, recognised, in metres, z up, at its true rate, with a T-pose."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import LANDMARK, SEGMENT, Array, HumanFrame, Motion
from naoimitate.core.geometry import yaw_matrix
from naoimitate.human.support import annotate
from naoimitate.motion.clip import Clip
from naoimitate.motion.families import BOWED_HEAD, restored
from naoimitate.motion.person import Person, landmarks_of, orientations_of, person, placed, reference_frame
from naoimitate.motion.rate import true_rate
from naoimitate.motion.readers import read
from naoimitate.motion.recognise import leg_length, recognise
from naoimitate.motion.reference import Reference, best_standing_frame, from_frame, from_rest
from naoimitate.motion.repair import bridged, teleports
from naoimitate.motion.tpose import across, added_frames, held_tpose, is_tpose
from naoimitate.motion.track import Track, has_head_bone, track, track_of
from naoimitate.motion.units import Y_UP, metres_per_unit, up_axis


@dataclass(frozen=True)
class Options:
    """What the user says about a file; None where the file shall tell. See ``load_motion``."""

    fps: float | None = None
    unit: float | None = None
    up: str | None = None
    skeleton: Path | None = None
    tpose_at: float | str = "auto"


@dataclass(frozen=True)
class _Scene:
    """A clip in metres, z up. clip: as read. added: frames at the start that are no motion. notes: so far."""

    clip: Clip
    motion: Track
    rest: Track
    tpose: Track | None
    head_is_joint: bool
    family: str
    com: Array | None
    added: int
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Calibration:
    """A T-pose: its frame in the file, or None when it is none of the motion's; the reference it gives; a sentence."""

    reference: Reference
    measured: Track | None
    frame: int | None
    note: str


def load_file(path: Path, options: Options) -> Motion:
    """Read a motion file.

    Raises MotionFormatError.
    """
    clip, data = read(path, options.skeleton)
    scene = _scene(clip, options)
    rate, rate_note = true_rate(clip, scene.motion[scene.added :].landmarks, path.name, scene.family, options.fps)
    motion, damage = bridged(scene.motion, rate)
    scene = replace(scene, motion=motion)
    time = _times(clip, rate, options.fps)
    calibration = _calibrate(scene, time, rate, options.tpose_at)
    who = person(calibration.reference, scene.head_is_joint)
    turn, shift = _world(scene, calibration)
    kept = scene.motion[scene.added :].turned(turn)
    landmarks = landmarks_of(who, kept) + shift
    jump = teleports(landmarks, time[scene.added :])
    added = (
        f"The first {scene.added} frames are no motion (a T-pose and what follows it) and are left out."
        if scene.added
        else ""
    )
    notes = [*scene.notes, rate_note, added, *damage, jump, who.note]
    result = Motion(
        name=path.stem,
        time=time[scene.added :],
        landmarks=landmarks,
        orientations=orientations_of(who, kept),
        com=None if scene.com is None else scene.com[scene.added :] @ turn.T + shift,
        contacts=None if clip.contacts is None else clip.contacts[scene.added :],
        tpose=_tpose_frame(who, calibration, landmarks),
        tpose_note=calibration.note,
        source=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        notes=tuple(note for note in notes if note),
    )
    return annotate(result)


def _scene(clip: Clip, options: Options) -> _Scene:
    """Recognise the person, and bring everything to metres and z up."""
    clip = restored(clip)
    anatomy = recognise(clip)
    motion, rest = track(clip, anatomy), track_of(clip, anatomy, clip.rest)
    up, up_note = up_axis(motion, rest, clip.up, options.up)
    unit, unit_note = metres_per_unit(leg_length(clip.skeleton, anatomy.nodes), clip.unit, options.unit)
    turn = Y_UP if up == "y" else np.eye(3)
    motion = motion.mapped(turn, unit)
    return _Scene(
        clip=clip,
        motion=motion,
        rest=rest.mapped(turn, unit),
        tpose=None if clip.tpose is None else track_of(clip, anatomy, clip.tpose).mapped(turn, unit),
        head_is_joint=anatomy.head is not None and not has_head_bone(clip.skeleton.rest, anatomy),
        family=anatomy.family,
        com=None if clip.com is None else unit * clip.com @ turn.T,
        added=added_frames(motion),
        notes=(f"{clip.format} file, skeleton: {anatomy.family}.", *clip.notes, unit_note, up_note),
    )


def _times(clip: Clip, rate: float, asked: float | None) -> Array:
    """Time of every frame from the file's first one, s."""
    if clip.time is not None and asked is None and clip.rate is not None:
        return clip.time * (clip.rate / rate)
    return np.arange(len(clip)) / rate


def _calibrate(scene: _Scene, time: Array, rate: float, tpose_at: float | str) -> _Calibration:
    """The T-pose: where the user says, the file's own, an added or held one, or one made of the skeleton."""
    if isinstance(tpose_at, (int, float)):
        return _asked(scene, time, float(tpose_at))
    if tpose_at not in ("auto", "none"):
        raise MotionFormatError(f"the T-pose moment {tpose_at!r} is unknown: give seconds, auto or none")
    if tpose_at == "auto":
        if scene.tpose is not None:
            return _Calibration(
                from_frame(scene.tpose, 0, scene.rest),
                scene.tpose,
                None,
                "The T-pose is the file's own calibration posture.",
            )
        if scene.added and bool(is_tpose(scene.motion.landmarks[:1])[0]):
            added = _head_raised(scene.motion[:1]) if scene.family in BOWED_HEAD else scene.motion[:1]
            return _Calibration(from_frame(added, 0, scene.rest), added, None, "The T-pose is the added first frame.")
        held = held_tpose(scene.motion.landmarks[scene.added :], rate)
        if held is not None:
            frame = scene.added + held
            note = f"The T-pose is the one held at {time[frame]:.2f} s."
            return _Calibration(
                from_frame(scene.motion, frame, scene.rest), scene.motion[frame : frame + 1], frame, note
            )
    reference = from_rest(scene.rest)
    if reference is not None:
        return _Calibration(
            reference, None, None, "No T-pose in the file: made from the skeleton's own segment lengths."
        )
    frame = scene.added + best_standing_frame(scene.motion.landmarks[scene.added :])
    note = f"No T-pose in the file: made from its segment lengths and its most upright frame, at {time[frame]:.2f} s."
    return _Calibration(from_frame(scene.motion, frame, scene.rest), None, None, note)


def _head_raised(posture: Track) -> Track:
    """The posture with the head turned like the chest, as in the rest pose."""
    turns = posture.turns.copy()
    turns[:, SEGMENT["head"]] = turns[:, SEGMENT["chest"]]
    return Track(posture.landmarks, turns)


def _asked(scene: _Scene, time: Array, moment: float) -> _Calibration:
    if not (math.isfinite(moment) and 0.0 <= moment <= time[-1] + 1e-9):
        raise MotionFormatError(f"there is no T-pose at {moment:g} s: the file lasts {time[-1]:.2f} s")
    frame = int(np.argmin(np.abs(time - moment)))
    posture = scene.motion[frame : frame + 1]
    if not np.isfinite(posture.landmarks[0, LANDMARK["pelvis"]]).all():
        raise MotionFormatError(f"the person is missing at {moment:g} s: choose another moment with --tpose-at")
    note = f"The T-pose is the frame at {time[frame]:.2f} s as asked"
    note += "." if bool(is_tpose(posture.landmarks)[0]) else ", though the posture there is none."
    return _Calibration(
        from_frame(scene.motion, frame, scene.rest), posture, frame if frame >= scene.added else None, note
    )


def _world(scene: _Scene, calibration: _Calibration) -> tuple[Array, Array]:
    """Turn (3, 3) about z and shift (3,) that make the person face x and start over the origin.

    The heading is that of the T-pose when it is a moment of the motion, else that of the first frame.
    """
    start = _first_known(scene.motion.landmarks, scene.added)
    frame = calibration.frame if calibration.frame is not None else start
    turn = np.asarray(yaw_matrix(-_heading(scene.motion.landmarks[frame])))
    origin = turn @ scene.motion.landmarks[start, LANDMARK["pelvis"]]
    return turn, np.array([-origin[0], -origin[1], 0.0])


def _first_known(landmarks: Array, added: int) -> int:
    known = np.isfinite(landmarks[added:, LANDMARK["pelvis"]]).all(axis=-1)
    if not known.any():
        raise MotionFormatError("the hips are in no frame of the motion: export the clip again")
    return added + int(np.argmax(known))


def _heading(landmarks: Array) -> float:
    """Yaw of the person's forward direction; of a person who lies, of the direction from hips to shoulders, rad."""
    left = across(landmarks)
    if np.isfinite(left).all():
        return math.atan2(-left[0], left[1])
    body = landmarks[LANDMARK["l_shoulder"]] + landmarks[LANDMARK["r_shoulder"]] - 2.0 * landmarks[LANDMARK["pelvis"]]
    return math.atan2(body[1], body[0]) if np.isfinite(body).all() else 0.0


def _tpose_frame(who: Person, calibration: _Calibration, landmarks: Array) -> HumanFrame:
    """The calibration frame where the motion starts, facing x: measured where there is one, else made."""
    known = landmarks[np.isfinite(landmarks[:, LANDMARK["pelvis"]]).all(axis=-1)]
    frame = reference_frame(who)
    if calibration.measured is not None:
        measured = calibration.measured.turned(np.asarray(yaw_matrix(-_heading(calibration.measured.landmarks[0]))))
        points = landmarks_of(who, measured)[0]
        ankles = [LANDMARK["l_ankle"], LANDMARK["r_ankle"]]
        points[:, 2] += frame.landmarks[ankles, 2].mean() - points[ankles, 2].mean()
        frame = HumanFrame(0.0, points, orientations_of(who, measured)[0])
    return placed(frame, known[0, LANDMARK["pelvis"], :2])

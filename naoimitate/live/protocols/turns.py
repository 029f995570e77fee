"""Orientations of segments from a stream whose joint frames are unknown: a T-pose in the stream tells them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from naoimitate.core.frames import LANDMARK, LANDMARKS, SEGMENTS, Array
from naoimitate.motion.reference import Reference, from_frame
from naoimitate.motion.tpose import is_tpose
from naoimitate.motion.track import Track

Known = npt.NDArray[np.bool_]

HOLD = 0.5
"""s that a T-pose must last before it is taken; the session asks for more."""
RAISED = 0.35
"""m that wrists may be off the shoulders' height in a posture that is worth a closer look."""
_ARMS = [LANDMARK[name] for name in ("l_shoulder", "r_shoulder", "l_wrist", "r_wrist")]
_TIPS = np.full((1, 2, 3), np.nan)
_NO_REST = Track(np.full((1, len(LANDMARKS), 3), np.nan), np.full((1, len(SEGMENTS), 3, 3), np.nan), _TIPS)


class SegmentTurns:
    """Keeps one person's joint rotations of the last T-pose that was held; feed it every frame once."""

    def __init__(self) -> None:
        self._reference: Rotation | None = None
        self._known: Known = np.zeros(len(SEGMENTS), dtype=bool)
        self._since: float | None = None
        self._taken = False

    def update(self, time: float, landmarks: Array, joints: Array) -> Array | None:
        """Orientations (7, 4) (w, x, y, z) as in ``HumanFrame``; None before the first T-pose.

        time: s, the sender's. landmarks: (19, 3) m. joints: (7, 4), world from the joints that turn ``SEGMENTS``, in
        their own frames, NaN where unknown.
        """
        if not _perhaps_tpose(landmarks) or not bool(is_tpose(landmarks[None])[0]):
            self._since, self._taken = None, False
        elif self._since is None or time < self._since:
            self._since = time
        elif not self._taken and time - self._since >= HOLD:
            self._take(landmarks, joints)
            self._taken = True
        if self._reference is None:
            return None
        known: Known = np.asarray(self._known & np.isfinite(joints).all(axis=-1))
        turned = _rotations(joints, known) * self._reference.inv()
        return np.where(known[:, None], np.roll(turned.as_quat(canonical=True), 1, axis=-1), np.nan)

    def _take(self, landmarks: Array, joints: Array) -> None:
        known: Known = np.asarray(np.isfinite(joints).all(axis=-1))
        turns = _rotations(joints, known).as_matrix()
        with np.errstate(invalid="ignore"):
            reference: Reference = from_frame(Track(landmarks[None], turns[None], _TIPS), 0, _NO_REST)
        self._known = np.asarray(known & np.isfinite(reference.turns).all(axis=(-1, -2)))
        self._reference = Rotation.from_matrix(np.where(self._known[:, None, None], reference.turns, np.eye(3)))


def _perhaps_tpose(landmarks: Array) -> bool:
    """A quick no to most postures: both wrists are near the height of their shoulders."""
    left, right, left_wrist, right_wrist = landmarks[_ARMS, 2]
    return bool(abs(left_wrist - left) < RAISED and abs(right_wrist - right) < RAISED)


def _rotations(joints: Array, known: Known) -> Rotation:
    """Rotations of joints (7, 4) (w, x, y, z); unknown ones are no rotation."""
    return Rotation.from_quat(np.where(known[:, None], np.roll(joints, -1, axis=-1), [0.0, 0.0, 0.0, 1.0]))

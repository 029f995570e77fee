"""The two types that flow through the program: a person's frame comes in, a robot's command goes out."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

SIDES = ("l", "r")
LANDMARKS = (
    "pelvis", "chest", "head",
    "l_shoulder", "l_elbow", "l_wrist", "l_hand", "l_hip", "l_knee", "l_ankle", "l_toe",
    "r_shoulder", "r_elbow", "r_wrist", "r_hand", "r_hip", "r_knee", "r_ankle", "r_toe",
)  # fmt: skip
"""Names of the rows of ``HumanFrame.landmarks``. Pelvis: mid-hip. Chest: sternum height on the spine, below the
shoulder line. Head: its centre. Toe: the tip of the foot's rigid part (ball) as the source gives it."""
LANDMARK = {name: row for row, name in enumerate(LANDMARKS)}

SEGMENTS = ("pelvis", "chest", "head", "l_hand", "r_hand", "l_foot", "r_foot")
"""Names of the rows of ``HumanFrame.orientations``."""
SEGMENT = {name: row for row, name in enumerate(SEGMENTS)}


class GivenUp(enum.IntFlag):
    """What a frame's similarity was sacrificed for (bits of ``given_up`` in the run file)."""

    REACH = 1
    """A hand or foot target lies outside the joint limits or the arm's reach."""
    SPEED = 2
    """A joint or task speed limit held a hand or foot back."""
    COLLISION = 4
    """A hand or foot was kept away from the body, the other limb or the floor."""
    BALANCE = 8
    """The centre of mass or the planted feet kept a foot from its target."""
    SUPPORT = 16
    """The robot stands on other feet than the person (waits for its centre of mass, a landing, a flight)."""
    LANDING = 32
    """The step was clipped to the landing set."""
    INPUT = 64
    """Landmarks were missing or impossible; their last good values were used."""
    HOLD = 128
    """The frame repeats the last safe pose, because no step towards the person was safe."""


@dataclass(frozen=True)
class HumanFrame:
    """One moment of a person, in the world: SI units, z up.

    time: s from the first frame of the file, or on the receiver's clock.
    landmarks: (19, 3) m, rows as ``LANDMARKS``, NaN where missing.
    orientations: (7, 4) unit quaternions (w, x, y, z), rows as ``SEGMENTS``, world from segment, where every segment
        frame is x forward, y left, z up in a T-pose that faces +x (palms down); NaN rows where missing.
    com: (3,) m, the source's own centre of mass, or None.
    contacts: (2,) bool, left and right foot planted as the source says, or None.
    support: ``D``, ``L``, ``R`` or ``F`` (flight) where it is known (generator or whole-clip analysis), or None.
    hand_opening: (2,) left and right, 0 closed to 1 open, or None.
    """

    time: float
    landmarks: Array
    orientations: Array | None = None
    com: Array | None = None
    contacts: npt.NDArray[np.bool_] | None = None
    support: str | None = None
    hand_opening: Array | None = None

    def __getitem__(self, name: str) -> Array:
        """Position of a landmark by name, (3,) m."""
        return self.landmarks[LANDMARK[name]]


@dataclass(frozen=True)
class Motion:
    """A recorded or generated motion: the frames of one person as arrays, and what is known about them.

    time: (T,) s, from 0, strictly increasing, at the true rate of the file.
    landmarks: (T, 19, 3) m, z up. orientations, com, contacts, hand_opening, support: as in ``HumanFrame``, with a
        leading T, or None.
    name, source, sha256: for people, the run file, and provenance.
    tpose: a calibration posture (from the file's T-pose or the skeleton's rest pose), or None.
    tpose_note: where it comes from, one sentence.
    notes: what was recognised, corrected or assumed, a sentence each.
    """

    name: str
    time: Array
    landmarks: Array
    orientations: Array | None = None
    com: Array | None = None
    contacts: npt.NDArray[np.bool_] | None = None
    support: npt.NDArray[np.str_] | None = None
    hand_opening: Array | None = None
    tpose: HumanFrame | None = None
    tpose_note: str = ""
    source: str = ""
    sha256: str = ""
    notes: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.time)

    def __iter__(self) -> Iterator[HumanFrame]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, i: int) -> HumanFrame:
        """Frame i as it was recorded."""
        return HumanFrame(
            time=float(self.time[i]),
            landmarks=self.landmarks[i],
            orientations=None if self.orientations is None else self.orientations[i],
            com=None if self.com is None else self.com[i],
            contacts=None if self.contacts is None else self.contacts[i],
            support=None if self.support is None else str(self.support[i]),
            hand_opening=None if self.hand_opening is None else self.hand_opening[i],
        )

    @property
    def duration(self) -> float:
        """Time of the last frame, s."""
        return float(self.time[-1])

    @property
    def rate(self) -> float:
        """Mean frame rate, Hz (0 for a single frame)."""
        return (len(self) - 1) / float(self.time[-1] - self.time[0]) if len(self) > 1 else 0.0

    def at(self, time: float) -> HumanFrame:
        """The person at any time (s), interpolated; before the first and after the last frame they stand still.

        Positions are interpolated linearly, orientations along the shorter arc (normalised linear), support and
        contacts keep the value of the frame before.
        """
        i = int(np.searchsorted(self.time, time, side="right")) - 1
        if i < 0 or i >= len(self) - 1:
            return replace(self[0 if i < 0 else -1], time=float(time))
        a, b = self[i], self[i + 1]
        s = (time - a.time) / (b.time - a.time)
        return replace(
            a,
            time=float(time),
            landmarks=(1.0 - s) * a.landmarks + s * b.landmarks,
            orientations=_mix_quaternions(a.orientations, b.orientations, s),
            com=_mix(a.com, b.com, s),
            hand_opening=_mix(a.hand_opening, b.hand_opening, s),
        )


@dataclass(frozen=True)
class RobotCommand:
    """One command to the robot, statically stable, after all limits.

    time: s on the robot's clock. q: (J,) rad in the model's joint order. base_pos (3,) m and base_quat (4,)
    (w, x, y, z): torso link in the world, floor at z = 0. support: ``D``, ``L``, ``R``: the feet that carry.
    offset: the robot's normalised CoM offset, 0 left to 1 right. com: (3,) m, world. soles: (2, 3) m, left and right,
    world. posture: (4, 3) m, the person's posture (1) for l_hand, l_foot, r_hand, r_foot; human_support and
    human_offset likewise. hand_opening: (2,). given_up: what similarity was sacrificed for. ik_iterations: count over
    all limbs.
    """

    time: float
    q: Array
    base_pos: Array
    base_quat: Array
    support: str
    offset: float
    com: Array
    soles: Array
    posture: Array
    human_support: str
    human_offset: float
    hand_opening: Array
    given_up: GivenUp
    ik_iterations: int


def _mix(a: Array | None, b: Array | None, s: float) -> Array | None:
    return None if a is None or b is None else (1.0 - s) * a + s * b


def _mix_quaternions(a: Array | None, b: Array | None, s: float) -> Array | None:
    if a is None or b is None:
        return None
    b = np.where(np.sum(a * b, axis=-1, keepdims=True) < 0.0, -b, b)
    mixed = (1.0 - s) * a + s * b
    return np.asarray(mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))

"""Mass fractions and centres of mass of the body's segments, and the centre of mass of a person from landmarks alone.

Masses and centres: P. de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters", J. Biomechanics
29(9), 1996, Table 4, here the mean of its female and male columns (we do not know who stands there). The trunk is
taken between mid-shoulder and mid-hip, the hand between wrist and third knuckle, the shank between the joint centres
(the table's alternative end points). The foot's end points there, heel and toe tip, are no landmarks of ours: its
centre is halfway from ankle to ball (D. Winter, "Biomechanics and Motor Control of Human Movement", Table 4.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from naoimitate.core.frames import LANDMARK, LANDMARKS, SIDES, Array


@dataclass(frozen=True)
class Segment:
    """One rigid segment between two points, each the mean of the landmarks named.

    mass: share of the body's mass. center: position of the centre of mass from the first point (0) to the second (1).
    """

    name: str
    first: tuple[str, ...]
    second: tuple[str, ...]
    mass: float
    center: float


def _mean(female: float, male: float) -> float:
    """Mean of the table's two columns, per cent -> 1."""
    return 0.005 * (female + male)


def _limbs(side: str) -> tuple[Segment, ...]:
    def limb(name: str, first: str, second: str, mass: float, center: float) -> Segment:
        return Segment(f"{side}_{name}", (f"{side}_{first}",), (f"{side}_{second}",), mass, center)

    return (
        limb("upper_arm", "shoulder", "elbow", _mean(2.55, 2.71), _mean(57.54, 57.72)),
        limb("forearm", "elbow", "wrist", _mean(1.38, 1.62), _mean(45.59, 45.74)),
        limb("hand", "wrist", "hand", _mean(0.56, 0.61), _mean(74.74, 79.00)),
        limb("thigh", "hip", "knee", _mean(14.78, 14.16), _mean(36.12, 40.95)),
        limb("shank", "knee", "ankle", _mean(4.81, 4.33), _mean(43.52, 43.95)),
        limb("foot", "ankle", "toe", _mean(1.29, 1.37), 0.5),
    )


SEGMENT_TABLE: tuple[Segment, ...] = (
    Segment("head", ("head",), ("head",), _mean(6.68, 6.94), 0.0),
    Segment("trunk", ("l_shoulder", "r_shoulder"), ("l_hip", "r_hip"), _mean(42.57, 43.46), _mean(37.82, 43.10)),
    *(segment for side in SIDES for segment in _limbs(side)),
)
"""Every segment of the body; the masses sum to 1 within the table's rounding."""


def _weights() -> Array:
    """(S, 19): the centre of each segment as a combination of landmarks; rows sum to 1."""
    weights = np.zeros((len(SEGMENT_TABLE), len(LANDMARKS)))
    for row, segment in enumerate(SEGMENT_TABLE):
        for names, share in ((segment.first, 1.0 - segment.center), (segment.second, segment.center)):
            for name in names:
                weights[row, LANDMARK[name]] += share / len(names)
    return weights


_WEIGHTS = _weights()
_MASSES = np.array([segment.mass for segment in SEGMENT_TABLE])
_BODY = _MASSES @ _WEIGHTS / _MASSES.sum()


def center_of_mass(landmarks: Array) -> Array:
    """Whole-body centre of mass, (..., 19, 3) m -> (..., 3) m.

    A segment with a missing (NaN) landmark is left out and the others' masses are renormalised; NaN where no segment
    is known.
    """
    com = np.asarray(np.einsum("l,...lk->...k", _BODY, landmarks))
    gaps = np.asarray(~np.isfinite(com).all(axis=-1))
    if gaps.any():
        com[gaps] = _center_of_known(landmarks[gaps])
    return com


def _center_of_known(landmarks: Array) -> Array:
    """Centre of mass of the segments whose landmarks are all there, (N, 19, 3) m -> (N, 3) m."""
    complete = np.asarray(np.isfinite(landmarks).all(axis=-1))
    lacking = np.einsum("nl,sl->ns", ~complete, _WEIGHTS)
    mass = np.where(lacking > 0.0, 0.0, _MASSES)
    total = mass.sum(axis=-1, keepdims=True)
    share = np.divide(mass, total, out=np.full_like(mass, np.nan), where=total > 0.0)
    known = np.where(complete[..., None], landmarks, 0.0)
    return np.asarray(np.einsum("ns,sl,nlk->nk", share, _WEIGHTS, known))

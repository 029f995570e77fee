"""The floor under a recorded motion: one plane, found from the points of the feet while they are slow.

Capture floors are tilted by a degree, and joint centres sit at their own heights above the sole, so that a fixed height
cannot tell contact from swing. Fitted are one tilt for the whole floor, and a height for each kind of point (ankle,
toe, tip) with a small difference between left and right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.core.frames import Array

Mask = npt.NDArray[np.bool_]

SLOW = 0.20
"""m/s: slower points may stand on the floor (mocap/INDEX.yaml, method)."""
BAND = 0.025
"""m: points so near the plane belong to it (same)."""
SIDES_DIFFER = 0.012
"""m: how much the left and the right point of one kind may differ in height (same)."""
SPAN_FOR_TILT = 1.2
"""m: the floor must have been walked on over this length before a tilt can be told from noise (same)."""
TILTS = np.linspace(-0.06, 0.06, 61)
"""Slopes tried (3.4 deg either way; the worst of the test clips is 1.2 deg)."""
LOW_EDGE = 0.15
"""Quantile of the samples in the band that is the floor: feet roll and rest above it, they do not sink into it."""
LOWEST_SHARE = 0.4
"""The floor is the lowest level that holds this share of the fullest one's samples: feet also rest in the air."""
REFINEMENTS = 8


@dataclass(frozen=True)
class Floor:
    """A fitted floor. slope: (2,) rise in m per m along x and y. heights: (2, K) m over the origin, left and right.

    Each of the K kinds of point has its own height, which includes the joint's above the sole; NaN where none was seen.
    """

    slope: Array
    heights: Array

    def above(self, points: Array) -> Array:
        """Height of feet points (T, 2, K, 3) m over their floor, (T, 2, K) m."""
        return np.asarray(points[..., 2] - points[..., :2] @ self.slope - self.heights)


def fit_floor(points: Array, candidates: Mask) -> Floor:
    """Fit the floor to feet points (T, 2, K, 3) m, of which the ``candidates`` (T, 2, K) may stand on it."""
    axes = _tilt_axes(points[..., :2][candidates])
    slope, levels = _search(points, candidates, axes)
    floor = Floor(slope, np.tile(levels, (2, 1)))
    for _ in range(REFINEMENTS):
        floor = _refine(points, candidates, axes, floor)
    return floor


def _tilt_axes(xy: Array) -> Array:
    """(n, 2) horizontal directions, n = 0 to 2, along which the samples (N, 2) m reach far enough to tell a tilt."""
    if len(xy) < 2:
        return np.zeros((0, 2))
    axes: Array = np.linalg.svd(xy - xy.mean(axis=0), full_matrices=False)[2]
    return np.asarray(axes[np.ptp(xy @ axes.T, axis=0) > SPAN_FOR_TILT])


def _search(points: Array, candidates: Mask, axes: Array) -> tuple[Array, Array]:
    """The slope along the longest axis that puts most samples into one level of each kind; slope (2,), levels (K,)."""
    tilts = TILTS[np.argsort(np.abs(TILTS), kind="stable")] if len(axes) else np.zeros(1)
    axis = axes[0] if len(axes) else np.zeros(2)
    best, found = -1, (np.zeros(2), np.full(points.shape[2], np.nan))
    for tilt in tilts:
        flat = points[..., 2] - points[..., :2] @ (tilt * axis)
        levels = [_level(flat[:, :, kind][candidates[:, :, kind]]) for kind in range(points.shape[2])]
        count = sum(count for _, count in levels)
        if count > best:
            best, found = count, (tilt * axis, np.array([level for level, _ in levels]))
    return found


def _level(heights: Array) -> tuple[float, int]:
    """The lowest well-filled band of heights (N,) m: its middle and how many samples it holds."""
    if len(heights) == 0:
        return np.nan, 0
    low = np.sort(heights)
    count = np.searchsorted(low, low + BAND, side="right") - np.arange(len(low))
    first = int(np.argmax(count >= LOWEST_SHARE * count.max()))
    fullest = first + int(np.argmax(count[first : first + count[first]]))
    return float(np.median(low[fullest : fullest + count[fullest]])), int(count[fullest])


def _refine(points: Array, candidates: Mask, axes: Array, floor: Floor) -> Floor:
    """One round: least squares for the tilt over the samples in the band, then the low edge of each kind and side."""
    near = candidates & (np.abs(floor.above(points)) < BAND)
    slope = floor.slope
    if len(axes) and near.any():
        _, side, kind = np.nonzero(near)
        groups = side * points.shape[2] + kind
        levels = np.equal.outer(groups, np.unique(groups)).astype(float)
        design = np.hstack([points[..., :2][near] @ axes.T, levels])
        slope = np.linalg.lstsq(design, points[..., 2][near], rcond=None)[0][: len(axes)] @ axes
    flat = points[..., 2] - points[..., :2] @ slope
    heights = [_low_edges(flat[:, :, k], near[:, :, k], floor.heights[:, k]) for k in range(points.shape[2])]
    return Floor(slope, np.stack(heights, axis=1))


def _low_edges(flat: Array, near: Mask, before: Array) -> Array:
    """Heights (2,) m of one kind, left and right, each the low edge of its samples, not further apart than allowed."""
    if not near.any():
        return before
    both = np.quantile(flat[near], LOW_EDGE)
    edges = np.array([np.quantile(flat[near[:, s], s], LOW_EDGE) if near[:, s].any() else both for s in (0, 1)])
    return np.asarray(np.clip(edges, both - 0.5 * SIDES_DIFFER, both + 0.5 * SIDES_DIFFER))

"""Other postures of an arm: what it could reach without speed limits, from where it is and from elsewhere.

An arm follows its target downhill. That ends where a joint is at its end or the shoulder is singular: the hand's way
around the shoulder's axis needs another turn of the joints. A map of postures, made once for a robot, tells from where
else the target can be reached.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from naoimitate.limb import Limb
from naoimitate.robot.kernel import forward, point_jacobian
from naoimitate.robot.model import RobotModel, Tree

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

POSTURES = 2048
"""Postures on the map of a limb."""
BINS = 6
"""Parts of the first joint's range: each offers its best posture."""
OVERDRAW = 0.15
"""Share of its range by which a joint's drawn angle may lie beyond either end, where it is cut: ends matter most."""
SECONDS_PER_METRE = 3.0
"""What a distance on the map costs against the time to get there."""
MINOR = 0.1
"""Share of the greatest lever below which a joint (a wrist) hardly moves the tip: no time is reckoned for it."""
SEEK_ITERATIONS = 10
LOCAL_ITERATIONS = 8
"""Of ``seek``: from the map, and from where the arm is."""
BRAKING = 30.0
"""[rad/s^2] with which joints come to rest where they are to be: less than they may, so that they never overshoot."""
SLACK = 1.0
"""[rad/s] at which a joint may always move: from here it stops within a sixtieth of a radian."""
LONGEST_STEP = 0.4
"""[rad] of any joint in one iteration."""
DAMPING = 1e-5
"""[m^2/rad^2]; more with the error, see ``limb.LimbWeights.damping``."""
REACHED = 5e-4
"""[m] from the target at which no further iteration is made."""


class Chain(NamedTuple):
    """A limb by itself, for compiled functions: its n joints alone, numbered from the base outwards.

    tree: of these joints. lower, upper, speed: (n,) rad, rad/s. tip: (3,) m in the last link. root: (3,) m, base frame.
    upper_length: m. postures (K, n) rad, places (K, 3) m: the map; tip minus root in each posture.
    """

    tree: Tree
    lower: Array
    upper: Array
    speed: Array
    tip: Array
    root: Array
    upper_length: float
    postures: Array
    places: Array


def build_chain(robot: RobotModel, limb: Limb) -> Chain:
    """The limb's chain and its map, the same for the same robot."""
    tree = _cut(robot.tree, limb)
    n = len(limb.joints)
    span = limb.upper - limb.lower
    drawn = np.random.default_rng(0).uniform(-OVERDRAW, 1.0 + OVERDRAW, (POSTURES, n))
    postures = limb.lower + span * np.clip(drawn, 0.0, 1.0)
    postures = np.ascontiguousarray(postures[np.argsort(postures[:, 0], kind="stable")])
    chain = Chain(
        tree,
        limb.lower,
        limb.upper,
        robot.speed[limb.joints],
        limb.tip,
        limb.root,
        limb.upper_length,
        postures,
        np.empty((POSTURES, 3)),
    )
    arms = np.zeros(n)
    _fill_places(chain, arms)
    return chain._replace(speed=np.where(arms < MINOR * arms.max(), np.inf, chain.speed))


def _cut(tree: Tree, limb: Limb) -> Tree:
    """The tree of the limb's joints alone; joints before them are taken at zero, as ``build_limb`` takes the root."""
    n, joints = len(limb.joints), limb.joints
    count = len(tree.parent)
    pos, rot = np.empty((count + 1, 3)), np.empty((count + 1, 3, 3))
    forward(tree, np.zeros(count), pos, rot)
    cut_pos, cut_rot = np.empty((n, 3)), np.empty((n, 3, 3))
    previous = 0
    for i, j in enumerate(joints):
        cut_pos[i] = rot[previous].T @ (pos[j + 1] - pos[previous])
        cut_rot[i] = rot[previous].T @ rot[j + 1]
        previous = j + 1
    return Tree(
        np.arange(-1, n - 1),
        cut_pos,
        cut_rot,
        np.ascontiguousarray(tree.axis[joints]),
        np.zeros(n + 1),
        np.zeros((n + 1, 3)),
        np.tri(n, dtype=np.bool_),
    )


@njit(cache=True)
def _fill_places(chain: Chain, arms: Array) -> None:
    """Fill the map, and arms (n,) m: the farthest that a joint's turn moves the tip, per rad."""
    J = np.empty((3, chain.lower.shape[0]))
    n = chain.lower.shape[0]
    pos, rot = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    for k in range(chain.postures.shape[0]):
        forward(chain.tree, chain.postures[k], pos, rot)
        tip = pos[n] + rot[n] @ chain.tip
        chain.places[k] = tip - chain.root
        point_jacobian(chain.tree, pos, rot, n - 1, tip, J)
        for i in range(n):
            arms[i] = max(arms[i], np.sqrt(J[0, i] ** 2 + J[1, i] ** 2 + J[2, i] ** 2))


@njit(cache=True)
def seek(chain: Chain, target: Array, angles: Array, iterations: int) -> float:
    """Move angles (n,) rad, written, downhill to the target (3,) m within the ranges; the tip's error there, m.

    Damped least squares; a joint at its end that would leave its range waits (Baerlocher and Boulic 2004).
    """
    n = angles.shape[0]
    pos, rot, J = np.empty((n + 1, 3)), np.empty((n + 1, 3, 3)), np.empty((3, n))
    tip, error, step, free = np.empty(3), np.empty(3), np.empty(n), np.empty(n)
    length = 0.0
    for iteration in range(iterations + 1):
        forward(chain.tree, angles, pos, rot)
        for a in range(3):
            tip[a] = pos[n, a]
            for c in range(3):
                tip[a] += rot[n, a, c] * chain.tip[c]
            error[a] = chain.root[a] + target[a] - tip[a]
        length = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        if length < REACHED or iteration == iterations:
            break
        point_jacobian(chain.tree, pos, rot, n - 1, tip, J)
        _free_step(J, error, DAMPING + 0.5 * chain.upper_length * length, angles, chain.lower, chain.upper, free, step)
        longest = 0.0
        for i in range(n):
            longest = max(longest, abs(step[i]))
        if longest < 1e-5:
            break
        scale = min(1.0, LONGEST_STEP / longest)
        for i in range(n):
            angles[i] = min(max(angles[i] + scale * step[i], chain.lower[i]), chain.upper[i])
    return length


@njit(cache=True)
def _free_step(
    J: Array, e: Array, damping: float, angles: Array, lower: Array, upper: Array, free: Array, step: Array
) -> None:
    """step = J^T (J J^T + damping E)^-1 e of the joints that are free; those that would leave their range are not."""
    n = angles.shape[0]
    free[:] = 1.0
    for _ in range(n):
        xx, yy, zz, xy, xz, yz = damping, damping, damping, 0.0, 0.0, 0.0
        for i in range(n):
            x, y, z = free[i] * J[0, i], free[i] * J[1, i], free[i] * J[2, i]
            xx, yy, zz, xy, xz, yz = xx + x * x, yy + y * y, zz + z * z, xy + x * y, xz + x * z, yz + y * z
        a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        det = xx * a + xy * b + xz * c
        d, f, g = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
        u = (a * e[0] + b * e[1] + c * e[2]) / det
        v = (b * e[0] + d * e[1] + f * e[2]) / det
        w = (c * e[0] + f * e[1] + g * e[2]) / det
        changed = False
        for i in range(n):
            step[i] = free[i] * (J[0, i] * u + J[1, i] * v + J[2, i] * w)
            if (angles[i] >= upper[i] and step[i] > 0.0) or (angles[i] <= lower[i] and step[i] < 0.0):
                free[i] = 0.0
                changed = True
        if not changed:
            return


@njit(cache=True)
def foresee(
    chain: Chain, target: Array, ahead: Array, angles: Array, dt: float, local: Array, drift: Array, known: bool
) -> float:
    """Where the arm would be at the target without speed limits, and how near it would come to the target ahead, m.

    angles: (n,) rad, where it is. local (n,) rad: written; it holds the last frame's where ``known``, dt s ago; drift
    (n,) rad/s, written: how fast it moves.
    """
    n = angles.shape[0]
    now = angles.copy()
    seek(chain, target, now, LOCAL_ITERATIONS)
    for i in range(n):
        drift[i] = (now[i] - local[i]) / dt if known and dt > 0.0 else 0.0
        local[i] = now[i]
    return seek(chain, ahead, now, LOCAL_ITERATIONS)


@njit(cache=True)
def brake(angles: Array, local: Array, drift: Array, dt: float, joints: Ints, low: Array, high: Array) -> None:
    """Narrow a frame's bounds low, high (J,) rad of ``joints`` (n,) so that the arm comes to rest at ``local`` (n,).

    A joint may move as fast as its goal, ``drift`` rad/s, and in its direction as much faster as it can still brake.
    """
    for i in range(angles.shape[0]):
        j = joints[i]
        gap = local[i] - angles[i]
        more = math.sqrt(2.0 * BRAKING * abs(gap))
        up = max(drift[i] + (more if gap > 0.0 else 0.0), SLACK)
        down = min(drift[i] - (more if gap < 0.0 else 0.0), -SLACK)
        bottom, top = low[j], high[j]
        low[j] = min(max(angles[i] + dt * down, bottom), top)
        high[j] = min(max(angles[i] + dt * up, bottom), top)


@njit(cache=True)
def funnel(
    chain: Chain, angles: Array, goal: Array, speed: Array, dt: float, joints: Ints, low: Array, high: Array
) -> None:
    """Narrow a frame's bounds low, high (J,) rad of ``joints`` (n,) so that all are at ``goal`` when the slowest is.

    t seconds before, a joint may be D(t) from its goal: a t^2 / 2 while it brakes, else v (t - v / 2a), with v its
    ``speed`` (n,) rad/s. Joints for which no time is reckoned (see ``MINOR``) stay free.
    """
    n = angles.shape[0]
    left = 0.0
    for i in range(n):
        if chain.speed[i] < math.inf:
            gap, ramp = abs(goal[i] - angles[i]), speed[i] / BRAKING
            braking = gap < 0.5 * speed[i] * ramp
            left = max(left, math.sqrt(2.0 * gap / BRAKING) if braking else gap / speed[i] + 0.5 * ramp)
    left = max(left - dt, 0.0)
    for i in range(n):
        if chain.speed[i] < math.inf:
            j, ramp = joints[i], speed[i] / BRAKING
            most = 0.5 * BRAKING * left**2 if left < ramp else speed[i] * (left - 0.5 * ramp)
            bottom, top = low[j], high[j]
            low[j] = min(max(goal[i] - most, bottom), top)
            high[j] = min(max(goal[i] + most, bottom), top)


@njit(cache=True)
def way(chain: Chain, start: Array, end: Array) -> float:
    """Time, s, that the slowest joint takes from start to end (n,) rad at its no-load speed."""
    longest = 0.0
    for i in range(start.shape[0]):
        longest = max(longest, abs(end[i] - start[i]) / chain.speed[i])
    return longest


@njit(cache=True)
def alternatives(chain: Chain, target: Array, angles: Array, found: Array, errors: Array, times: Array) -> None:
    """The map's best posture in each part of the first joint's range, brought to the target (3,) m.

    angles: (n,) rad, where the arm is. found (BINS, n) rad, errors (BINS,) m, times (BINS,) s to get there: written.
    """
    bins, count = found.shape[0], chain.postures.shape[0]
    best = np.full(bins, np.inf)
    span = chain.upper[0] - chain.lower[0]
    for k in range(count):
        part = min(int(bins * (chain.postures[k, 0] - chain.lower[0]) / span), bins - 1)
        price = 0.0
        for a in range(3):
            price += (chain.places[k, a] - target[a]) ** 2
        price = SECONDS_PER_METRE * np.sqrt(price)
        if price < best[part]:
            price += way(chain, angles, chain.postures[k])
            if price < best[part]:
                best[part] = price
                found[part] = chain.postures[k]
    for part in range(bins):
        errors[part] = seek(chain, target, found[part], SEEK_ITERATIONS)
        times[part] = way(chain, angles, found[part])

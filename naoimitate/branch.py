"""When an arm leaves its posture for another one, and how it gets there: causal, without jumps, as fast as it may."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from naoimitate.balance.retarget import Reach
from naoimitate.collision import distances, shape_arrays
from naoimitate.limb import Limb
from naoimitate.postures import BINS, alternatives, brake, build_chain, foresee, funnel, seek
from naoimitate.robot.kernel import forward
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

GAIN = 0.008
"""[m] by which another posture must fit better to be worth a change that takes no time."""
PRICE = 0.02
"""[m/s]: more for each second that the change takes, where a spare joint lets the hand stay near its target."""
PRICE_WITHOUT_SPARE = 0.15
"""[m/s] where the hand leaves its target for the change."""
AHEAD = 0.06
"""[s] that the hand's way is continued for the decision: the arm changes before it is stuck."""
PATIENCE = 2.0
"""[s] of being stuck after which e times less is worth a change: what is lost adds up, what a change costs does not."""
PATIENCE_WITHOUT_SPARE = 5.0
"""[s] of the same where the hand leaves its target for the change."""
STUCK = 0.002
"""[m] off its target from which an arm counts as stuck, and the least that a change must bring: nobody sees less."""
PAUSE = 0.05
"""[s] between two searches that found nothing."""
BLOCKED_PAUSE = 0.5
"""[s] before another search, after the body was in the way of a change."""
HELD = 0.1
"""[s] for which the body must hold a hand back before another posture is looked for."""
ENOUGH = 0.005
"""[m] by which the arm may fit worse than the other posture when it follows the hand again, downhill from there."""
STILL = 1e-4
"""[rad] of motion in a frame below which a change is blocked."""
FOLLOW_ITERATIONS = 2
"""Of ``seek``, for the other posture in each frame of a change."""


class Branch:
    """The posture of one arm, as opposed to the others with which it could reach the same place."""

    def __init__(self, robot: RobotModel, limb: Limb) -> None:
        self._tree, self._limb = robot.tree, limb
        self._chain = build_chain(robot, limb)
        self._shapes = shape_arrays(robot)
        mine = np.isin(self._shapes.link - 1, limb.joints)
        self._pairs = np.ascontiguousarray(robot.pairs[mine[robot.pairs].any(axis=1)].reshape(-1, 2))
        count, n = len(self._pairs), len(limb.joints)
        spare = n > 3
        self._price = PRICE if spare else PRICE_WITHOUT_SPARE
        self._patience = PATIENCE if spare else PATIENCE_WITHOUT_SPARE
        self._contact = np.empty(count), np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
        self._frames = np.empty((len(robot.joint_names) + 1, 3)), np.empty((len(robot.joint_names) + 1, 3, 3))
        self._found, self._errors, self._times = np.empty((BINS, n)), np.empty(BINS), np.empty(BINS)
        self._local, self._drift = np.zeros(n), np.zeros(n)
        self.reset()

    def reset(self) -> None:
        """Forget the past."""
        self.goal: Array | None = None
        self._target: Array | None = None
        self._known = False
        self._pause, self._held, self._stuck = 0.0, 0.0, 0.0

    def look(self, q: Array, target: Array, dt: float, error: float, hurried: bool) -> None:
        """Decide about a change: sets ``goal``, (n,) rad, where another posture will serve the target better.

        q: (J,) rad. target: (3,) m. error: m, the hand's in the last frame; hurried: whether speed was the reason.
        """
        velocity = (target - self._target) / dt if self._target is not None and dt > 0.0 else np.zeros(3)
        self._target = target.copy()
        self._pause = max(self._pause - dt, 0.0)
        self._held = self._held + dt if error > GAIN and not hurried else 0.0
        ahead, angles = target + AHEAD * velocity, q[self._limb.joints]
        local = foresee(self._chain, target, ahead, angles, dt, self._local, self._drift, self._known)
        self._known = True
        if self._held > HELD and self.goal is None:
            local = max(local, error)
        if local < STUCK:
            self._stuck = 0.0
        elif self.goal is None:
            self._stuck += dt
        worth = math.exp(-self._stuck / self._patience)
        if self.goal is not None:
            if local < seek(self._chain, ahead, self.goal, FOLLOW_ITERATIONS) + max(ENOUGH * worth, STUCK):
                self.goal = None
        elif self._pause == 0.0 and local > max(GAIN * worth, STUCK):
            self._search(q, angles, ahead, local, worth)
            self._pause = PAUSE * (1.0 + self._stuck)

    def _search(self, q: Array, angles: Array, target: Array, local: float, worth: float) -> None:
        """The alternative with the least error and time that is worth the change and does not touch the body."""
        alternatives(self._chain, target, angles, self._found, self._errors, self._times)
        price = self._errors + worth * self._price * self._times
        for k in np.argsort(price, kind="stable"):
            if price[k] + max(GAIN * worth, STUCK) > local:
                return
            if self._clear(q, self._found[k]):
                self.goal = self._found[k].copy()
                return

    def _clear(self, q: Array, angles: Array) -> bool:
        """Whether the arm at angles (n,) rad touches nothing, the rest of the body as in q (J,) rad."""
        trial = q.copy()
        trial[self._limb.joints] = angles
        forward(self._tree, trial, *self._frames)
        distances(self._shapes, self._pairs, *self._frames, 0.0, *self._contact)
        return not (self._contact[0] < 0.0).any()

    def bounds(self, q: Array, reach: Reach) -> Reach:
        """The frame's reach, narrowed: braked where the arm follows, a funnel where it changes; q: (J,) rad."""
        if reach.dt == 0.0:
            return reach
        joints, low, high = self._limb.joints, reach.smooth_low.copy(), reach.smooth_high.copy()
        angles = q[joints]
        if self.goal is None:
            brake(angles, self._local, self._drift, reach.dt, joints, low, high)
        else:
            speed = 0.5 * (reach.high - reach.low)[joints] / reach.dt
            funnel(self._chain, angles, self.goal, speed, reach.dt, joints, low, high)
        return reach._replace(smooth_low=low, smooth_high=high)

    def moved(self, before: Array, angles: Array) -> None:
        """Ends the change where the body is in the way; before, angles: (n,) rad."""
        if np.abs(angles - before).max() < STILL:
            self.goal, self._pause = None, BLOCKED_PAUSE

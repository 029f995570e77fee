"""Direct imitation: the posture mapping alone, without stabilisation. The baseline that falls; never for a robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from naoimitate.balance.legs import Legs
from naoimitate.balance.paper import PaperIk
from naoimitate.balance.planted import Planted
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Answer, Footing, Reach
from naoimitate.balance.soles import into_tables, leg_joints, shortened, uncoupled_leg
from naoimitate.core.frames import GivenUp
from naoimitate.core.geometry import heading, yaw_matrix
from naoimitate.fsm import Mode
from naoimitate.limb import solve_limb_fixed
from naoimitate.robot.model import RobotModel

Array = npt.NDArray[np.float64]

_MODES = {"D": Mode.DOUBLE, "L": Mode.LEFT, "R": Mode.RIGHT}


class Direct:
    """The feet where the mapping puts them; the torso as the person's; the lower sole on the floor."""

    settled = True

    def __init__(self, robot: RobotModel, legs: Legs, maker: PoseMaker, planted: Planted, ik: PaperIk) -> None:
        self._robot, self._maker, self._planted, self._ik = robot, maker, planted, ik
        self._legs, self._rows = legs, legs.sole_joint + 1
        self._limbs = [uncoupled_leg(robot, legs, side) for side in "lr"]

    def place(self, q: Array, feet: Array, footing: Footing) -> Pose:
        """The stand of frame 0; see ``Planted.place``."""
        self.mode, self.offset = Mode.DOUBLE, 0.5
        self._yaw = heading(footing.torso)
        return self._planted.place(q, feet, footing)

    def stand(self, q: Array) -> Pose:
        """See ``Planted.stand``."""
        self.mode, self.offset, self._yaw = Mode.DOUBLE, 0.5, 0.0
        return self._planted.stand(q)

    def step(self, pose: Pose, q_arms: Array, feet: Array, footing: Footing, reach: Reach) -> Answer:
        """The next pose: legs by the paper's few iterations, nothing else."""
        self.mode = _MODES.get(footing.support, self.mode)
        q = np.clip(q_arms, self._robot.lower, self._robot.upper)
        for limb, foot in zip(self._limbs, feet, strict=True):
            solve_limb_fixed(self._robot.tree, limb, foot, q, self._ik.damping, self._ik.leg_iterations)
        q = shortened(pose.q, q, leg_joints(self._legs), reach.low, reach.high)
        into_tables(self._legs, q)
        side = 1 if self.mode is Mode.RIGHT else 0
        hung = self._maker.hang(q, side, pose.sole_pos, pose.sole_rot)
        return Answer(self._upright(hung, pose, side, footing), GivenUp.BALANCE, 2 * self._ik.leg_iterations)

    def _upright(self, hung: Pose, before: Pose, side: int, footing: Footing) -> Pose:
        """Turn the robot to the person's torso, keep the stance ankle's place, put the lower sole on the floor."""
        torso = yaw_matrix(-self._yaw) @ footing.torso
        sole_rot = torso @ hung.link_rot[self._rows]
        positions = before.sole_pos.copy()
        pose = self._maker.hang(hung.q, side, positions, sole_rot)
        positions[side][2] -= self._maker.lowest(pose)
        pose = self._maker.hang(hung.q, side, positions, sole_rot)
        self.offset = min(max(self._maker.offset(pose), 0.0), 1.0)
        return pose

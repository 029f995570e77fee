"""Pinocchio as the oracle of our kinematics: the model's URDF with a free-flyer root, joints in our order."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array


class Oracle:
    """Quantities in the frame of the base link, which pinocchio holds at the world's origin."""

    def __init__(self, model: RobotModel) -> None:
        self.model = pin.buildModelFromXML(model.urdf, pin.JointModelFreeFlyer())
        self.data = self.model.createData()
        self.ids = [self.model.getJointId(name) for name in model.joint_names]
        self.columns = [self.model.joints[i].idx_v for i in self.ids]

    def configuration(self, q: Array) -> Array:
        """Configuration of pinocchio for joint angles q (J,)."""
        full = pin.neutral(self.model)
        for i, angle in zip(self.ids, q, strict=True):
            full[self.model.joints[i].idx_q] = angle
        return full

    def update(self, q: Array) -> None:
        """Compute everything that the tests ask for."""
        full = self.configuration(q)
        pin.computeJointJacobians(self.model, self.data, full)
        pin.jacobianCenterOfMass(self.model, self.data, full)

    def jacobian(self, joint: int) -> Array:
        """(6, J) of the link behind a joint: rows linear (at the link's origin), angular."""
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.array(pin.getJointJacobian(self.model, self.data, self.ids[joint], frame)[:, self.columns])

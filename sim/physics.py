"""The simulated robot as a machine: put it somewhere, give it servo commands, let time pass, measure."""

from __future__ import annotations

import mujoco
import numpy as np

from naoimitate.core.frames import SIDES, Array
from naoimitate.robot.model import RobotModel
from naoimitate.sim.contacts import plate_name
from naoimitate.sim.force_sensors import ForceSensors
from naoimitate.sim.hands import CLOSED, Hands
from naoimitate.sim.model import Scene, build_model
from naoimitate.sim.settings import SimSettings

NORMAL = 0
"""Index of the normal component in MuJoCo's contact forces."""


class Physics:
    """One simulated robot on its floor. J joints in the order of the ``RobotModel``; the world's floor is z = 0.

    scene: adds objects to the model; ``place`` puts them back where they began.
    """

    def __init__(self, robot: RobotModel, settings: SimSettings, scene: Scene | None = None) -> None:
        self.model = build_model(robot, settings, scene)
        self.data = mujoco.MjData(self.model)
        self._settings = settings
        joints = [self.model.joint(name) for name in robot.joint_names]
        self._qpos = np.array([joint.qposadr[0] for joint in joints])
        followers = {follower for _, follower in robot.coupled}
        self._driven = np.array([index for index in range(len(joints)) if index not in followers])
        self._servos = np.array([self.model.actuator(robot.joint_names[index]).id for index in self._driven])
        self._hands = Hands(self.model, robot)
        self._all_servos = np.concatenate([self._servos, self._hands.servos])
        self._force_sensors = ForceSensors(self.model, robot)
        self._accelerometer, self._gyro = self._sensor("accelerometer"), self._sensor("gyro")
        self.torso = int(self.model.jnt_bodyid[self.model.joint("base").id])
        """Index of the torso's body."""
        self._plates = np.array([self.model.body(plate_name(side)).id for side in SIDES])
        mujoco.mj_forward(self.model, self.data)
        self._gain, self._bias = self.model.actuator_gainprm.copy(), self.model.actuator_biasprm.copy()
        self.foot_load = np.zeros(2)
        """(2,) N on the left and right sole, mean over the last ``advance``."""

    def _sensor(self, name: str) -> int:
        return int(self.model.sensor(name).adr[0])

    @property
    def weight(self) -> float:
        """N, of the robot."""
        mass = self.model.body_subtreemass[self.torso]
        return float(mass * np.linalg.norm(self.model.opt.gravity))

    def place(self, q: Array, base_pos: Array, base_quat: Array, opening: Array = CLOSED) -> None:
        """Put the robot at rest into a posture, servos commanded to stay there; q (J,) rad, pos (3,) m, quat (4,).

        opening: (2,) of the hands, 0 closed to 1 open; closed where it is NaN.
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3], self.data.qpos[3:7] = base_pos, base_quat
        self.data.qpos[self._qpos] = q
        self.data.ctrl[self._servos] = q[self._driven]
        self._hands.place(self.data, opening)
        mujoco.mj_forward(self.model, self.data)

    def soften(self, share: float) -> None:
        """Servos with a share, 0 to 1, of their stiffness and damping."""
        self.model.actuator_gainprm[:] = share * self._gain
        self.model.actuator_biasprm[:] = share * self._bias

    def push(self, force: Array) -> None:
        """Push the torso's centre of mass with a force (3,) N in the world, until told otherwise."""
        self.data.xfrc_applied[self.torso, :3] = force

    def advance(self, command: Array, duration: float, opening: Array | None = None) -> None:
        """Let ``duration`` (s) pass while the servo commands move in a straight line to ``command`` (J,) rad.

        opening: (2,) of the hands, 0 closed to 1 open, which move to it at their own speed; NaN and None keep the last.
        """
        steps = max(1, round(duration / self._settings.timestep))
        self._hands.ask(opening)
        hands = self._hands.command(self.data.ctrl[self._hands.servos], steps * self._settings.timestep)
        start, end = self.data.ctrl[self._all_servos], np.concatenate([command[self._driven], hands])
        self.foot_load[:] = 0.0
        for step in range(1, steps + 1):
            self.data.ctrl[self._all_servos] = start + (end - start) * (step / steps)
            mujoco.mj_step(self.model, self.data)
            self.foot_load += self._force_sensors.loads(self.data) / steps

    @property
    def time(self) -> float:
        """Simulated time since ``place``, s."""
        return float(self.data.time)

    @property
    def q(self) -> Array:
        """Joint angles (J,) rad."""
        return np.array(self.data.qpos[self._qpos])

    @property
    def opening(self) -> Array:
        """How far the left and right hand are open, (2,), 0 closed to 1; NaN for a robot without fingers."""
        return self._hands.opening(self.data)

    @property
    def torque(self) -> Array:
        """Servo torques (J,) N m; 0 for followers of a shared motor."""
        torque = np.zeros(len(self._qpos))
        torque[self._driven] = self.data.actuator_force[self._servos]
        return torque

    @property
    def base_pos(self) -> Array:
        """Torso in the world, (3,) m."""
        return np.array(self.data.qpos[:3])

    @property
    def base_quat(self) -> Array:
        """Torso in the world, (4,) (w, x, y, z)."""
        return np.array(self.data.qpos[3:7])

    @property
    def fsr(self) -> Array:
        """Foot forces (2, 4) N, as ``RobotState.fsr``."""
        return self._force_sensors.read(self.data)

    @property
    def accelerometer(self) -> Array:
        """(3,) m/s^2 in torso axes."""
        return np.array(self.data.sensordata[self._accelerometer : self._accelerometer + 3])

    @property
    def gyro(self) -> Array:
        """(3,) rad/s in torso axes."""
        return np.array(self.data.sensordata[self._gyro : self._gyro + 3])

    def sole_frames(self) -> tuple[Array, Array]:
        """Origins (2, 3) m and axes (2, 3, 3) of the left and right sole in the world."""
        return self.data.xpos[self._plates].copy(), self.data.xmat[self._plates].reshape(2, 3, 3)

    def center_of_pressure(self) -> Array | None:
        """Where the floor's force on the soles acts, (2,) m in the world; None while nothing is on the floor."""
        total, moment, force = 0.0, np.zeros(2), np.zeros(6)
        bodies, places = self.model.geom_bodyid[self.data.contact.geom], self.data.contact.pos
        for index in np.flatnonzero(np.isin(bodies, self._plates).any(axis=1)):
            mujoco.mj_contactForce(self.model, self.data, index, force)
            total += force[NORMAL]
            moment += force[NORMAL] * places[index, :2]
        return moment / total if total > 0.0 else None

"""The simulated robot as a ``Driver``: in real time in a thread of its own, or as fast as the computer can."""

from __future__ import annotations

import threading
import time

import mujoco
import numpy as np

from naoimitate.core.falling import has_tipped, tilt
from naoimitate.core.frames import Array, RobotCommand
from naoimitate.hw.driver import RobotState
from naoimitate.hw.feedback import feedback
from naoimitate.hw.target import ServoCommand, Target, target_of
from naoimitate.robot.model import RobotModel
from naoimitate.sim.model import Scene
from naoimitate.sim.physics import Physics
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.sensors import roll_pitch
from naoimitate.sim.settings import SimSettings

DEFAULT = SimSettings()


class MujocoDriver:
    """A robot in MuJoCo that stands in its posture ``stand`` until the first command.

    real_time: a thread lets simulated time pass with the clock (and behind it, where the computer is too slow);
    otherwise time passes only in ``advance``. compensation: add the servo commands that hold the load; learning: for
    the stiffness that the servos show, not just that of the settings; balance: all loops of ``hw.feedback``. scene:
    adds objects to the robot's world. The hands are closed until a command opens them.
    """

    def __init__(
        self,
        robot: RobotModel,
        settings: SimSettings = DEFAULT,
        *,
        compensation: bool = True,
        learning: bool = True,
        balance: bool = False,
        real_time: bool = True,
        scene: Scene | None = None,
    ) -> None:
        self._settings = settings
        self._physics = Physics(robot, settings, scene)
        self._robot, self._loops = robot, (compensation, learning, balance)
        self._real_time = real_time
        stand = robot.postures["stand"]
        self._stand = self._target = Target(stand, *stand_on_floor(robot, stand), "D")
        self._halt = threading.Event()
        self._thread: threading.Thread | None = None
        self._place()

    @property
    def period(self) -> float:
        """Time between two uses of the newest command, s."""
        return self._settings.period

    @property
    def model(self) -> mujoco.MjModel:
        """The simulated world; to look at."""
        return self._physics.model

    @property
    def snapshot(self) -> tuple[float, Array]:
        """Simulated time (s) and all positions of the world (``qpos`` of the model: robot, fingers, objects) after the
        last period; may be asked for in any thread and costs nothing."""
        return self._snapshot

    @property
    def hand_opening(self) -> Array:
        """How far the hands are open, (2,), measured after the last period; NaN for a robot without fingers."""
        return self._opening

    def connect(self) -> None:
        """Put the robot into its stand; with ``real_time`` its clock starts."""
        self.stop()
        self._place()
        if self._real_time:
            self._halt.clear()
            self._thread = threading.Thread(target=self._run, name="mujoco", daemon=True)
            self._thread.start()

    def read(self) -> RobotState:
        """Return the state after the last period."""
        return self._state

    def write(self, command: RobotCommand) -> None:
        """Replace the command that the servos follow from the next period on."""
        if not self._held:
            self._target = target_of(command)._replace(hand_opening=self._kept(command.hand_opening))

    def _kept(self, opening: Array | None) -> Array | None:
        """Openings (2,) with the last known ones in place of NaN: a command that is replaced before the next period
        has still been heard."""
        last = self._target.hand_opening
        if opening is None or last is None:
            return last if opening is None else opening
        return np.where(np.isnan(opening), last, opening)

    def soften(self, share: float) -> None:
        """Turn the servos' stiffness down to a share, 0 to 1, from the next period on."""
        self._physics.soften(share)

    def emergency_stop(self) -> None:
        """Hold the present target: further commands are ignored until ``connect``."""
        self._held = True

    def stop(self) -> None:
        """Stop the clock; the robot stays as it is, there is nothing that could fall."""
        self._halt.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def advance(self, duration: float) -> RobotState:
        """Let simulated time pass (s, whole periods) as fast as the computer can; only without ``real_time``."""
        for _ in range(max(1, round(duration / self.period))):
            self._tick()
        return self._state

    def _closed(self) -> ServoCommand:
        """What is added to a target, new for each connection: loops remember the robot's clock and its servos."""
        compensation, learning, balance = self._loops
        stiffness = self._settings.stiffness if compensation else None
        return feedback(self._robot, stiffness, self.period, learning=learning, balance=balance)

    def _place(self) -> None:
        target, self._held, self._servos = self._stand, False, self._closed()
        self._target = target
        self._physics.soften(1.0)
        self._physics.place(target.q, target.base_pos, target.base_quat)
        self._observe(target)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._halt.is_set():
            self._tick()
            due = max(due + self.period, time.monotonic())
            self._halt.wait(max(0.0, due - time.monotonic()))

    def _tick(self) -> None:
        target = self._target
        self._physics.advance(self._servos(target, self._state), self.period, target.hand_opening)
        self._observe(target)

    def _observe(self, target: Target) -> None:
        """Take what other threads may ask for; each is one value that is replaced as a whole."""
        self._snapshot = self._physics.time, np.array(self._physics.data.qpos)
        self._opening = self._physics.opening
        self._state = self._measure(target)

    def _measure(self, target: Target) -> RobotState:
        physics = self._physics
        pos, quat = physics.base_pos, physics.base_quat
        tipped = has_tipped(tilt(target.base_quat, quat), pos[2] / target.base_pos[2])
        return RobotState(
            time=physics.time,
            q=physics.q,
            torque=physics.torque,
            angles=roll_pitch(quat),
            gyro=physics.gyro,
            accelerometer=physics.accelerometer,
            fsr=physics.fsr,
            fell=bool(tipped),
            base_pos=pos,
            base_quat=quat,
        )

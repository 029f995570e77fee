"""The only way to a driver: every command passes the gate, every reading the fall latch, and it can always be stopped.

``GuardedDriver`` is a driver itself, so that a program cannot tell the difference and has nothing else to hold. Its
clock is real time; the gate and the latch behind it are pure.
"""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator

from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import DriverError, NaoimitateError
from naoimitate.core.frames import RobotCommand
from naoimitate.fsm.fall_latch import Action, FallLatch
from naoimitate.hw.brace import braced, give_way
from naoimitate.hw.condition import WATCHED, Condition, Delays, GuardSettings, GuardStatus, one_line
from naoimitate.hw.driver import INTERRUPTED, Driver, RobotState
from naoimitate.hw.lean import UPRIGHT, lean, turning
from naoimitate.hw.letting_go import LettingGo
from naoimitate.hw.spell import Spell

__all__ = ["NOT_LIVE", "Condition", "Delays", "GuardSettings", "GuardStatus", "GuardedDriver"]

NOT_LIVE = "not live"
"""Why a command is refused before ``connect`` and after the end."""


class GuardedDriver:
    """A driver behind a gate and a fall latch. Nobody else should hold the driver that it is given.

    All methods may be called from any thread, ``emergency_stop`` from a signal handler too.
    """

    def __init__(
        self,
        driver: Driver,
        gate: CommandGate,
        settings: GuardSettings | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.__driver, self._gate, self._settings, self._clock = driver, gate, settings or GuardSettings(), clock
        self._lock = threading.RLock()
        self._latch = FallLatch(self._settings.fall)
        self._letting_go = LettingGo(self._stop_driver, self._stop_again)
        self._alive, self._problem = Condition.OFF, ""
        self._over: Condition | None = None
        self._pressed = False
        self._accepted, self._refused = 0, Counter[str]()
        self._refusing: tuple[str, ...] = ()
        self._catching_up, self._delays = False, Delays()
        self._alarms: tuple[str, ...] = ()
        self._command: RobotCommand | None = None
        self._state: RobotState | None = None
        self._passed = self._checked = self._sensed = 0.0
        self._faulty = Spell(0.0)
        self._lean = math.nan

    @property
    def period(self) -> float:
        """Time between two uses of the newest command, s."""
        return self.__driver.period

    @property
    def command(self) -> RobotCommand | None:
        """The command in force: the last one that passed, or the last step of catching up."""
        return self._command

    @property
    def delays(self) -> Delays:
        """How long the newest ``write`` took, and in what."""
        return self._delays

    @property
    def state(self) -> RobotState | None:
        """The newest reading; None before the first."""
        return self._state

    @property
    def _condition(self) -> Condition:
        """How it ended, or what it is in: an end that comes in between is never written over."""
        return Condition.EMERGENCY if self._pressed else self._over or self._alive

    @property
    def status(self) -> GuardStatus:
        """How things are now. Waits for nobody: ``connect`` may take long, and what it does is to be seen meanwhile."""
        condition = self._condition
        return GuardStatus(
            condition,
            self._accepted,
            dict(self._refused),
            self._refusing,
            self._clock() - self._passed if condition is Condition.LIVE else 0.0,
            self._lean,
            self._alarms,
            self._problem,
            self._catching_up and condition is Condition.LIVE,
        )

    def connect(self) -> None:
        """Connect the driver; commands then pass from where the robot is measured to stand.

        Raises DriverError after a fall or an emergency stop that nobody has reset, and where the driver cannot.
        """
        with self._lock:
            if self._condition in (Condition.FALLING, Condition.FALLEN, Condition.EMERGENCY):
                raise DriverError(f"{self._condition.value}: put the robot on its feet, then reset and connect again")
            self.stop()  # a connection that nobody has ended
            self._latch, self._command, self._problem, self._refusing = FallLatch(self._settings.fall), None, "", ()
            self._letting_go = LettingGo(self._stop_driver, self._stop_again)
            self._alive, self._over = Condition.CONNECTING, None
            try:
                self._connect_driver()
            except BaseException:
                self._end(Condition.STOPPED)
                raise
            if self._condition is not Condition.CONNECTING:
                self._letting_go.wait()
                self._stop_driver()  # again: the driver may have gone on after the last
                raise DriverError(f"{self._condition.value} while the robot was being connected")
            self._alive = Condition.LIVE

    def _connect_driver(self) -> None:
        with self._used() as driver:
            try:
                if self._pressed:  # since connecting began, but before there was a connection to end
                    raise DriverError(INTERRUPTED)
                driver.connect()
            finally:
                self._letting_go.arrived()
            self._begin(driver.read())

    def _begin(self, state: RobotState) -> None:
        """Start gate and latch where the robot is."""
        self._gate_state = self._gate.begin(state.q)
        self._sensed = state.time
        self._passed = self._checked = self._clock()
        self._faulty = Spell(self._passed)

    def read(self) -> RobotState:
        """The robot's newest state, once the fall latch has seen it.

        A driver that fails here ends the motion: a robot that cannot be watched is let go of. Raises NaoimitateError.
        """
        with self._used() as driver:
            state = driver.read()
            with self._lock:
                self._state = state
                self._watch(state)
        return state

    def write(self, command: RobotCommand) -> None:
        """Let a command pass, or a step towards it, or hold the last one: ``status`` says which and why.

        A robot that was held while its method went on catches up by steps of the gate, see ``CommandGate.catch_up``. A
        driver that fails is let go of.
        """
        with self._lock:
            if self._condition in WATCHED:
                with contextlib.suppress(NaoimitateError):  # it has ended the motion, and ``status`` says why
                    self.read()
            if self._condition is not Condition.LIVE:
                self._refuse((NOT_LIVE,))
                return
            now, started = self._clock(), time.perf_counter()
            verdict = self._gate.catch_up(self._gate_state, command, now - self._checked)
            self._checked, self._gate_state = now, verdict.state
            self._refuse(tuple(refusal.value for refusal in verdict.refusals))
            gated = time.perf_counter()
            if verdict.accepted is not None and self._condition is Condition.LIVE:  # no emergency stop in between
                self._command, self._passed = verdict.accepted, now
                self._accepted += not verdict.refusals
                self._hand_over(verdict.accepted)
            self._catching_up = verdict.accepted is not None and bool(verdict.refusals)
            self._delays = Delays(gated - started, time.perf_counter() - gated)

    def _hand_over(self, command: RobotCommand) -> None:
        with contextlib.suppress(NaoimitateError), self._used() as driver:
            driver.write(command)

    def soften(self, share: float) -> None:
        """Turn the servos' stiffness down to a share, 0 to 1, of its normal value; ignored unless it holds itself.

        A driver that fails is let go of, and its error raised.
        """
        if self._condition in (Condition.LIVE, Condition.FAULT):
            with self._used() as driver:
                driver.soften(min(max(share, 0.0), 1.0))

    def stop(self) -> None:
        """End the motion safely and let go of the robot; returns when that is done. May be called twice.

        Where the wait is interrupted (Ctrl-C), letting go goes on by itself, and a second ``stop`` waits for it again.
        """
        self._end(Condition.STOPPED)
        if self._alive is not Condition.OFF:
            self._letting_go.wait()

    def emergency_stop(self) -> None:
        """End every motion at once, soften the servos, then let go of the robot: hold it, it ends limp.

        First the driver's own emergency stop, then ``emergency_stiffness``, then the driver's ``stop``, which may take
        seconds. Until that is over the robot stands in the last command that passed, a balanced pose. A robot that
        falls meanwhile is not softened more. May be called twice: the driver's own emergency stop is repeated. No
        command passes any more until ``reset``.

        Nothing here waits for a lock, since whoever holds one may be the one that is interrupted, nor longer than
        ``letting_go.GRACE``: another thread goes on with letting go, and ``stop`` waits for it.
        """
        self._pressed = True
        self._try(self.__driver.emergency_stop)
        self._end(Condition.EMERGENCY, self._settings.emergency_stiffness)

    def reset(self) -> None:
        """A person has looked at the robot and says that it may be connected again."""
        with self._lock:
            if self._condition is Condition.FALLING:
                raise DriverError("the robot is falling: wait until it lies, put it on its feet, then reset")
            if self._condition in (Condition.FALLEN, Condition.EMERGENCY):
                self._over, self._pressed = Condition.STOPPED, False

    def _refuse(self, reasons: tuple[str, ...]) -> None:
        self._refusing = reasons
        if reasons:
            self._refused = self._refused + Counter(reasons)  # a new one, since other threads read it

    def _watch(self, state: RobotState) -> None:
        """Alarms and faults, and the fall latch once per new reading."""
        if self._condition not in WATCHED:
            return
        self._alarms = (*state.faults, *state.alarms)
        lasted = self._faulty.look(bool(state.faults), self._clock())
        if self._condition is Condition.LIVE and lasted >= self._settings.fault_patience:
            self._alive, self._problem = Condition.FAULT, "; ".join(state.faults)
        dt = state.time - self._sensed
        if dt <= 0.0:
            return
        self._sensed = state.time
        self._lean = lean(UPRIGHT if self._command is None else self._command.base_quat, state.angles)
        action = self._latch.sense(self._lean, turning(state.gyro), state.fell, dt)
        if action is Action.SOFTEN:
            obeys = self._settings.fall_response == "brace" and self._condition is Condition.LIVE
            brace = braced(self._command, self._gate.postures, state.angles) if obeys else None
            self._alive = Condition.FALLING
            self._try(lambda: give_way(self.__driver, self._settings, brace))
        elif action is Action.STOP:
            self._end(Condition.FALLEN)

    def _end(self, condition: Condition, stiffness: float | None = None) -> None:
        """Let go of the robot, once for each connection, and stay in a defined condition whatever the driver does."""
        if self._alive is Condition.OFF or not self._letting_go.begin():
            return
        fell = self._alive is Condition.FALLING
        self._over = Condition.FALLEN if fell else condition
        try:
            if stiffness is not None and not fell:
                self._try(lambda: self.__driver.soften(stiffness))
        finally:
            self._letting_go.go()
        if condition is Condition.EMERGENCY:
            self._letting_go.wait_briefly()
        else:
            self._letting_go.wait()

    def _stop_driver(self) -> None:
        self._try(self.__driver.stop)

    def _stop_again(self) -> None:
        if self._pressed:
            self._try(self.__driver.emergency_stop)
        self._stop_driver()

    @contextlib.contextmanager
    def _used(self) -> Iterator[Driver]:
        """The driver, to do something with: where it fails in any way the motion ends, with an error of one line."""
        try:
            yield self.__driver
        except Exception as error:  # a driver may fail in any way
            self._problem = one_line(error)
            self._end(Condition.STOPPED)
            if isinstance(error, NaoimitateError):
                raise
            raise DriverError(self._problem) from error

    def _try(self, do: Callable[[], None]) -> None:
        """Do what must not stop the rest from being done."""
        try:
            do()
        except Exception as error:  # a driver may fail in any way; the end goes on
            self._problem = one_line(error)

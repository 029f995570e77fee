"""A live session: frames of the operator and the passing of time become commands for the robot.

No socket, no clock, no driver: time is told with every call, so that a recording gives the same commands again. In
every state the imitator makes the command: of the operator, of their last posture, or of a calm stand-in who stands
relaxed or shows the T-pose. So all that the robot ever does is a statically stable step within its limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from naoimitate.calib.subject import Subject, calibrate
from naoimitate.core.frames import HumanFrame, RobotCommand
from naoimitate.fsm.session import Action, Event, SessionFsm, State
from naoimitate.imitator import Imitator
from naoimitate.live.eye import Eye
from naoimitate.motion.builtin import relaxed, tpose
from naoimitate.robot.model import RobotModel
from naoimitate.settings import Settings


@dataclass(frozen=True)
class SessionSettings:
    """How a session deals with its operator."""

    predict: float = 0.1
    """[s] for which landmarks are continued when no frame comes."""
    hold: float = 0.25
    """[s] without a frame after which the robot keeps the last posture."""
    back: float = 10.0
    """[s] without a frame after which the robot goes back to a stand."""
    blend_in: float = 1.5
    """[s] of a minimum-jerk way from where the robot is to the operator's posture."""
    blend_back: float = 2.0
    """[s] of the way to a stand, or to the T-pose that asks for one."""
    filtered: bool = True
    """Whether landmarks are filtered."""
    mirror: bool = False
    """Whether the operator faces the robot: left and right are exchanged."""


@dataclass(frozen=True)
class Tick:
    """One step of a session.

    command: for the driver. state: of the session machine. arrival: s, of the newest frame of the operator that this
    command uses, NaN unless tracking. fresh: whether a frame caused the step. began: whether a run begins here. told:
    what the session was told since the last step, with reasons.
    """

    command: RobotCommand
    state: State
    arrival: float
    fresh: bool
    began: bool
    told: tuple[tuple[Event, str], ...] = ()


_OPERATED = (State.BLENDING, State.TRACKING)
_KEPT = (State.HOLDING, State.CLUTCHED)
_STILL = (State.FAULT, State.STOPPED)


class Session:
    """The session machine with the imitator, the input filter and the T-pose watch that belong to it."""

    def __init__(
        self,
        robot: RobotModel,
        settings: Settings | None = None,
        live: SessionSettings | None = None,
        subject: Subject | None = None,
    ) -> None:
        self.imitator = Imitator(robot, settings)
        self._live = live or SessionSettings()
        self._fsm = SessionFsm(measured=subject is not None)
        self.eye = Eye(self._live.filtered, self._live.mirror)
        self._stand_in = calibrate(tpose())
        self._still, self._tpose = relaxed(), tpose()
        self.subject = subject
        self.reason = ""
        """Why the session is in fault."""
        self._command: RobotCommand | None = None
        self._person: HumanFrame | None = None
        self._kept: HumanFrame | None = None
        self._fresh: HumanFrame | None = None
        self._arrival, self._now, self._dt = -math.inf, math.nan, 0.01
        self._played = ""
        """Who is imitated: ``operator``, ``T-pose`` or ``standing``; ``nobody`` after a reset, until somebody asks."""
        self._caused = self._began = False
        self._upper_body = self.imitator.upper_body
        self._told: list[tuple[Event, str]] = []

    @property
    def state(self) -> State:
        """The state of the session machine."""
        return self._fsm.state

    @property
    def countdown(self) -> float:
        """Seconds for which the T-pose still has to be held."""
        return self.eye.countdown

    def warm_up(self) -> None:
        """Step through postures until everything is compiled; the session begins afterwards as if never used."""
        self.imitator.use(self._stand_in)
        self.imitator.stand()
        for frame, support in ((self._tpose, "D"), (self._still, "L"), (self._still, "D")):
            for _ in range(100):
                self.imitator.step(frame, 0.05, support=support)
        warm = Eye()
        for k in range(20):
            seen = warm.look(replace(self._tpose, time=0.01 * k, support=None))
            self.imitator.step(warm.expected(seen, 0.01 * k + 0.005), 0.01)
            warm.measure(seen)

    def start(self) -> None:
        """The robot stands in its posture ``stand``, connected."""
        self._take(Event.START)

    def see(self, frame: HumanFrame, arrival: float) -> None:
        """The newest frame of the operator, its time on the sender's clock (NaN: not told), and when it came."""
        self._fresh, self._arrival = self.eye.receive(frame, arrival), arrival

    def tell(self, event: Event, reason: str = "") -> None:
        """What no frame says: the operator's ``CLUTCH``, ``BODY``, ``RESET`` and ``STOP``, the robot's ``FAULT``.

        reason: of a fault. A reset says that the robot stands in its posture ``stand`` again.
        """
        self._told.append((event, reason))
        action = self._take(event)
        if event is Event.CLUTCH:
            self.eye.forget()
        elif event is Event.BODY and action is not None:
            self._upper_body = not self._upper_body
        elif event is Event.FAULT and action is not None:
            self.reason = reason

    def step(self, now: float) -> Tick:
        """The next command, at ``now`` s: ``observe``, then ``imitate``."""
        self.observe(now)
        return self.imitate()

    def observe(self, now: float) -> None:
        """What the newest frame, or its absence, means at ``now`` s; ``imitate`` follows."""
        fresh = self._fresh
        self._dt = now - self._now if math.isfinite(self._now) else 0.01
        self._now, self._fresh, self._caused, self._began = now, None, fresh is not None, False
        if fresh is not None:
            self._observe(fresh)
        else:
            self._miss(now)

    def imitate(self) -> Tick:
        """The command for the moment that was observed."""
        command = self._command = self._next_command()
        if self.state is State.BLENDING and not self.imitator.blending:
            self._take(Event.BLENDED)
        stands = not self.imitator.blending and command.support == "D"
        if self.state in (State.RETURNING, State.STOPPING) and stands:
            self._take(Event.STANDING)
        arrival = self._arrival if self.state is State.TRACKING else math.nan
        told, self._told = tuple(self._told), []
        return Tick(command, self.state, arrival, self._caused and self.state in _OPERATED, self._began, told)

    def _observe(self, frame: HumanFrame) -> None:
        """Take a frame of the operator, tell the machine, and measure who holds a T-pose."""
        self._person = self.eye.look(frame)
        self._take(Event.FRAME)
        if self.state in (State.CALIBRATING, State.CLUTCHED):
            subject = self.eye.measure(self._person)
            if subject is not None:
                self.subject = subject
                self._take(Event.TPOSE)

    def _miss(self, now: float) -> None:
        """No frame in this step: what that means after so long."""
        silent = now - self._arrival
        if silent > self._live.hold:
            self._take(Event.LATE)
        if silent > self._live.back:
            self._take(Event.LOST)

    def _take(self, event: Event) -> Action | None:
        if event in (Event.LATE, Event.CLUTCH) and self.state in _OPERATED:
            self._kept = self._expected()
        action = self._fsm.take(event)
        if action in (Action.BEGIN, Action.REST):
            self._begin()
            self._played = "standing" if action is Action.BEGIN else "nobody"
        elif action is Action.CALIBRATE:
            self._began, self._played = True, ""
        elif action is Action.BLEND or (action is Action.STAND and self._played == "operator"):
            self._played = ""
        return action

    def _begin(self) -> None:
        """From the robot's own stand; nobody has been seen yet."""
        self.imitator.use(self._stand_in)
        self.imitator.stand()
        self._person, self.reason = None, ""
        self._arrival = -math.inf

    def _next_command(self) -> RobotCommand:
        """One step of the imitator, of whom the state says; where nothing may move, the last command again."""
        if self.state in _STILL and self._command is not None:
            return replace(self._command, time=self._command.time + self._dt)
        if self.state in _OPERATED or (self.state in _KEPT and self._played == "operator"):
            assert self.subject is not None
            self._play("operator", self.subject, self._live.blend_in)
            return self.imitator.step(self._expected(), self._dt)
        if self.state is State.CLUTCHED and self._played == "nobody":
            return self.imitator.hold(self._still, self._dt)
        showing = self.state is State.CALIBRATING
        self._play("T-pose" if showing else "standing", self._stand_in, self._live.blend_back)
        return self.imitator.step(self._tpose if showing else self._still, self._dt)

    def _play(self, who: str, subject: Subject, duration: float) -> None:
        """Imitate somebody from now on, from where the robot is."""
        if self._played == who:
            return
        self._played, self.imitator.upper_body = who, self._upper_body
        self.imitator.turn_to(subject)
        self.imitator.blend(duration)

    def _expected(self) -> HumanFrame:
        """The operator now: continued for a short while from when they were seen, or as they were kept."""
        if self.state in _KEPT and self._kept is not None:
            return self._kept
        assert self._person is not None
        return self.eye.expected(self._person, min(self._now, self._person.time + self._live.predict))

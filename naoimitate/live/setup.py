"""How a session is set up: what the operator chooses, as a value that a recording can keep."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from naoimitate.balance.offset import OffsetLaw
from naoimitate.calib.subject import parse_subject
from naoimitate.core.errors import StreamError
from naoimitate.live.session import Session, SessionSettings
from naoimitate.robot.model import RobotModel
from naoimitate.settings import CHOICES, SHIFTS, Settings


@dataclass(frozen=True)
class Setup:
    """The operator's choices.

    speed_limit: share of the usual speeds. upper_body: the robot stands, and imitates arms and head only. mirror: the
    operator faces the robot. filtered: landmarks are filtered. subject: text of a subject file, empty for none. head:
    as in ``Settings``. shift: as in ``OffsetLaw``.
    """

    speed_limit: float = 1.0
    upper_body: bool = False
    mirror: bool = False
    filtered: bool = True
    subject: str = ""
    head: str = "follow"
    shift: str = "pendulum"

    def session(self, robot: RobotModel) -> Session:
        """A new session; CalibrationError where the subject's text is none."""
        limits, share = Settings().limits, self.speed_limit
        slower = replace(
            limits,
            hand_speed=share * limits.hand_speed,
            foot_speed=share * limits.foot_speed,
            head_speed=share * limits.head_speed,
            joint_share=share * limits.joint_share,
        )
        offset = OffsetLaw(shift=self.shift)
        settings = replace(Settings(), limits=slower, offset=offset, upper_body=self.upper_body, head=self.head)
        subject = parse_subject(self.subject, "the subject") if self.subject else None
        return Session(robot, settings, SessionSettings(filtered=self.filtered, mirror=self.mirror), subject)

    def header(self) -> dict[str, Any]:
        """For the header of a recording."""
        return asdict(self)

    @staticmethod
    def of(header: Any) -> Setup:
        """The setup that a header keeps; StreamError where it keeps none."""
        if not isinstance(header, dict):
            raise StreamError("this recording does not say how its session was set up: record it anew")
        known = {f.name: header[f.name] for f in fields(Setup) if f.name in header}
        usual = asdict(Setup())
        for name, value in known.items():
            if type(value) is not type(usual[name]) or not _possible(name, value):
                raise StreamError(f"this recording was set up with {name} = {value!r}, which cannot be: record it anew")
        return Setup(**known)


def _possible(name: str, value: Any) -> bool:
    """Whether a value of the right type can be the operator's choice."""
    if name == "head":
        return value in CHOICES["head"]
    if name == "shift":
        return value in SHIFTS
    return name != "speed_limit" or 0.0 < value <= 1.0

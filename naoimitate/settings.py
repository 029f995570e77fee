"""Everything that can be chosen about an imitation, in one frozen value."""

from __future__ import annotations

from dataclasses import dataclass, field

from naoimitate.balance.clearance import ClearanceSettings
from naoimitate.balance.legs import LegLimits, LegWeights
from naoimitate.balance.offset import OffsetLaw
from naoimitate.balance.paper import PaperIk
from naoimitate.balance.swing import SwingSettings
from naoimitate.core.errors import SettingsError
from naoimitate.gate import GateLimits
from naoimitate.gaze import HANDS
from naoimitate.limb import LimbWeights
from naoimitate.limits import TaskLimits

SHIFTS = ("pendulum", "parabola")
"""What ``OffsetLaw.shift`` can be."""
CHOICES = {
    "retarget": ("planted", "paper", "direct"),
    "reference": ("virtual", "reachable"),
    "hand_orientation": ("free", "upright", "follow"),
    "head": ("follow", *HANDS),
}
"""What the choices of ``Settings`` can be."""


@dataclass(frozen=True)
class Settings:
    """Choices and parameters of the method; the defaults are ours, ``PAPER`` is the published set.

    Raises SettingsError for a choice that does not exist.
    """

    retarget: str = "planted"
    """``planted``: soles fixed in the world. ``paper``: one foot is shifted. ``direct``: no stabilisation (falls)."""
    reference: str = "virtual"
    """T-pose of the robot in (5): ``virtual`` (limits ignored) or ``reachable`` (its calibration posture)."""
    hand_orientation: str = "free"
    """``free``, ``upright`` or ``follow`` the person's hands."""
    head: str = "follow"
    """``follow`` the person's head, or look at the robot's own ``left-hand`` or ``right-hand`` (section VI-D)."""
    upper_body: bool = False
    """Whether the robot only stands, and imitates arms and head."""
    paper_ik: PaperIk | None = None
    """The paper's inverse kinematics in place of ours, for ``paper`` and ``direct``."""
    limits: TaskLimits = field(default_factory=TaskLimits)
    offset: OffsetLaw = field(default_factory=OffsetLaw)
    swing: SwingSettings = field(default_factory=SwingSettings)
    legs: LegLimits = field(default_factory=LegLimits)
    leg_weights: LegWeights = field(default_factory=LegWeights)
    arm_weights: LimbWeights = field(default_factory=LimbWeights)
    clearance: ClearanceSettings = field(default_factory=ClearanceSettings)
    gate: GateLimits = field(default_factory=GateLimits)

    def __post_init__(self) -> None:
        """Look at the choices."""
        made = [(name, getattr(self, name), choices) for name, choices in CHOICES.items()]
        for name, choice, choices in (*made, ("offset.shift", self.offset.shift, SHIFTS)):
            if choice not in choices:
                raise SettingsError(f"settings: {name} is {choice!r}, choose one of {', '.join(choices)}")


PAPER = Settings(retarget="paper", reference="reachable", paper_ik=PaperIk(), offset=OffsetLaw(shift="parabola"))
"""Koenemann 2014: damping 0.3, 30 arm and 5 leg iterations, 1 mm and 0.033 rad, the robot's own T-pose."""

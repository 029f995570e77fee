"""Everything that can be chosen about an imitation, in one frozen value."""

from __future__ import annotations

from dataclasses import dataclass, field

from naoimitate.balance.clearance import ClearanceSettings
from naoimitate.balance.legs import LegLimits, LegWeights
from naoimitate.balance.offset import OffsetLaw
from naoimitate.balance.paper import PaperIk
from naoimitate.balance.swing import SwingSettings
from naoimitate.gate import GateLimits
from naoimitate.limb import LimbWeights
from naoimitate.limits import TaskLimits


@dataclass(frozen=True)
class Settings:
    """Choices and parameters of the method; the defaults are ours, ``PAPER`` is the published set."""

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


PAPER = Settings(retarget="paper", reference="reachable", paper_ik=PaperIk(), offset=OffsetLaw(shift="parabola"))
"""Koenemann 2014: damping 0.3, 30 arm and 5 leg iterations, 1 mm and 0.033 rad, the robot's own T-pose."""

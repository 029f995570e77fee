"""What one frame asks of the feet: support mode, offset and swing foot, advanced together (section V-A and V-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.balance.landing import LandingSet
from naoimitate.balance.legs import FREE, POSE, REACH
from naoimitate.balance.offset import OffsetLaw, Span, advance
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Footing
from naoimitate.balance.sway import ONE_FOOT, QUIET, TWO_FEET, SwayLimits
from naoimitate.balance.swing import Phase, Swing, SwingSettings
from naoimitate.core.geometry import heading, wrap, yaw_matrix
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.fsm.support import OFFSET_REACHED, wanted_stance

Array = npt.NDArray[np.float64]

LIFT_STILL = 0.1
"""[s] for which the offset has been where it belongs before a foot is lifted: the servos have unloaded it by then."""
COM_LATE = 0.003
"""[m] by which the CoM may be off its place before the offset waits for it..."""
PATIENCE = 0.15
"""[s] ...and the time in which as much again is let pass: a CoM that cannot get there must not wait for ever."""
COM_THERE = 0.006
"""[m] by which it may be off its place over one foot when the other one is lifted."""
ONE_SIDED = 0.1
"""Share of the weight on a foot below which the other one stands alone."""
_KINDS = {Phase.LIFT: POSE, Phase.FREE: FREE, Phase.APPROACH: REACH, Phase.DESCEND: POSE}


@dataclass(frozen=True)
class Plan:
    """What one frame asks of the legs.

    offset, offset_speed: the normalised offset to reach and its speed, 1/s. sole_pos (3,), sole_rot (3, 3): pose of the
    sole on which the base does not hang. kind, min_height: as in ``legs.Stance``. sway: how
    much the body may move. touchdown: the step ends with the
    foot on the floor. clipped: the landing place is not the human's.
    """

    offset: float
    offset_speed: float
    sole_pos: Array
    sole_rot: Array
    kind: int
    sway: SwayLimits = TWO_FEET
    min_height: float = 0.0
    touchdown: bool = False
    clipped: bool = False


class Stride:
    """The support machine with the offset and the swing foot that belong to it, on planted soles."""

    def __init__(self, maker: PoseMaker, landing: LandingSet, law: OffsetLaw, swing: SwingSettings) -> None:
        self._maker, self.landing, self._law, self._swing_settings = maker, landing, law, swing
        self.restart(np.zeros((2, 3)), np.stack([np.eye(3), np.eye(3)]), 0.5)

    def restart(self, planted_pos: Array, planted_rot: Array, offset: float) -> None:
        """Stand in double support on soles at (2, 3) m, (2, 3, 3) in the world with a normalised offset."""
        self._fsm = SupportFsm()
        self.planted_pos, self.planted_rot = planted_pos.copy(), planted_rot.copy()
        self.offset, self._offset_speed = offset, 0.0
        self.side, self._still, self._waited = 1, 0.0, 0.0
        self._swing: Swing | None = None
        self._good = self._can_stand_on_both()

    @property
    def mode(self) -> Mode:
        """The robot's support mode."""
        return self._fsm.mode

    @property
    def swinging(self) -> bool:
        """Whether one foot does not carry."""
        return self.mode is not Mode.DOUBLE

    @property
    def may_lift(self) -> bool:
        """Whether the offset has been where it belongs, and the body at rest, for long enough to lift a foot."""
        return self._still > LIFT_STILL

    def plan(self, pose: Pose, footing: Footing, calm: bool, dt: float) -> Plan:
        """Advance the support machine, the offset and the swing foot by dt s from the present pose.

        calm: whether the body moves little enough for a foot to be lifted.
        """
        before = self.mode
        given = SupportInput(
            human=footing.support,
            offset=self.offset,
            descending=self._swing is not None and self._swing.phase is Phase.DESCEND,
            stance_ok=(True, True) if self.swinging else self._stance_ok(),
            ahead=footing.ahead,
            may_lift=footing.may_lift and self.may_lift,
        )
        if self._fsm.step(given) is not before:
            self._changed(before)
        target = offset_target(self.mode, given, footing.offset)
        left, right = self._maker.centres(self.planted_pos, self.planted_rot)
        span = self._span(left, right, float(pose.com[2]))
        error = float(np.hypot(*(pose.com[:2] - self.com_goal(self.offset))))
        late = self._is_late(error, dt)
        there = abs(self.offset - target) < OFFSET_REACHED and not late and error < COM_THERE
        self._still = self._still + dt if there and calm and not self.swinging else 0.0
        wanted = self.offset if late else target
        offset, speed = advance(
            self.offset, self._offset_speed, wanted, dt, self._law, self._law.push(self.offset, wanted, span)
        )
        if self._swing is None:
            self.planted_pos[:, 2] = np.maximum(self.planted_pos[:, 2] - self._swing_settings.touch_speed * dt, 0.0)
            other = 1 - self.side
            lifting = there and (given.ahead or wanted_stance(self.mode, given) != "D")
            sway = QUIET if lifting else self._sway_on_both()
            return Plan(offset, speed, self.planted_pos[other], self.planted_rot[other], POSE, sway)
        return self._swing_plan(self._swing, pose, footing, (offset, speed), dt)

    def _span(self, left: Array, right: Array, height: float) -> Span:
        """What the weight is shifted on, soles as they stand."""
        line = (right - left)[:2]
        length = float(np.hypot(*line))
        along = line / max(length, 1e-6)
        reach = self._maker.reach(self.planted_rot, along)
        return Span(length, height, -reach[0], length + reach[1])

    def shift(self, plan: Plan) -> tuple[Array, Array]:
        """Velocity (2,) m/s at which the CoM is to be shifted before and after a plan's frame."""
        left, right = self._maker.centres(self.planted_pos, self.planted_rot)
        line = (right - left)[:2]
        return self._offset_speed * line, plan.offset_speed * line

    def _is_late(self, error: float, dt: float) -> bool:
        """Whether the CoM, ``error`` m off its place, is behind; for longer and longer only if it is farther off."""
        self._waited = self._waited + dt if error > COM_LATE else 0.0
        return error > COM_LATE * (1.0 + self._waited / PATIENCE)

    def _swing_plan(self, swing: Swing, pose: Pose, footing: Footing, offset: tuple[float, float], dt: float) -> Plan:
        foot = 1 - self.side
        stance_yaw = heading(self.planted_rot[self.side])
        place, turn, clipped = self.landing.clip(foot, *self._landing_wish(swing, footing))
        goal = self.planted_pos[self.side][:2] + yaw_matrix(stance_yaw)[:2, :2] @ place
        position, rotation, down = swing.step(
            pose.sole_pos[foot], pose.sole_rot[foot], goal, stance_yaw + turn, self.mode.landing, dt
        )
        moving = swing.phase in (Phase.FREE, Phase.APPROACH) and not swing.hovering
        kind, sway = _KINDS[swing.phase], ONE_FOOT if moving else QUIET
        return Plan(*offset, position, rotation, kind, sway, swing.min_height, down, clipped and self.mode.landing)

    def _sway_on_both(self) -> SwayLimits:
        """Two feet of which one carries next to nothing are as one."""
        return TWO_FEET if ONE_SIDED < self.offset < 1.0 - ONE_SIDED else ONE_FOOT

    def _landing_wish(self, swing: Swing, footing: Footing) -> tuple[Array, float]:
        """Where the person's foot is; more and more the middle of the landing set when it cannot get down there."""
        (place, turn), late = footing.landing(1 - self.side), swing.lateness
        if late == 0.0:
            return place, turn
        return place + late * (self.landing.middle(1 - self.side) - place), (1.0 - late) * turn

    def accept(self, plan: Plan, scale: float) -> None:
        """``scale`` of the way to the plan was taken."""
        self.offset += scale * (plan.offset - self.offset)
        self._offset_speed = plan.offset_speed if scale == 1.0 else 0.0
        if plan.touchdown and scale == 1.0:
            foot = 1 - self.side
            self.planted_pos[foot], self.planted_rot[foot] = plan.sole_pos, plan.sole_rot
            self._fsm.step(SupportInput(human="D", offset=self.offset, landed=True))
            self._swing, self._good = None, self._can_stand_on_both()

    def hold(self) -> None:
        """The plan was not taken: offset and swing start again from rest."""
        self._offset_speed = 0.0
        if self._swing is not None:
            self._swing.stop()

    def com_goal(self, offset: float) -> Array:
        """Where the CoM's projection belongs, (2,) m: p_L + o (p_R - p_L), on the feet as they stand or last stood."""
        left, right = self._maker.centres(self.planted_pos, self.planted_rot)
        return np.asarray((left + offset * (right - left))[:2])

    def _changed(self, before: Mode) -> None:
        if before is Mode.DOUBLE:
            self.side = 0 if self.mode.stance == "L" else 1
            foot = 1 - self.side
            self._swing = Swing(self.planted_pos[foot], self.planted_rot[foot], self._swing_settings)

    def _stance_ok(self) -> tuple[bool, bool]:
        """Whether the CoM can come over the left and the right foot with the soles where they are."""
        return (True, True) if self._good else (self.offset < 0.5, self.offset >= 0.5)

    def _can_stand_on_both(self) -> bool:
        """Whether the stance is in the landing set, seen from either foot (its polygons are not quite symmetric)."""
        return any(self._in_landing_set(swing) for swing in (0, 1))

    def _in_landing_set(self, swing: int) -> bool:
        yaw = heading(self.planted_rot[1 - swing])
        way = yaw_matrix(-yaw) @ (self.planted_pos[swing] - self.planted_pos[1 - swing])
        return self.landing.contains(swing, way[:2], wrap(heading(self.planted_rot[swing]) - yaw))

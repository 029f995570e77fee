"""What one frame asks of the feet: support mode, offset and swing foot, advanced together (section V-A and V-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from naoimitate.balance.landing import LandingSet
from naoimitate.balance.legs import DOWN, FREE, POSE, REACH
from naoimitate.balance.offset import OffsetLaw, Span, normalised_offset
from naoimitate.balance.polygon import room_around
from naoimitate.balance.pose import Pose, PoseMaker
from naoimitate.balance.retarget import Footing
from naoimitate.balance.sway import ONE_FOOT, QUIET, TWO_FEET, Ground, SwayLimits
from naoimitate.balance.swing import Phase, Swing, SwingSettings
from naoimitate.balance.weight import Body, Weight
from naoimitate.core.geometry import heading, wrap, yaw_matrix
from naoimitate.fsm import Mode, SupportFsm, SupportInput, offset_target
from naoimitate.fsm.support import wanted_stance

Array = npt.NDArray[np.float64]

COM_OFF = 0.004
"""[m] by which the CoM may be off its place while a foot comes down: a leg that pulls it along lands elsewhere."""
LANDING = 0.0032
"""[m] over the floor from which a foot lands without delay: one that hesitates there carries before its time."""
TOUCHING = 2e-5
"""[m] above the place of its touchdown from which a sole counts as there."""
LEAD = 0.001
"""[m] by which the offset may run ahead of the CoM."""
ZMP_MARGIN = 0.020
"""[m] by which the zero moment point stays inside the soles, whatever the body does..."""
ZMP_LEAST = 0.003
"""[m] ...and by which it may be off the CoM's projection in any case."""
ONE_SIDED = 0.1
"""Share of the weight on a foot below which the other one stands alone."""
_KINDS = {Phase.LIFT: POSE, Phase.FREE: FREE, Phase.APPROACH: REACH, Phase.DESCEND: DOWN}


@dataclass(frozen=True)
class Plan:
    """What one frame asks of the legs.

    offset, offset_speed: the normalised offset to reach and its speed, 1/s. target: where it is going. sole_pos (3,),
    sole_rot (3, 3): pose of the sole on which the base does not hang. kind, min_height: as in ``legs.Stance``. sway:
    how much the body may move. touchdown: the step ends with the foot on the floor. clipped: the landing place is not
    the human's.
    """

    offset: float
    offset_speed: float
    target: float
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
        self._weight = Weight(self._law, offset)
        self.side = 1
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
    def offset(self) -> float:
        """The normalised offset, 0 left to 1 right."""
        return self._weight.offset

    @property
    def settled(self) -> bool:
        """Whether the body has been where it belongs for so long that nothing sways when a foot is lifted."""
        return self._weight.settled

    def plan(self, pose: Pose, footing: Footing, body: Body, dt: float) -> Plan:
        """Advance the support machine, the offset and the swing foot by dt s from the present pose."""
        before = self.mode
        given = SupportInput(
            human=footing.support,
            offset=self.offset,
            descending=self._swing is not None and self._swing.phase is Phase.DESCEND,
            stance_ok=(True, True) if self.swinging else self._stance_ok(),
            ahead=footing.ahead,
            may_lift=footing.may_lift and self._weight.may_lift(body.steady),
        )
        if self._fsm.step(given) is not before:
            self._changed(before)
        target = offset_target(self.mode, given, footing.offset)
        left, right = self._maker.centres(self.planted_pos, self.planted_rot)
        span = self._span(left, right, float(pose.com[2]))
        error = float(np.hypot(*(pose.com[:2] - self.com_goal(self.offset))))
        rests = body.calm and not self.swinging
        offset, speed = self._weight.step(target, span, error, rests, body.pace, dt)
        if self._swing is None:
            self.planted_pos[:, 2] = np.maximum(self.planted_pos[:, 2] - self._swing_settings.touch_speed * dt, 0.0)
            other = 1 - self.side
            lifting = self._weight.there and (given.ahead or wanted_stance(self.mode, given) != "D")
            sway = QUIET if lifting else self._sway_on_both()
            return Plan(offset, speed, target, self.planted_pos[other], self.planted_rot[other], POSE, sway)
        return self._swing_plan(self._swing, pose, footing, (offset, speed, target), error, dt)

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
        return self._weight.speed * line, plan.offset_speed * line

    def ground(self, pose: Pose) -> Ground:
        """What the body stands on, and how far its zero moment point may move over that."""
        left, right = self._maker.centres(self.planted_pos, self.planted_rot)
        line = (right - left)[:2]
        along = line / max(float(np.hypot(*line)), 1e-6)
        stances = (self.mode.stance != "R", self.mode.stance != "L")
        polygon = self._maker.support_polygon(self.planted_pos, self.planted_rot, *stances)
        return Ground(along, room_around(polygon, *pose.com[:2], along, ZMP_MARGIN, ZMP_LEAST))

    def _swing_plan(
        self, swing: Swing, pose: Pose, footing: Footing, offset: tuple[float, float, float], error: float, dt: float
    ) -> Plan:
        foot = 1 - self.side
        stance_yaw = heading(self.planted_rot[self.side])
        place, turn, clipped = self.landing.clip(foot, *self._landing_wish(swing, footing))
        goal = self.planted_pos[self.side][:2] + yaw_matrix(stance_yaw)[:2, :2] @ place
        low = swing.phase is Phase.DESCEND and pose.sole_pos[foot][2] < LANDING
        if swing.phase is Phase.DESCEND and error > COM_OFF and not low:
            swing.go_up()
        position, rotation, down = swing.step(
            pose.sole_pos[foot], pose.sole_rot[foot], goal, stance_yaw + turn, self.mode.landing, dt
        )
        moving = swing.phase in (Phase.FREE, Phase.APPROACH) and not swing.hovering
        kind, sway = POSE if low else _KINDS[swing.phase], ONE_FOOT if moving else QUIET
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

    def accept(self, plan: Plan, scale: float, pose: Pose, dt: float) -> None:
        """``scale`` of the way to the plan was taken, within dt s.

        On both feet the offset runs ahead of the CoM by a little at most: a plan far ahead of legs at their limits had
        to be stopped at once. Under a free swing it goes with the CoM, which makes room for the swing. Around a
        lift-off and a landing it does not give way: the CoM is to come back to its place.
        """
        offset = self.offset + scale * (plan.offset - self.offset)
        if self._swing is None or self._swing.phase is Phase.FREE:
            left, right = self._maker.centres(self.planted_pos, self.planted_rot)
            here = normalised_offset(pose.com, left, right, self.offset)
            lead = LEAD / max(float(np.hypot(*(right - left)[:2])), self._law.min_feet_distance)
            lead = lead if self._swing is None else 0.0
            offset = min(max(offset, here - lead), here + lead)
        self._weight.move(offset, dt)
        down = pose.sole_pos[1 - self.side][2] <= plan.sole_pos[2] + TOUCHING
        if plan.touchdown and scale == 1.0 and down:
            foot = 1 - self.side
            self.planted_pos[foot], self.planted_rot[foot] = plan.sole_pos, plan.sole_rot
            self._fsm.step(SupportInput(human="D", offset=self.offset, landed=True))
            self._swing, self._good = None, self._can_stand_on_both()
            self._weight.stand(self._maker.offset(pose, self.offset))

    def hold(self) -> None:
        """The plan was not taken: offset and swing start again from rest."""
        self._weight.stand(self.offset)
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

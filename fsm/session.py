"""The session machine of live teleoperation: what the robot does about its operator, and when.

Pure: no clock, no input, no robot. The session turns what happens into events and carries out the actions; whatever the
state, every command is a statically stable step of the imitator, of the operator or of a calm stand-in.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass


class State(enum.Enum):
    """Where a session stands. ``CLUTCHED`` is also what it is in after a fall and a reset: idle until somebody asks."""

    IDLE = "idle"
    WAITING = "waiting"
    CALIBRATING = "calibrating"
    BLENDING = "blending"
    TRACKING = "tracking"
    CLUTCHED = "clutched"
    HOLDING = "holding"
    RETURNING = "returning"
    STOPPING = "stopping"
    FAULT = "fault"
    STOPPED = "stopped"


class Event(enum.Enum):
    """What can happen to a session."""

    START = "start"
    """The operator's program begins; the driver is connected."""
    FRAME = "frame"
    """A frame of the operator has come."""
    TPOSE = "T-pose"
    """The operator has held a T-pose still for long enough."""
    BLENDED = "blended"
    """The robot has come from where it was to the operator's posture."""
    CLUTCH = "clutch"
    """The operator pauses, or goes on."""
    BODY = "upper body"
    """The operator wants the upper body alone to be imitated, or the whole body again."""
    LATE = "late"
    """No frame for longer than prediction may bridge."""
    LOST = "lost"
    """No frame for so long that nobody seems to be there."""
    STANDING = "standing"
    """The robot has come back to its stand."""
    FAULT = "fault"
    """A fall, an alarm that forbids to go on, an emergency stop."""
    RESET = "reset"
    """The operator says that the robot stands again."""
    STOP = "stop"
    """The end of the session; a second one does not wait for the robot to stand."""


class Action(enum.Enum):
    """What the session does on an edge."""

    NONE = "-"
    CALIBRATE = "measure the operator, begin a run file, blend in"
    BLEND = "blend in from where the robot is"
    HOLD = "keep to the operator's last posture"
    STAND = "blend to a stand"
    FREEZE = "no command any more"
    BEGIN = "begin from the robot's stand"
    REST = "stay still in the robot's stand"
    LET_GO = "let go of the robot"


@dataclass(frozen=True)
class Edge:
    """One row of the table; guard: whether the operator has to be measured already, None where it does not matter."""

    state: State
    event: Event
    measured: bool | None
    action: Action
    next: State


_S, _E, _A = State, Event, Action
_ALIVE = (
    _S.WAITING, _S.CALIBRATING, _S.BLENDING, _S.TRACKING, _S.CLUTCHED, _S.HOLDING, _S.RETURNING,
)  # fmt: skip

EDGES: tuple[Edge, ...] = (
    Edge(_S.IDLE, _E.START, None, _A.BEGIN, _S.WAITING),
    Edge(_S.WAITING, _E.FRAME, False, _A.NONE, _S.CALIBRATING),
    Edge(_S.WAITING, _E.FRAME, True, _A.BLEND, _S.BLENDING),
    Edge(_S.WAITING, _E.CLUTCH, True, _A.NONE, _S.CLUTCHED),
    Edge(_S.CALIBRATING, _E.TPOSE, None, _A.CALIBRATE, _S.BLENDING),
    Edge(_S.CALIBRATING, _E.LATE, None, _A.STAND, _S.WAITING),
    Edge(_S.BLENDING, _E.BLENDED, None, _A.NONE, _S.TRACKING),
    Edge(_S.BLENDING, _E.LATE, None, _A.HOLD, _S.HOLDING),
    Edge(_S.BLENDING, _E.CLUTCH, None, _A.HOLD, _S.CLUTCHED),
    Edge(_S.BLENDING, _E.BODY, None, _A.BLEND, _S.BLENDING),
    Edge(_S.TRACKING, _E.LATE, None, _A.HOLD, _S.HOLDING),
    Edge(_S.TRACKING, _E.CLUTCH, None, _A.HOLD, _S.CLUTCHED),
    Edge(_S.TRACKING, _E.BODY, None, _A.BLEND, _S.BLENDING),
    Edge(_S.HOLDING, _E.FRAME, None, _A.BLEND, _S.BLENDING),
    Edge(_S.HOLDING, _E.CLUTCH, None, _A.NONE, _S.CLUTCHED),
    Edge(_S.HOLDING, _E.LOST, None, _A.STAND, _S.RETURNING),
    Edge(_S.CLUTCHED, _E.CLUTCH, None, _A.NONE, _S.WAITING),
    Edge(_S.CLUTCHED, _E.TPOSE, None, _A.CALIBRATE, _S.BLENDING),
    Edge(_S.CLUTCHED, _E.LOST, None, _A.STAND, _S.CLUTCHED),
    Edge(_S.RETURNING, _E.FRAME, None, _A.BLEND, _S.BLENDING),
    Edge(_S.RETURNING, _E.CLUTCH, None, _A.NONE, _S.CLUTCHED),
    Edge(_S.RETURNING, _E.STANDING, None, _A.NONE, _S.WAITING),
    *(
        Edge(state, _E.BODY, None, _A.NONE, state)
        for state in (_S.WAITING, _S.CALIBRATING, _S.CLUTCHED, _S.HOLDING, _S.RETURNING)
    ),
    *(Edge(state, _E.FAULT, None, _A.FREEZE, _S.FAULT) for state in (_S.IDLE, *_ALIVE, _S.STOPPING)),
    Edge(_S.FAULT, _E.RESET, None, _A.REST, _S.CLUTCHED),
    *(Edge(state, _E.STOP, None, _A.STAND, _S.STOPPING) for state in _ALIVE),
    Edge(_S.STOPPING, _E.STANDING, None, _A.LET_GO, _S.STOPPED),
    *(Edge(state, _E.STOP, None, _A.LET_GO, _S.STOPPED) for state in (_S.IDLE, _S.STOPPING, _S.FAULT)),
)
"""Every edge; an event without one in a state changes nothing."""

_TABLE = {
    (edge.state, edge.event, measured): edge
    for edge in EDGES
    for measured in ((False, True) if edge.measured is None else (edge.measured,))
}


class SessionFsm:
    """The machine with its present state; measured: whether the operator has been calibrated."""

    def __init__(self, measured: bool = False) -> None:
        self.state, self.measured = State.IDLE, measured

    def take(self, event: Event) -> Action | None:
        """Take the edge of an event, if there is one; returns its action, None where nothing changed."""
        edge = _TABLE.get((self.state, event, self.measured))
        if edge is None:
            return None
        self.state = edge.next
        self.measured = self.measured or edge.action is Action.CALIBRATE
        return edge.action


def edge_table() -> str:
    """The table of edges in Markdown, as the documentation shows it."""
    lines = ["| state | event | guard | action | next |", "|---|---|---|---|---|"]
    guards = {None: "", True: "operator measured", False: "operator not measured"}
    for e in EDGES:
        lines.append(
            f"| {e.state.value} | {e.event.value} | {guards[e.measured]} | {e.action.value} | {e.next.value} |"
        )
    return "\n".join(lines) + "\n"

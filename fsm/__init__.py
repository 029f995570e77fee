"""Pure state machines: no arrays, no input or output, no clock."""

from naoimitate.fsm.fall_latch import FallLatch
from naoimitate.fsm.session import Action, Event, SessionFsm, State
from naoimitate.fsm.support import Mode, SupportFsm, SupportInput, next_mode, offset_target, wanted_stance

__all__ = [
    "Action",
    "Event",
    "FallLatch",
    "Mode",
    "SessionFsm",
    "State",
    "SupportFsm",
    "SupportInput",
    "next_mode",
    "offset_target",
    "wanted_stance",
]

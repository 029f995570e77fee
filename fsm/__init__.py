"""Pure state machines: no arrays, no input or output, no clock."""

from naoimitate.fsm.support import Mode, SupportFsm, SupportInput, next_mode, offset_target, wanted_stance

__all__ = ["Mode", "SupportFsm", "SupportInput", "next_mode", "offset_target", "wanted_stance"]

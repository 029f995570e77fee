"""Live imitation of a person by a small humanoid, statically stable by a stated margin.

The public names load when they are first used, so that ``import naoimitate`` and ``naoimitate --help`` are quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from naoimitate.core.errors import NaoimitateError as NaoimitateError
    from naoimitate.core.frames import HumanFrame as HumanFrame
    from naoimitate.core.frames import Motion as Motion
    from naoimitate.core.frames import RobotCommand as RobotCommand
    from naoimitate.imitator import Imitator as Imitator
    from naoimitate.motion import load_motion as load_motion
    from naoimitate.robot.load import load_robot as load_robot
    from naoimitate.robot.model import RobotModel as RobotModel
    from naoimitate.run.file import Run as Run
    from naoimitate.run.file import load_run as load_run
    from naoimitate.run.file import save as save_run
    from naoimitate.run.recorded import imitate as imitate
    from naoimitate.run.scores import score_run as score_run
    from naoimitate.settings import Settings as Settings

_HOMES = {
    "HumanFrame": "naoimitate.core.frames:HumanFrame",
    "Imitator": "naoimitate.imitator:Imitator",
    "Motion": "naoimitate.core.frames:Motion",
    "NaoimitateError": "naoimitate.core.errors:NaoimitateError",
    "RobotCommand": "naoimitate.core.frames:RobotCommand",
    "RobotModel": "naoimitate.robot.model:RobotModel",
    "Run": "naoimitate.run.file:Run",
    "Settings": "naoimitate.settings:Settings",
    "imitate": "naoimitate.run.recorded:imitate",
    "load_motion": "naoimitate.motion:load_motion",
    "load_robot": "naoimitate.robot.load:load_robot",
    "load_run": "naoimitate.run.file:load_run",
    "save_run": "naoimitate.run.file:save",
    "score_run": "naoimitate.run.scores:score_run",
}
"""Where each public name lives (PEP 562)."""

__all__ = [
    "HumanFrame",
    "Imitator",
    "Motion",
    "NaoimitateError",
    "RobotCommand",
    "RobotModel",
    "Run",
    "Settings",
    "imitate",
    "load_motion",
    "load_robot",
    "load_run",
    "save_run",
    "score_run",
]


def __getattr__(name: str) -> object:
    """Load a public name on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module 'naoimitate' has no attribute {name!r}")
    module, attribute = _HOMES[name].split(":")
    return getattr(import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

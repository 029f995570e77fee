"""What the operator sees."""

from __future__ import annotations

import io
from dataclasses import replace

from rich.console import Console

from naoimitate.command_gate import CommandGate
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.live.loop import Beat, Turn
from naoimitate.live.panel import Panel
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.session import Session
from naoimitate.live.stream import Stream
from naoimitate.motion.builtin import tpose
from naoimitate.robot.model import RobotModel


def test_the_panel_shows_state_countdown_delays_and_refusals(nao: RobotModel) -> None:
    gate = CommandGate(nao)
    session, driver = Session(nao), GuardedDriver(NoDriver(nao), gate)
    driver.connect()
    session.start()
    panel = Panel(session, Stream(PROTOCOLS["json"], ()), driver, gate)
    for k in range(30):
        session.see(replace(tpose(), time=0.01 * k), 0.01 * k)
        panel.take(Beat(Turn(session.step(0.01 * k), 0.01 * k, 0.0, 1e-4, 2e-4, 3e-4), 0.0012, 4e-5, 5e-5))
    out = io.StringIO()
    Console(file=out, width=100).print(panel.table())
    text = out.getvalue()
    words = (
        "calibrating",
        "hold a T-pose for 1.2 s",
        "p50 0.69 ms",
        "gate",
        "mm inside the feet",
        "robot D",
        "live",
        "0 commands refused",
    )
    for word in words:
        assert word in text, text

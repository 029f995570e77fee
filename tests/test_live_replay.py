"""Sessions played again: recordings bit for bit with all that the operator did, and motions as if they came live."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from naoimitate.cli import run as command
from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import CalibrationError, StreamError
from naoimitate.fsm.session import Event
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.live.loop import Beat, Loop, Turn
from naoimitate.live.measure import measure_operator
from naoimitate.live.performance import Performance
from naoimitate.live.playback import Playback
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.receiver import Datagram
from naoimitate.live.recording import Recorder, is_recording, play, read_recording
from naoimitate.live.sender import frames
from naoimitate.live.setup import Setup
from naoimitate.live.stream import Stream
from naoimitate.motion.builtin import builtin_motion
from naoimitate.robot.model import RobotModel
from naoimitate.run.file import load_run

JSON = PROTOCOLS["json"]
ORDERS = {
    6.0: (Event.CLUTCH, ""),
    7.0: (Event.CLUTCH, ""),
    9.0: (Event.BODY, ""),
    11.0: (Event.FAULT, "it fell"),
    12.0: (Event.RESET, ""),
}
"""What the operator and the robot say in the recorded session, by time (s)."""


def datagrams(name: str) -> list[tuple[float, bytes]]:
    made = frames(Performance(builtin_motion(name), 3.0), JSON.encoder(), 50.0)
    return [(moment, datagram) for moment, parts in made for datagram in parts]


def recorded(robot: RobotModel, path: Path, setup: Setup) -> list[Turn]:
    """Record a session of the march, mirrored and slow, in which everything happens; its turns."""
    session, stream = setup.session(robot), Stream(JSON, ())
    session.start()
    recorder = Recorder(path, {"protocol": "json", "robot": robot.name, "setup": setup.header()})
    turns = []
    for k, (moment, datagram) in enumerate(datagrams("march")[: 50 * 15]):
        came = Datagram(100.0 + moment, ("127.0.0.1", 5), datagram)
        recorder.datagram(came)
        stream.take(*came)
        if (order := ORDERS.get(round(moment, 6))) is not None:
            session.tell(*order)
        newest = stream.newest()
        assert newest is not None
        session.see(newest[1].frame, newest[0])
        turns.append(Turn(session.step(came.arrival + 0.001 * (k % 3)), came.arrival + 0.001 * (k % 3)))
        recorder.beat(Beat(turns[-1]))
    recorder.close()
    return turns


def test_a_recording_plays_again_bit_for_bit_with_all_that_was_said(nao: RobotModel, tmp_path: Path) -> None:
    setup = Setup(speed_limit=0.7, mirror=True, shift="parabola")
    before = recorded(nao, tmp_path / "a.rec", setup)
    again = read_recording(tmp_path / "a.rec")
    session = Setup.of(again.header["setup"]).session(nao)
    after = list(play(again, session, Stream(JSON, ())))
    assert session.imitator.settings.offset.shift == "parabola"
    assert [t.tick.state for t in after] == [t.tick.state for t in before]
    assert np.array_equal([t.tick.command.q for t in after], [t.tick.command.q for t in before])
    states = {t.tick.state.value for t in after}
    assert states == {"calibrating", "blending", "tracking", "clutched", "fault"}


def test_the_driver_of_a_replay_follows_the_recording_through_a_reset(nao: RobotModel, tmp_path: Path) -> None:
    before = recorded(nao, tmp_path / "a.rec", Setup())
    session, now = Setup().session(nao), [100.0]

    def told_time(turns: Iterator[Turn]) -> Iterator[Turn]:
        for turn in turns:
            now[0] = turn.now
            yield turn

    driver = GuardedDriver(NoDriver(nao), CommandGate(nao), clock=lambda: now[0])
    driver.connect()
    beats: list[Beat] = []
    turns = told_time(play(read_recording(tmp_path / "a.rec"), session, Stream(JSON, ())))
    Loop(session, driver, [beats.append], live=False).run(turns, hurried=lambda: True)
    assert not driver.status.refused
    assert np.array_equal([b.tick.command.q for b in beats[: len(before)]], [t.tick.command.q for t in before])


def test_a_recording_is_played_as_it_was_set_up_unless_the_operator_says_otherwise(
    nao: RobotModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = recorded(nao, tmp_path / "a.rec", Setup(speed_limit=0.7, mirror=True))
    arguments = ["live", "--source", f"replay:{tmp_path / 'a.rec'}", "--driver", "none", "--duration", "7.5"]
    assert command([*arguments, "--out", str(tmp_path / "a.npz")]) == 0
    run = load_run(tmp_path / "a.npz")
    ticks = [t.tick for t in before]
    first = next(k for k, tick in enumerate(ticks) if tick.began)
    assert run.session is not None
    shared = int(np.argmax(run.session == "stopping"))
    assert shared > 100
    assert np.array_equal(run.q[:shared], [t.command.q for t in ticks[first : first + shared]])
    assert command([*arguments, "--record", str(tmp_path / "b.rec")]) == 2
    assert "already" in capsys.readouterr().err


@pytest.mark.parametrize(
    "header", [None, 3, {"speed_limit": "fast"}, {"speed_limit": 7.0}, {"mirror": 1}, {"shift": "jump"}]
)
def test_a_setup_that_cannot_be_is_refused(header: object) -> None:
    with pytest.raises(StreamError, match="record it anew"):
        Setup.of(header)


@pytest.mark.parametrize("record", [struct.pack("<Bd", 9, 0.0), struct.pack("<BdBH", 2, 0.0, 3, 0) + b"fly"])
def test_a_recording_with_what_nobody_wrote_is_refused(tmp_path: Path, record: bytes) -> None:
    path = tmp_path / "a.rec"
    Recorder(path, {"protocol": "json"}).close()
    path.write_bytes(path.read_bytes() + record)
    assert is_recording(path) and not is_recording(tmp_path / "none.rec")
    with pytest.raises(StreamError, match="damaged"):
        read_recording(path)


def test_a_motion_is_played_as_if_live(tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    arguments = ["live", "--source", "replay:builtin:wave", "--driver", "none", "--duration", "6.5", "--out", str(out)]
    assert command(arguments) == 0
    run = load_run(out)
    assert run.session is not None and set(run.session) == {"blending", "tracking", "stopping", "stopped"}
    assert run.source == "replay:builtin:wave"


def test_datagrams_of_a_playback_come_when_they_are_due() -> None:
    playback = Playback(iter([(0.0, b"a"), (0.05, b"b"), (0.05, b"c")]))
    assert playback.wait(1.0)
    assert [d.payload for d in playback.read()] == [b"a"]
    assert not playback.wait(0.01) and playback.read() == []
    assert playback.wait(1.0)
    assert [d.payload for d in playback.read()] == [b"b", b"c"]
    assert playback.ended


def test_an_operator_is_measured_from_a_stream() -> None:
    words: list[float] = []
    subject = measure_operator(Stream(JSON, ()), Playback(iter(datagrams("wave"))), words.append, 20.0)
    motion = builtin_motion("wave")
    assert motion.tpose is not None
    assert subject.body.stature == pytest.approx(1.75, abs=0.01)
    assert min(words) < 0.3 < max(words)


def test_nobody_is_measured_who_holds_no_t_pose() -> None:
    late = ((0.0, datagram) for moment, datagram in datagrams("wave") if moment > 5.0)
    with pytest.raises(CalibrationError, match="nobody held"):
        measure_operator(Stream(JSON, ()), Playback(late), lambda left: None, 5.0)
    with pytest.raises(CalibrationError, match="no packet"):
        measure_operator(Stream(JSON, ()), Playback(iter(())), lambda left: None, 0.2)


def test_a_t_pose_that_moves_is_not_taken() -> None:
    pose = builtin_motion("wave").tpose
    assert pose is not None
    encoder = JSON.encoder()
    made = []
    for k in range(150):
        moved = replace(pose, time=0.02 * k, landmarks=pose.landmarks + np.array([0.02 * k, 0.0, 0.0]))
        made += [(0.0, datagram) for datagram in encoder.encode(moved, k, 0.02 * k)]
    with pytest.raises(CalibrationError):
        measure_operator(Stream(JSON, ()), Playback(iter(made)), lambda left: None, 5.0)

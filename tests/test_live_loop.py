"""The live loop with real datagrams: every state by packets alone, recordings, journals, killed programs."""

from __future__ import annotations

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from naoimitate.cli import run as command
from naoimitate.command_gate import CommandGate
from naoimitate.core.errors import RunFileError, StreamError
from naoimitate.hw.condition import Condition
from naoimitate.hw.driver import Driver
from naoimitate.hw.guarded import GuardedDriver
from naoimitate.hw.none import NoDriver
from naoimitate.live.loop import Beat, Loop, Turn, listen
from naoimitate.live.protocols.registry import PROTOCOLS
from naoimitate.live.receiver import Receiver
from naoimitate.live.recording import Recorder, Step, play, read_recording
from naoimitate.live.session import Session, SessionSettings
from naoimitate.live.stream import Stream
from naoimitate.motion.builtin import tpose
from naoimitate.robot.model import RobotModel
from naoimitate.run.columns import constants
from naoimitate.run.file import load_run
from naoimitate.run.journal import Journal, Moved, Row, finish, journal_path

QUICK = SessionSettings(predict=0.05, hold=0.15, back=0.5, blend_in=0.2, blend_back=0.2)
JSON = PROTOCOLS["json"]


@dataclass
class Sender:
    """Sends the T-pose 100 times a second, whenever it is told to."""

    port: int

    def __post_init__(self) -> None:
        self.encoder, self.count = JSON.encoder(), 0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            frame = replace(tpose(), time=self.count * 0.01)
            for datagram in self.encoder.encode(frame, self.count, frame.time):
                self.socket.sendto(datagram, ("127.0.0.1", self.port))
            self.count += 1
            time.sleep(0.01)


@dataclass
class Rig:
    """A session that listens on a port of its own, with a driver that moves nothing."""

    nao: RobotModel

    def __post_init__(self) -> None:
        self.session, self.receiver = Session(self.nao, live=QUICK), Receiver("127.0.0.1", 0)
        self.session.warm_up()
        self.beats: list[Beat] = []
        self.stream = Stream(JSON, tuple(PROTOCOLS.values()))
        self.connect(NoDriver(self.nao))

    def connect(self, driver: Driver) -> None:
        self.driver = GuardedDriver(driver, CommandGate(self.nao))
        self.driver.connect()

    def run(self, duration: float, ended: Callable[[], bool] = lambda: False, recorder: Recorder | None = None) -> None:
        loop = Loop(self.session, self.driver, [self.beats.append])
        if recorder is not None:
            loop.watch.append(recorder.beat)
        record = recorder.datagram if recorder is not None else lambda datagram: None
        loop.run(listen(self.session, self.stream, self.receiver, self.driver.period, record), duration, ended)
        self.receiver.close()


def test_packets_alone_drive_the_session_and_a_recording_gives_the_same_joints(nao: RobotModel, tmp_path: Path) -> None:
    rig = Rig(nao)
    recorder = Recorder(tmp_path / "stream.rec", {"protocol": "json"})
    sender, done = Sender(rig.receiver.port), threading.Event()

    def story() -> None:
        time.sleep(0.3)
        for seconds, pause in ((0.2, 0.3), (2.2, 0.3), (0.6, 0.9), (0.8, 0.0)):
            sender.send(seconds)
            time.sleep(pause)
        done.set()

    thread = threading.Thread(target=story)
    thread.start()
    rig.run(30.0, done.is_set, recorder)
    thread.join()
    recorder.close()
    beats = rig.beats
    states = [beat.tick.state.value for beat in beats]
    order = [s for k, s in enumerate(states) if k == 0 or states[k - 1] != s]
    assert order[0] == "waiting" and order[-3] in ("blending", "tracking")
    wanted = ["waiting", "calibrating", "waiting", "calibrating", "blending", "tracking", "holding", "blending"]
    assert order[: len(wanted)] == wanted
    assert "returning" in order
    again = Session(nao, live=QUICK)
    again.warm_up()
    repeated = list(play(read_recording(tmp_path / "stream.rec"), again, Stream(JSON, ())))
    assert len(repeated) == len(beats)
    for turn, beat in zip(repeated, beats, strict=True):
        assert np.array_equal(turn.tick.command.q, beat.tick.command.q)
        assert turn.tick.state is beat.tick.state


def test_another_protocol_than_asked_for_is_named(nao: RobotModel) -> None:
    rig = Rig(nao)
    encoder, out = PROTOCOLS["xsens"].encoder(), socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for k in range(5):
        for datagram in encoder.encode(tpose(), k, 0.01 * k):
            out.sendto(datagram, ("127.0.0.1", rig.receiver.port))
    rig.run(0.2)
    assert "this looks like" in rig.stream.complaint()


def test_a_port_in_use_is_one_clear_error() -> None:
    first = Receiver("127.0.0.1", 0)
    with pytest.raises(StreamError, match="in use"):
        Receiver("127.0.0.1", first.port)
    first.close()


@pytest.mark.parametrize("bind", ["192.0.2.1", "no such host"])
def test_an_address_of_another_machine_is_one_clear_error(bind: str) -> None:
    with pytest.raises(StreamError, match="--bind"):
        Receiver(bind, 0)


def journal(nao: RobotModel, out: Path, frames: int, simulated: bool = False) -> Journal:
    session = Session(nao)
    session.start()
    fixed = constants(nao, session.imitator.mapping, "planted", "live:json", "{}")
    written = Journal(out, fixed)
    for k in range(frames):
        tick = session.step(0.01 * k)
        c, forces = tick.command, np.full((2, 4), 6.0)
        moved = Moved(c.q, c.base_pos, c.base_quat, forces, k == 7) if simulated else None
        written.add(Row(tick.command, tick.arrival, tick.state.value, np.nan, 1e-3, moved))
    return written


def test_a_journal_becomes_a_run_file(nao: RobotModel, tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    made = journal(nao, out, 130).close()
    assert made is not None and len(made) == len(load_run(out)) == 130
    assert made.session is not None and set(made.session) == {"waiting"}
    assert not journal_path(out).exists()


def test_a_journal_keeps_how_the_simulated_robot_moved(nao: RobotModel, tmp_path: Path) -> None:
    run = journal(nao, tmp_path / "run.npz", 130, simulated=True).close()
    assert run is not None and run.sim_fell is True
    assert np.array_equal(run.sim_q, run.q)
    assert run.sim_fsr is not None and run.sim_fsr.shape == (130, 2, 4)


def test_a_killed_session_loses_half_a_second_at_most(nao: RobotModel, tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    journal(nao, out, 230)
    whole = journal_path(out).read_bytes()
    journal_path(out).write_bytes(whole[:-1000])
    assert command(["recover", str(out)]) == 0
    assert 230 - 2 * 51 <= len(load_run(out)) < 230


def test_a_session_that_is_killed_keeps_all_but_its_last_second(tmp_path: Path) -> None:
    arguments = ["--source", "replay:builtin:wave", "--driver", "none", "--out", "run.npz", "--record", "stream.rec"]
    program = [sys.executable, "-m", "naoimitate.cli", "live", *arguments]
    with subprocess.Popen(program, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as live:
        assert live.stdout is not None and live.stderr is not None
        for line in live.stderr:
            if line.startswith("tracking"):
                break
        tracking = time.monotonic()
        time.sleep(3.0)
        live.kill()
        lasted = time.monotonic() - tracking
    out = tmp_path / "run.npz"
    assert command(["recover", str(out)]) == 0
    run = load_run(out)
    assert run.session is not None
    followed = run.time[[state == "tracking" for state in run.session]]
    assert followed[-1] - followed[0] >= lasted - 1.0
    steps = [event for event in read_recording(tmp_path / "stream.rec").events if isinstance(event, Step)]
    assert len(steps) >= len(run)


def test_a_run_that_was_cut_off_is_not_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run.npz"
    journal_path(out).write_bytes(b"what a killed program left")
    assert command(["live", "--source", "replay:builtin:wave", "--driver", "none", "--out", str(out)]) == 2
    assert f"recover {out}" in capsys.readouterr().err
    assert journal_path(out).read_bytes() == b"what a killed program left"


def test_a_watcher_that_fails_is_told_of_and_the_robot_goes_on(nao: RobotModel) -> None:
    rig, said = Rig(nao), list[str]()

    def full_disk(beat: Beat) -> None:
        raise OSError("No space left on device")

    loop = Loop(rig.session, rig.driver, [full_disk, rig.beats.append], said.append)
    loop.run(listen(rig.session, rig.stream, rig.receiver, 0.01), duration=0.3)
    rig.receiver.close()
    assert said == ["No space left on device"]
    assert len(rig.beats) > 10 and rig.beats[-1].tick.state.value == "stopped"


@pytest.mark.parametrize("content", [b"", b"junk", b"\xff" * 100])
def test_what_is_no_journal_is_refused(tmp_path: Path, content: bytes) -> None:
    out = tmp_path / "run.npz"
    journal_path(out).write_bytes(content)
    with pytest.raises(RunFileError, match="no journal"):
        finish(out)


def test_a_torn_recording_plays_to_its_tear_and_other_files_are_refused(nao: RobotModel, tmp_path: Path) -> None:
    path = tmp_path / "a.rec"
    recorder = Recorder(path, {"protocol": "json"})
    session = Session(nao)
    session.start()
    for k in range(100):
        recorder.beat(Beat(Turn(session.step(0.01 * k), 0.01 * k)))
    recorder.close()
    path.write_bytes(path.read_bytes()[:-4])
    assert len(read_recording(path).events) == 99
    path.write_bytes(b"x" * 50)
    with pytest.raises(StreamError, match="no recording"):
        read_recording(path)


def test_the_command_says_when_it_is_ready_and_ends_in_peace(tmp_path: Path) -> None:
    arguments = ["live", "--source", "json", "--port", "0", "--driver", "none", "--duration", "0.5"]
    program = [sys.executable, "-m", "naoimitate.cli", *arguments]
    result = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0, result.stderr
    assert "ready" in result.stdout


@pytest.mark.parametrize(
    "arguments, word",
    [
        (["--source", "nonsense", "--driver", "none"], "there are xsens"),
        (["--source", "replay:missing.rec", "--driver", "none"], "cannot be read"),
        (["--source", "json", "--driver", "none", "--bind", "192.0.2.7"], "--bind"),
    ],
)
def test_mistakes_are_one_line(arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command(["live", *arguments]) == 2
    error = capsys.readouterr().err
    assert word in error and error.count("\n") == 1


def test_a_robot_that_refuses_everything_ends_in_a_fault_that_moves_nothing(
    nao: RobotModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(nao)
    elsewhere = nao.postures["stand"].copy()
    elsewhere[nao.joint("LShoulderPitch")] -= 1.0
    state = rig.driver.read()
    rig.driver.stop()
    driver = NoDriver(nao)
    monkeypatch.setattr(driver, "read", lambda: replace(state, q=elsewhere))
    rig.connect(driver)
    rig.run(1.6)
    assert rig.beats[-1].tick.state.value == "fault"
    assert len({beat.tick.command.q.tobytes() for beat in rig.beats if beat.tick.state.value == "fault"}) == 1
    assert "refused" in rig.session.reason
    assert rig.driver.status.condition is Condition.LIVE, "it keeps its pose, stiff"
    assert rig.driver.status.accepted == 0

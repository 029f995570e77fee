"""Look at a running simulation: a window, and a film. The pictures are made in processes of their own at low priority;
they take the newest positions from shared memory, and the simulation neither waits for them nor minds how they end.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

import mujoco

from naoimitate.core.errors import RobotModelError
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.onlookers import FREE, Onlooker, film, window
from naoimitate.sim.positions import Positions

PUMP_PERIOD = 0.02
"""s between two copies of the newest positions."""

OPENING_TIME = 30.0
"""s that an onlooker may take until it shows something; on an idle machine it takes one or two."""

CLOSING_TIME = 15.0
"""s that an onlooker may take to end its film."""


@dataclass(frozen=True)
class _Running:
    """An onlooker at work: what people call it, its process, and the line to it."""

    name: str
    process: BaseProcess
    line: Connection


class Watch:
    """Onlookers of a simulated robot, from ``open`` to ``close``; a context manager.

    view: open a window, through ``camera`` (``free``: the mouse moves it). video: write an mp4 file, as
    ``video_camera`` sees it (default: the robot's own first camera). notice: told in one line, from any thread, what
    does not work and what has ended: no such thing ends the session. RobotModelError for a camera that is not there.
    """

    def __init__(
        self,
        driver: MujocoDriver,
        *,
        view: bool = False,
        camera: str = FREE,
        video: Path | None = None,
        video_camera: str | None = None,
        notice: Callable[[str], None],
    ) -> None:
        cameras = camera_names(driver.model)
        filmed = cameras[:2][-1] if video_camera is None else video_camera
        for name in (camera, filmed):
            if name not in cameras:
                raise RobotModelError(f"there is no camera {name!r}: choose one of {', '.join(cameras)}")
        self._driver, self._notice = driver, notice
        self._positions = Positions(driver.model.nq)
        self._jobs: list[tuple[str, Onlooker, tuple[str, ...]]] = []
        if view:
            self._jobs.append(("the window", window, (camera,)))
        if video is not None:
            self._jobs.append(("the video", film, (filmed, str(video))))
        self._running: list[_Running] = []
        self._halt = threading.Event()
        self._pump: threading.Thread | None = None

    def __enter__(self) -> Watch:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def open(self) -> None:
        """Start the onlookers, and wait until they show something or have said why they cannot; the film begins."""
        self._positions.write(*self._driver.snapshot)
        self._running = [self._start(*job) for job in self._jobs]
        deadline = time.monotonic() + OPENING_TIME
        self._running = [onlooker for onlooker in self._running if self._ready(onlooker, deadline)]
        if self._running:
            self._halt.clear()
            self._pump = threading.Thread(target=self._run, name="watch", daemon=True)
            self._pump.start()

    def close(self) -> None:
        """End the film properly and close the window; may be repeated."""
        self._halt.set()
        if self._pump is not None:
            self._pump.join()
            self._pump = None
        for onlooker in self._running:
            _tell_to_end(onlooker)
        for onlooker in self._running:
            self._end(onlooker, CLOSING_TIME)
        self._running = []

    def _start(self, name: str, job: Onlooker, options: tuple[str, ...]) -> _Running:
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        arguments = (self._driver.model, self._positions, theirs, *options)
        process = context.Process(target=job, args=arguments, name=name, daemon=True)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])  # the process inherits it
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()  # so that either side sees it when the other one is no more
        return _Running(name, process, ours)

    def _ready(self, onlooker: _Running, deadline: float) -> bool:
        """Whether an onlooker shows something; else it is ended, and the user is told."""
        with contextlib.suppress(EOFError):  # it has crashed: ``_end`` tells of it
            if onlooker.line.poll(max(0.0, deadline - time.monotonic())):
                trouble = onlooker.line.recv()
                if trouble is None:
                    return True
                self._notice(trouble)
        self._end(onlooker, CLOSING_TIME)
        return False

    def _run(self) -> None:
        """Copy the newest positions, and hear what the onlookers say."""
        while not self._halt.wait(PUMP_PERIOD):
            self._positions.write(*self._driver.snapshot)
            for onlooker in [one for one in self._running if one.line.poll()]:
                if not self._hear(onlooker):
                    self._running.remove(onlooker)
                    self._end(onlooker, CLOSING_TIME)

    def _hear(self, onlooker: _Running) -> bool:
        """Pass on what an onlooker says; False when it has ended."""
        try:
            while onlooker.line.poll():
                said = onlooker.line.recv()
                if said is not None:
                    self._notice(said)
        except (EOFError, OSError):
            return False
        return True

    def _end(self, onlooker: _Running, patience: float) -> None:
        """Wait for the end of an onlooker, s; one that does not end is ended."""
        deadline = time.monotonic() + patience
        while self._hear(onlooker) and time.monotonic() < deadline:
            onlooker.line.poll(max(0.0, deadline - time.monotonic()))
        onlooker.process.join(max(0.0, deadline - time.monotonic()))
        if onlooker.process.is_alive():
            onlooker.process.kill()
            self._notice(f"{onlooker.name} does not answer and was ended; all else goes on")
        elif onlooker.process.exitcode:
            self._notice(f"{onlooker.name} failed (exit code {onlooker.process.exitcode}); all else goes on")
        onlooker.line.close()


def camera_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the cameras of a simulated world; the free one is the first, the robot's own follow."""
    return (FREE, *filter(None, (model.camera(index).name for index in range(model.ncam))))


def _tell_to_end(onlooker: _Running) -> None:
    with contextlib.suppress(OSError):  # where it has ended by itself
        onlooker.line.send(None)

"""A recorded motion, imitated from its first to its last frame: the run."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from naoimitate.calib.subject import Subject, calibrate
from naoimitate.core.errors import MotionFormatError
from naoimitate.core.frames import Motion, RobotCommand
from naoimitate.human.support import annotate
from naoimitate.imitator import Imitator
from naoimitate.motion.stretch import FRAMEWISE, stretch
from naoimitate.robot.model import RobotModel
from naoimitate.run.columns import columns, constants
from naoimitate.run.file import Run
from naoimitate.run.pace import AutoPace, ConstantPace
from naoimitate.run.provenance import provenance
from naoimitate.settings import Settings

LONGEST = 40.0
"""A run is ended after this many times the length of the clip, plus a minute: nothing waits for ever."""

WARM_UP = 100
"""Steps in which a robot that can lift a foot has lifted it, or set it down."""


def imitate(
    motion: Motion,
    robot: RobotModel,
    settings: Settings | None = None,
    *,
    speed: float | str = 1.0,
    rate: float = 100.0,
    sample: float | None = None,
    start: float | None = None,
    end: float | None = None,
    subject: Subject | None = None,
    subject_sha256: str | None = None,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Imitate a recorded motion.

    speed: factor, or ``auto``: slowed where the robot needs the time. rate: Hz of the robot's commands. sample: Hz at
    which the person is seen, None for the file's own. start, end: s in the file's time. subject: who was measured
    before; else the motion's T-pose is used. progress: called with the share of the clip that is done. A motion whose
    support is not known is annotated first.
    Raises MotionFormatError for a motion without a T-pose or an empty stretch, CalibrationError for an unusable T-pose.
    """
    settings = settings or Settings()
    motion = annotate(stretch(motion, start, end))
    seen = motion if sample is None else resample(motion, sample)
    if subject is None:
        if motion.tpose is None:
            raise MotionFormatError(f"{motion.name} has no T-pose: give --subject, or --tpose-at with its time")
        subject = calibrate(motion.tpose)
    imitator = Imitator(robot, settings)
    imitator.use(subject)
    _warm_up(imitator, seen)
    imitator.use(subject)
    law = (
        AutoPace(seen, float(seen.time[0]), settings.offset)
        if speed == "auto"
        else ConstantPace(seen, float(seen.time[0]), float(speed))
    )
    commands, moments, step_times = _play(imitator, law, seen, 1.0 / rate, progress)
    text = provenance(
        settings,
        source_sha256=motion.sha256,
        subject_sha256=subject_sha256,
        seed=seed,
        notes=motion.notes,
        speed=speed,
        rate=rate,
        sample=sample,
        start=start,
        end=end,
    )
    return _run(robot, settings, motion, imitator, text, commands, np.array(moments), np.array(step_times))


def _warm_up(imitator: Imitator, motion: Motion) -> None:
    """One step on the spot in the first posture: compiling or loading the kernel is no part of the run's own steps."""
    first = motion.at(float(motion.time[0]))
    for support in ("L", "D"):
        for _ in range(WARM_UP):
            imitator.step(first, imitator.settings.limits.max_dt, support=support)
            if imitator.mode.stance == support:
                break


def resample(motion: Motion, rate: float) -> Motion:
    """The motion as a camera of ``rate`` Hz sees it, and its last frame."""
    times = np.append(np.arange(motion.time[0], motion.duration - 1e-6, 1.0 / rate), motion.duration)
    frames = [motion.at(float(t)) for t in times]

    def stack(name: str) -> np.ndarray | None:
        values = [getattr(f, name) for f in frames]
        return None if values[0] is None else np.array(values)

    changed: dict[str, Any] = {name: stack(name) for name in FRAMEWISE}
    return replace(motion, time=times, **changed)


def _play(
    imitator: Imitator,
    law: AutoPace | ConstantPace,
    motion: Motion,
    dt: float,
    progress: Callable[[float], None] | None,
) -> tuple[list[RobotCommand], list[float], list[float]]:
    first, last = float(motion.time[0]), motion.duration
    commands = [imitator.step(motion.at(first), dt)]
    moments, step_times = [first], [0.0]
    longest = 60.0 + LONGEST * (last - first)
    while law.time < last - 1e-9 and commands[-1].time < longest:
        moment = law.next(dt, imitator.mode, imitator.offset, imitator.lag, imitator.settled)
        if moment.time > last + 1e-9:
            break
        begin = clock.perf_counter()
        commands.append(imitator.step(motion.at(moment.time), dt, support=moment.support, ahead=moment.ahead))
        step_times.append(clock.perf_counter() - begin)
        moments.append(moment.time)
        if progress is not None:
            progress((moments[-1] - first) / (last - first))
    return commands, moments, step_times


def _run(
    robot: RobotModel,
    settings: Settings,
    motion: Motion,
    imitator: Imitator,
    text: str,
    commands: list[RobotCommand],
    moments: np.ndarray,
    step_times: np.ndarray,
) -> Run:
    arrays = columns(commands)
    arrays["human_support"] = np.array([motion.at(float(t)).support or "D" for t in moments])
    fixed = constants(robot, imitator.mapping, settings.retarget, motion.source or motion.name, text)
    return Run(**fixed, **arrays, human_time=moments, step_time=step_times)

"""The evaluation of Koenemann, Burget, Bennewitz 2014, once more: Figures 7, 8, 9 and Table I, and the direct baseline.

The paper repeats its complex single-support sequence ten times and times a sequence of 1000 frames of stepping and
reaching. Ours are the built-in motions ``paper`` and ``step-and-reach``, seen at 30 frames a second by a suit with
sensor noise, with the paper's parameters and with ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from naoimitate.core.frames import Array, Motion
from naoimitate.core.geometry import convex_hull, polygon_margin
from naoimitate.robot.model import RobotModel
from naoimitate.run.contact import sole_tilt
from naoimitate.run.file import Run
from naoimitate.run.recorded import imitate
from naoimitate.run.replay import Replay, frames
from naoimitate.run.similarity import FEET, HANDS, errors, hand_excess
from naoimitate.run.stability import margins_at_frames
from naoimitate.settings import PAPER, Settings

MOTIONS = ("paper", "step-and-reach")
REPETITIONS = 10
CAMERA_RATE = 30.0
"""Frames a second at which the person is seen, Hz (the paper's section VI-C)."""
NOISE = 0.002
"""Standard deviation of the white noise on every landmark's coordinates, m: the paper gives no figure; harsher than a
suit's, whose filter smooths it."""
TOUCHING = 0.002
"""Height above a sole's lowest point up to which its points count as touching the floor, m: what a sole gives."""
PARAMETER_SETS = {"theirs": PAPER, "ours": Settings()}
"""The paper's parameters, and our defaults."""
PAPER_ERRORS_CM = {"hands": 1.4, "feet": 1.6}
"""Mean errors over ten repetitions of the complex sequence (the paper's section VI-A), cm."""

Progress = Callable[[float], None]
Simulate = Callable[[Run], Run]


@dataclass(frozen=True)
class Case:
    """One motion with one set of parameters: the runs of all repetitions and what they show.

    hand_errors, foot_errors: (repetitions,) mean of a run, cm. hand_excess: the same of the hands beyond what the arms
    could have reached. least_margin: mm over all runs. fell: of each simulated run; empty without simulation.
    """

    motion: str
    parameters: str
    runs: tuple[Run, ...]
    hand_errors: Array
    hand_excess: Array
    foot_errors: Array
    least_margin: float
    fell: tuple[bool, ...]


@dataclass(frozen=True)
class Baseline:
    """The direct imitation without stabilisation. outside: share of frames in which the centre of mass is not over what
    touches the floor. tilt: deg, of the soles that should stand, largest. fell: in simulation, None without one."""

    motion: str
    run: Run
    outside: float
    tilt: float
    fell: bool | None


def noisy(motion: Motion, seed: int) -> Motion:
    """The motion as a noisy suit sees it: white noise of ``NOISE`` on every coordinate of every landmark."""
    noise = np.random.default_rng(seed).normal(scale=NOISE, size=motion.landmarks.shape)
    return replace(motion, landmarks=motion.landmarks + noise)


def repeat(
    motion: Motion, robot: RobotModel, parameters: str, repetitions: int, simulate: Simulate | None, progress: Progress
) -> Case:
    """All repetitions of one motion with one set of parameters; seeds 0, 1, 2..."""
    runs = []
    for seed in range(repetitions):
        run = imitate(noisy(motion, seed), robot, PARAMETER_SETS[parameters], sample=CAMERA_RATE, seed=seed)
        runs.append(run if simulate is None else simulate(run))
        progress((seed + 1) / repetitions)
    poses = [frames(run, robot) for run in runs]
    error = [100.0 * errors(run, pose) for run, pose in zip(runs, poses, strict=True)]
    return Case(
        motion=motion.name,
        parameters=parameters,
        runs=tuple(runs),
        hand_errors=np.array([e[:, HANDS].mean() for e in error]),
        hand_excess=np.array([100.0 * (hand_excess(r, robot, p) or 0.0) for r, p in zip(runs, poses, strict=True)]),
        foot_errors=np.array([e[:, FEET].mean() for e in error]),
        least_margin=1000.0 * min(float(margins_at_frames(r, p).min()) for r, p in zip(runs, poses, strict=True)),
        fell=tuple(bool(run.sim_fell) for run in runs if run.sim_fell is not None),
    )


def direct_baseline(motion: Motion, robot: RobotModel, simulate: Simulate | None) -> Baseline:
    """The motion imitated without stabilisation, with the paper's parameters, and played in physics."""
    run = imitate(noisy(motion, 0), robot, replace(PAPER, retarget="direct"), sample=CAMERA_RATE)
    poses = frames(run, robot)
    tilt = float(np.degrees(sole_tilt(run, poses)))
    run = run if simulate is None else simulate(run)
    return Baseline(motion.name, run, unsupported(poses), tilt, run.sim_fell)


def unsupported(poses: Replay) -> float:
    """Share of poses whose centre of mass is not over the convex hull of the sole points that touch the floor."""
    points = np.concatenate(poses.soles, axis=1)
    touching = points[:, :, 2] < points[:, :, 2].min(axis=1, keepdims=True) + TOUCHING
    outside = 0
    for outline, down, com in zip(points[:, :, :2], touching, poses.com, strict=True):
        outside += down.sum() < 3 or polygon_margin(convex_hull(outline[down]), com[0], com[1]) < 0.0
    return outside / len(points)

"""The score sheet of a run: every measure of docs/scores.md, from the run file and the robot's model alone."""

from __future__ import annotations

from naoimitate.robot.model import RobotModel
from naoimitate.run.contact import contact
from naoimitate.run.file import Run
from naoimitate.run.limits import limits
from naoimitate.run.measure import Measure
from naoimitate.run.overlap import overlap
from naoimitate.run.pressure import pressure
from naoimitate.run.replay import frames, midpoints, moved
from naoimitate.run.similarity import similarity
from naoimitate.run.stability import stability
from naoimitate.run.support import support
from naoimitate.run.survival import survival
from naoimitate.run.zmp import zmp


def score_run(run: Run, robot: RobotModel) -> list[Measure]:
    """All measures of a run, in the order of the sheet.

    robot: the model that the run names. Raises RunFileError when the run's joints are not that robot's.
    """
    at, between, simulated = frames(run, robot), midpoints(run, robot), moved(run, robot)
    return [
        *stability(run, at, between),
        *zmp(run, robot, at, simulated),
        *pressure(run, robot, simulated),
        *contact(run, robot, at),
        *limits(run, robot),
        *overlap(robot, at),
        *similarity(run, robot, at),
        *support(run),
        *survival(run),
    ]

"""A recorded motion to a run file, its scores and a report: python imitate_a_clip.py [MOTION]."""

from __future__ import annotations

import sys

from naoimitate import imitate, load_motion, load_robot, save_run, score_run
from naoimitate.run.report import write_report
from naoimitate.run.sheet import as_lines


def main(source: str = "builtin:side-kick") -> None:
    """Imitate a motion, slowed where the robot needs the time."""
    robot, motion = load_robot("nao"), load_motion(source)
    run = imitate(motion, robot, speed="auto")
    save_run(run, "run.npz")
    sheet = score_run(run, robot)
    print("\n".join(as_lines(sheet)))
    write_report(run, robot, "run.html", sheet=sheet)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Wall time of one step on built-in motions: mean, median, 99th percentile and largest, ms.

Run it on a quiet machine, pinned to one core: ``taskset -c 0 python benchmarks/step_time.py``.
"""

from __future__ import annotations

import numpy as np

from naoimitate import load_robot
from naoimitate.motion.builtin import builtin_motion, builtin_names
from naoimitate.run.recorded import imitate

REPEATS = 3


def main() -> None:
    """Time the steps of the motions that the command line names, or of the built-in ones."""
    robot = load_robot("nao")
    print(f"{'motion':16}{'mean':>8}{'median':>8}{'p99':>8}{'max':>8}")
    for name in builtin_names():
        motion = builtin_motion(name)
        runs = [imitate(motion, robot).step_time[1:] * 1e3 for _ in range(REPEATS)]
        best = min(runs, key=np.mean)
        figures = best.mean(), np.median(best), np.percentile(best, 99), best.max()
        print(f"{name:16}" + "".join(f"{value:8.3f}" for value in figures))


if __name__ == "__main__":
    main()

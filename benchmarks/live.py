"""Motions streamed over loopback into a live session in real time: delays, refusals, and the bars that a run misses.

python benchmarks/live.py [--driver mujoco|can|none] [--protocols xsens,vmc,...] [--rates 60,240] [--all] [MOTION...]

Each motion takes the next protocol and the next rate in turn; with --all every pair of them. Without motions the
built-in ones. For the CAN bus simulated motors are started beside it. Ends with 1 when a bar was missed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import numpy as np

from naoimitate.motion.builtin import builtin_names
from naoimitate.run.file import load_run

PROGRAM = [sys.executable, "-m", "naoimitate.cli"]
PORT = 9921
TPOSE = 3.0
"""s of T-pose first."""
CAN = ["--can-interface", "udp_multicast", "--can-channel", "239.74.163.2"]


@contextmanager
def started(arguments: list[str]) -> Iterator[subprocess.Popen[str]]:
    """A command that has said that it is ready, and is ended afterwards."""
    program = subprocess.Popen([*PROGRAM, *arguments], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert program.stdout is not None
    while "ready" not in (line := program.stdout.readline()):
        if not line:
            raise SystemExit(f"{arguments[0]} ended with {program.wait()}")
    try:
        yield program
    finally:
        program.terminate()
        program.wait()


def session(motion: str, protocol: str, rate: str, driver: str, folder: Path) -> str:
    """Stream one motion into one session; a line of what came of it."""
    out = folder / "run.npz"
    out.unlink(missing_ok=True)
    live = ["live", "--source", protocol, "--port", str(PORT), "--driver", driver]
    stream = ["stream", motion, "--protocol", protocol, "--to", f"127.0.0.1:{PORT}", "--rate", rate]
    with started([*live, "--out", str(out), *(CAN if driver == "can" else [])]) as program:
        subprocess.run([*PROGRAM, *stream, "--tpose", str(TPOSE)], stdout=subprocess.DEVNULL, check=True)
        program.terminate()
        assert program.stdout is not None
        said = program.stdout.read().splitlines()
    run = load_run(out)
    assert run.latency is not None and run.session is not None
    delays = 1e3 * run.latency[np.isfinite(run.latency)]
    p50, p99 = np.percentile(delays, [50, 99]) if len(delays) else (np.nan, np.nan)
    scores = subprocess.run([*PROGRAM, "score", str(out), "--json"], capture_output=True, text=True, check=True)
    sheet = json.loads(scores.stdout)
    followed = np.mean([state == "tracking" for state in run.session])
    missed = ", ".join(f"{key} {sheet[key]}" for key in sheet["missed"]) or "no bar missed"
    return (
        f"{Path(motion).stem:<22} {protocol:<7} {rate:>4} Hz  p50 {p50:5.2f}  p99 {p99:6.2f} ms  "
        f"tracking {followed:4.0%}  margin {sheet['margin_min_mm']:5.1f} mm  {said[-1]}; {missed}"
    )


def main() -> None:
    """Stream every motion that the command line names; exits with 1 when a bar was missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("motions", nargs="*", default=[f"builtin:{name}" for name in builtin_names()])
    parser.add_argument("--driver", default="mujoco")
    parser.add_argument("--protocols", default="xsens,vmc,rokoko,json")
    parser.add_argument("--rates", default="60,120,240")
    parser.add_argument("--all", action="store_true")
    chosen = parser.parse_args()
    pairs = list(itertools.product(chosen.protocols.split(","), chosen.rates.split(",")))
    turns = itertools.cycle(pairs[k * 5 % len(pairs)] for k in range(len(pairs)))
    missed = False
    stub = (
        started(["can-stub", "--interface", CAN[1], "--channel", CAN[3]]) if chosen.driver == "can" else nullcontext()
    )
    with stub, tempfile.TemporaryDirectory() as folder:
        for motion in chosen.motions:
            for protocol, rate in pairs if chosen.all else [next(turns)]:
                line = session(motion, protocol, rate, chosen.driver, Path(folder))
                missed |= "no bar missed" not in line
                print(line, flush=True)
    sys.exit(missed)


if __name__ == "__main__":
    main()

"""A long live session over loopback: delays, memory and commands over time.

python benchmarks/soak.py [MINUTES] [RATE] [PROTOCOL] [DRIVER]      # 30 minutes of xsens at 240 Hz into MuJoCo
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from naoimitate.run.file import load_run

PORT = 9911


def memory(process: subprocess.Popen[str]) -> int:
    """Resident memory of a process, kB."""
    found = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{process.pid}/status").read_text())
    return int(found[1]) if found else 0


def main(arguments: list[str]) -> None:
    """Run a session as long and as fast as the command line says, and print memory and delays."""
    minutes, rate, protocol, driver = (*arguments, *("30", "240", "xsens", "mujoco")[len(arguments) :])
    seconds, out = 60.0 * float(minutes), Path("soak.npz")
    program = [str(Path(sys.executable).with_name("naoimitate"))]
    live = subprocess.Popen(
        [*program, "live", "--source", protocol, "--port", str(PORT), "--driver", driver, "--duration", str(seconds),
         "--out", str(out)],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert live.stdout is not None
    print(live.stdout.readline(), end="")
    sender = subprocess.Popen(
        [*program, "stream", "builtin:march", "--protocol", protocol, "--to", f"127.0.0.1:{PORT}", "--rate", rate,
         "--tpose", "4", "--repeat", "1000"],
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    begin, sizes = time.monotonic(), []
    while live.poll() is None:
        time.sleep(min(10.0, seconds / 20.0))
        if live.poll() is None:
            sizes.append(memory(live))
            print(f"{time.monotonic() - begin:7.0f} s  {sizes[-1] / 1024.0:7.1f} MB", flush=True)
    sender.terminate()
    print(live.stdout.read(), end="")
    run = load_run(out)
    assert run.latency is not None
    for name, part in zip(("first", "last"), np.array_split(run.latency, 2), strict=True):
        delays = 1e3 * part[np.isfinite(part)]
        p50, p99 = np.percentile(delays, [50, 99])
        print(f"datagram to driver, {name} half: p50 {p50:.2f} ms, p99 {p99:.2f} ms, largest {delays.max():.2f} ms")


if __name__ == "__main__":
    main(sys.argv[1:])

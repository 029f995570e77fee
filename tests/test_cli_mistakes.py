"""A user's mistake is one line on standard error and exit status 2; never a traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from naoimitate.cli import cli, run

MISTAKES = [
    ["walk"],
    ["--colour"],
    ["score"],
    ["score", "absent.npz"],
    ["score", "text.npz"],
    ["score", "text.npz", "--check", "--json"],
    ["score", "run.npz", "--bar"],
    ["imitate", "builtin:paper"],
    ["imitate", "absent.bvh", "--out", "run.npz"],
    ["imitate", "text.npz", "--out", "run.npz"],
    ["imitate", "broken.bvh", "--out", "run.npz"],
    ["imitate", "builtin:nothing", "--out", "run.npz"],
    ["imitate", "builtin:paper", "--out", "no/such/folder/run.npz"],
    ["imitate", "builtin:paper", "--out", "."],
    ["imitate", "builtin:paper", "--out", "run.npz", "--speed", "0"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--speed", "fast"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--speed", "nan"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--rate", "30"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--speed", "0.01"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--rate", "inf"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--rate", "1e9"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--sample", "0"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--sample", "1e12"],
    ["imitate", "text.npz", "--out", "run.npz", "--fps", "1e-9"],
    ["imitate", "paper", "--out", "run.npz"],
    ["imitate", "broken.bvh", "--out", "broken.bvh"],
    ["imitate", "builtin:paper", "--out", "same.html", "--report", "same.html"],
    ["imitate", "builtin:paper", "--out", "text.npz", "--subject", "text.npz"],
    ["imitate", "builtin:paper", "--out", "/dev/null"],
    ["imitate", "builtin:paper", "--out", "/proc/run.npz"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--retarget", "other"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--robot", "other"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--robot-version", "v9"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--subject", "absent.yaml"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--subject", "text.npz"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--start", "900"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--video", "run.gif"],
    ["imitate", "builtin:paper", "--out", "run.npz", "--environment", "stairs.yaml"],
    ["calibrate", "absent.bvh", "--out", "subject.yaml"],
    ["calibrate", "broken.bvh", "--out", "broken.bvh"],
    ["check", "absent.bvh"],
    ["check", "nao", "--robot-version", "v9"],
    ["check", "."],
    ["live", "--source", "replay:builtin:wave", "--driver", "can", "--feedback"],
    ["live", "--source", "replay:builtin:wave", "--driver", "none", "--feedback"],
    ["live", "--source", "replay:builtin:wave", "--driver", "none", "--shift", "jump"],
    ["reproduce", "other2020"],
    ["demo", "--out", "text.npz/inside"],
]


@pytest.mark.parametrize("arguments", MISTAKES, ids=" ".join)
def test_a_mistake_is_one_line_and_status_2(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.npz").write_text("neither a motion nor a run\n")
    Path("broken.bvh").write_text("HIERARCHY\nROOT Hips\n{\n  OFFSET 0 0 0\n  CHANNELS 6 Xposition\n")
    assert run(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("naoimitate")
    assert len(err) < 400
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.bvh", "text.npz"]


def test_a_motion_named_without_builtin_is_told_the_whole_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "wave"]) == 2
    assert "builtin:wave" in capsys.readouterr().err


@pytest.mark.parametrize("name", [None, *sorted(cli.commands)])
def test_every_command_has_help(name: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"] if name is None else [name, "--help"]) == 0
    assert "Usage: naoimitate" in capsys.readouterr().out


def test_without_arguments_help_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 0
    assert "Commands:" in capsys.readouterr().out


def test_help_loads_nothing_heavy() -> None:
    """--help answers in well under half a second because it imports only click."""
    code = (
        "import sys, naoimitate.cli as c; c.run(['--help']); print([m for m in ('numpy', 'numba') if m in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip().endswith("[]")


def test_a_run_of_another_kind_of_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    assert run(["score", str(tmp_path / "other.npz")]) == 2
    assert "key 'format' is missing" in capsys.readouterr().err


def test_a_reader_that_leaves_early_is_no_error() -> None:
    command = f"{sys.executable} -m naoimitate.cli motions --json | head -c 1"
    result = subprocess.run(["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True, check=False)
    assert result.stdout == "["
    assert result.stderr == ""

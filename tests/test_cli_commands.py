"""The commands do what they say, from the motion to the score sheet."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from synthetic import standing

from naoimitate.cli import run
from naoimitate.robot import load_robot
from naoimitate.run.file import load_run, save


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_imitate_writes_run_and_report_and_score_measures_it(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--end", "3", "--out", "run.npz", "--report", "run.html", "--seed", "4"]
    assert run(["imitate", "builtin:wave", *options]) == 0
    out, err = capsys.readouterr()
    assert "run.npz: " in out
    assert err == ""
    made = load_run("run.npz")
    assert made.source == "builtin:wave"
    settings = json.loads(made.provenance)
    assert settings["seed"] == 4
    assert settings["settings"]["retarget"] == "planted"
    html = Path("run.html").read_text()
    assert html.count("data:image/png;base64,") == 8
    assert "http" not in html.replace("http-equiv", "")
    assert run(["score", "run.npz", "--json", "--check"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["margin_min_mm"] >= 5.0
    assert values["missed"] == []


def test_a_simulated_run_says_whether_it_fell(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["imitate", "builtin:wave", "--end", "1", "--out", "run.npz", "--sim"]) == 0
    made = load_run("run.npz")
    assert made.sim_q is not None
    assert made.sim_q.shape == made.q.shape
    assert made.sim_fsr is not None and made.sim_fsr.shape == (len(made), 2, 4)
    assert "in simulation" in capsys.readouterr().out
    assert run(["score", "run.npz", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["sim_cop_margin_min_mm"] == pytest.approx(values["sim_zmp_margin_min_mm"], abs=2.0)
    assert values["sim_cop_edge_frames"] == 0


def test_score_check_fails_on_a_missed_bar_only(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = load_robot("nao")
    save(standing(robot, 60), "good.npz")
    save(standing(robot, 60, base_pos=standing(robot, 60).base_pos + np.array([0.0, 0.0, 0.002])), "bad.npz")
    assert run(["score", "good.npz", "--check"]) == 0
    assert run(["score", "bad.npz"]) == 0
    capsys.readouterr()
    assert run(["score", "bad.npz", "--check"]) == 1
    out, err = capsys.readouterr()
    missed = [line for line in out.splitlines() if "MISSED" in line]
    assert [line.split("  ")[0] for line in missed] == ["stance sole off the floor, largest"]
    assert err == ""


def test_a_run_of_a_robot_that_is_not_built_in_asks_for_its_folder(
    here: Path, second_robot_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(standing(load_robot(second_robot_folder), 60), "run.npz")
    assert run(["score", "run.npz"]) == 2
    assert "--robot" in capsys.readouterr().err
    assert run(["score", "run.npz", "--robot", str(second_robot_folder), "--check"]) == 0


def test_motions_lists_single_supports_with_side_and_times(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["motions", "--json"]) == 0
    motions = {motion["name"]: motion for motion in json.loads(capsys.readouterr().out)}
    assert {"paper", "step-and-reach", "squat", "bow-and-reach", "wave", "side-kick", "march", "walk"} <= set(motions)
    for motion in motions.values():
        for side, start, end in motion["single_support"]:
            assert side in ("L", "R")
            assert 0.0 < start < end <= motion["duration"]
    assert [phase[0] for phase in motions["paper"]["single_support"]] == ["L"]
    assert run(["motions"]) == 0
    assert "builtin:paper" in capsys.readouterr().out


def test_robots_lists_every_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robots"]) == 0
    assert [line.split(":")[0] for line in capsys.readouterr().out.splitlines()] == ["nao v4", "nao v5", "nao v6"]


@pytest.mark.parametrize("source", ["builtin:march", "nao"])
def test_check_says_what_it_sees_and_draws_it(here: Path, source: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", source]) == 0
    out = capsys.readouterr().out
    assert ("support: double" in out) if source.startswith("builtin") else ("5.195 kg" in out)
    (picture,) = here.glob("*-check.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert picture.name in out


def test_a_calibrated_subject_serves_a_later_run(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["calibrate", "builtin:paper", "--out", "subject.yaml"]) == 0
    assert "height 1.75 m" in capsys.readouterr().out
    assert run(["imitate", "builtin:wave", "--end", "0.5", "--subject", "subject.yaml", "--out", "run.npz"]) == 0
    assert len(json.loads(load_run("run.npz").provenance)["subject_sha256"]) == 64


def test_robots_computes_a_landing_set_as_a_part_of_a_robots_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    data = {"directions_deg": [0.0, 120.0, 240.0], "yaws": [-0.2, 0.2], "reach": [[0.1, 0.2, 0.1], [0.1, 0.2, 0.1]]}
    monkeypatch.setattr("naoimitate.balance.landing_tool.compute_landing_set", lambda robot, progress: data)
    assert run(["robots", "--landing-set", "nao"]) == 0
    assert yaml.safe_load(capsys.readouterr().out) == {"landing": data}
    assert run(["robots", "--landing-set", "nobody"]) == 2

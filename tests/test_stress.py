"""The suite: draws that can be repeated, within their ranges; what failed; a table, JSON and one line for mistakes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from synthetic import standing

from naoimitate.cli import run
from naoimitate.robot import RobotModel
from naoimitate.run.file import save
from naoimitate.sim.disturbance import Disturbance
from naoimitate.sim.placement import stand_on_floor
from naoimitate.sim.stress import ALL, KINDS, LATEST, PUSH, differences, draw, kinds_for, variant
from naoimitate.sim.stress_play import LOADED, SANK, TIPPED, Plan, play
from naoimitate.sim.stress_pool import Pool, Trial
from naoimitate.sim.stress_sweep import sweep

FIELDS = {
    "stiffness": {"stiffness"}, "torque": {"torque"}, "friction": {"friction"}, "mass": {"mass", "com", "seed"},
    "tilt": {"tilt", "tilt_heading"}, "delay": {"delay"}, "noise": {"noise", "seed"}, "drop": {"drop_at", "drop_time"},
    "push": {"push", "push_heading", "push_at"},
}  # fmt: skip


def stand(robot: RobotModel, support: str = "D", seconds: float = 1.0) -> Plan:
    frames = round(100.0 * seconds)
    q = robot.postures["stand"]
    rows = [np.tile(row, (frames, 1)) for row in (q, *stand_on_floor(robot, q))]
    return Plan("stand", 0.01 * np.arange(frames), *rows, np.full(frames, support), np.full((frames, 2), np.nan))


def test_draws_follow_from_their_seed_and_number() -> None:
    for part in (*KINDS, ALL):
        assert draw(KINDS, part, 7, 1) == draw(KINDS, part, 7, 1)
        if part != "delay":
            assert draw(KINDS, part, 7, 1) != draw(KINDS, part, 8, 1), part
            assert draw(KINDS, part, 7, 1) != draw(KINDS, part, 7, 2), part


def test_a_single_draw_changes_its_own_fields_only() -> None:
    assert FIELDS.keys() == KINDS.keys()
    for part, fields in FIELDS.items():
        assert {name for k in range(20) for name in differences(draw(KINDS, part, k, 0))} == fields


def test_draws_fill_the_stated_ranges() -> None:
    drawn = [draw(KINDS, ALL, number, 0) for number in range(400)]
    bounds = {
        "stiffness": (60.0, 400.0), "torque": (0.0, 1.0), "friction": (0.3, 1.0), "tilt": (0.0, np.radians(3.0)),
        "push": (0.0, PUSH), "push_at": (0.0, LATEST), "drop_at": (0.0, LATEST), "push_heading": (0.0, 2.0 * np.pi),
    }  # fmt: skip
    for name, (low, high) in bounds.items():
        values = np.array([getattr(one, name) for one in drawn])
        assert low <= values.min() < low + 0.03 * (high - low), name
        assert high - 0.03 * (high - low) < values.max() <= high, name
    for name, value in {"delay": 0.02, "drop_time": 0.2, "noise": 1.0, "mass": 0.1, "com": 0.1}.items():
        assert {getattr(one, name) for one in drawn} == {value}


def test_a_robot_without_stall_torques_is_drawn_the_same_but_for_them(second_robot: RobotModel) -> None:
    kinds = kinds_for(second_robot)
    assert "torque" not in kinds and len(kinds) == len(KINDS) - 1
    with_torque, without = draw(KINDS, ALL, 3, 0), draw(kinds, ALL, 3, 0)
    assert differences(with_torque).keys() - differences(without).keys() == {"torque"}
    assert without.stiffness == with_torque.stiffness and without.push_heading == with_torque.push_heading


def test_a_level_has_the_same_cases_as_the_next() -> None:
    low, high = (variant(KINDS["push"], level, 4, 0) for level in (0.1, 0.5))
    assert (low.push_heading, low.push_at) == (high.push_heading, high.push_at)
    assert (low.push, high.push) == (0.1, 0.5)


def test_levels_lead_away_from_neutral() -> None:
    for kind in KINDS.values():
        neutral = {"stiffness": 300.0, "friction": 0.8}.get(kind.name, 0.0)
        for levels in kind.outward:
            away = np.abs(np.array(levels) - neutral)
            assert away[0] > 0.0 and np.all(np.diff(away) > 0.0), kind.name
    assert KINDS["stiffness"].covers(80.0) and not KINDS["stiffness"].covers(50.0)
    assert KINDS["delay"].covers(0.01) and not KINDS["delay"].covers(0.04) and not KINDS["torque"].covers(-0.1)


def test_a_stand_survives_and_says_by_how_much(robot: RobotModel) -> None:
    outcome = play(robot, stand(robot), Disturbance(stiffness=150.0), known_stiffness=True)
    assert outcome.survived and not outcome.tipped and outcome.at == pytest.approx(0.99)
    assert np.degrees(outcome.tilt) < 0.5 and outcome.height > 0.99 and outcome.cop_margin > 0.02


def test_what_fails_first_is_told(nao: RobotModel) -> None:
    pushed = play(nao, stand(nao, seconds=2.0), Disturbance(push=5.0, push_at=0.1))
    assert pushed.failure in (TIPPED, SANK) and pushed.tipped and 0.2 < pushed.at < 2.0
    loaded = play(nao, stand(nao, "L"), Disturbance())
    assert loaded.failure == LOADED and not loaded.tipped


def test_soft_servos_sag_where_the_driver_takes_them_for_firm(nao: RobotModel) -> None:
    soft = Disturbance(stiffness=60.0)
    knows, believes = (play(nao, stand(nao), soft, known_stiffness=known) for known in (True, False))
    assert believes.tilt > 3.0 * knows.tilt


def test_processes_do_not_change_the_outcomes(nao: RobotModel) -> None:
    trials = [Trial(0, draw(KINDS, ALL, number, 3)) for number in range(4)]
    with Pool(nao, [stand(nao, seconds=0.3)], jobs=2) as pool:
        beside = list(pool.play(trials))
    with Pool(nao, [stand(nao, seconds=0.3)]) as pool:
        assert beside == list(pool.play(trials))


def test_a_sweep_finds_the_last_level_that_is_survived(nao: RobotModel) -> None:
    told: list[float] = []
    with Pool(nao, [stand(nao), stand(nao, "L", 0.1)]) as pool:
        found = sweep(pool, KINDS["torque"], 2, seed=0, cases=None, told=told.append)
    below, never, above, _ = found
    assert below.plan == 0 and below.survived is not None and below.fell == pytest.approx(below.survived - 0.1)
    assert above.fell is None and above.survived == 1.0 and above.fallen == ()
    assert never.plan == 1 and never.survived is None and never.fell == -0.1
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)


@pytest.fixture
def runs(nao: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stand as a run file, and one that says a foot is in the air which is not."""
    monkeypatch.chdir(tmp_path)
    plan = standing(nao, frames=10)
    save(plan, "stand.npz")
    contacts = np.tile([True, False], (10, 1))
    save(dataclasses.replace(plan, support=np.full(10, "L"), contacts=contacts), "lifted.npz")
    return tmp_path


def test_the_table_has_each_disturbance_alone_and_all_at_once(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["stress", "stand.npz", "--draws", "1", "--jobs", "1", "--check"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    rows = [line.split()[0] for line in out.splitlines() if "(100 %)" in line]
    assert rows == [*KINDS, ALL]
    assert "10 of 10 draws survived" in out and "60 to 400 N m/rad" in out


def test_a_fall_is_told_with_the_command_that_repeats_it(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--jobs", "1", "--seed", "2", "--only", "tilt", "--known-stiffness"]
    arguments = ["stress", "stand.npz", "lifted.npz", *options]
    assert run([*arguments, "--draws", "2"]) == 0
    out, _ = capsys.readouterr()
    assert "1 of 2 draws survived" in out and "swing foot loaded 1" in out
    command = "naoimitate stress lifted.npz --seed 2 --draw 1 --only tilt --known-stiffness"
    assert f"{command}\n" in out and "tilt_heading" in out
    assert run([*command.split()[1:], "--check"]) == 1


def test_json_has_every_draw_and_a_draw_can_be_repeated(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["stress", "stand.npz", "--jobs", "1", "--seed", "2", "--json", "--only", "stiffness"]
    assert run([*options, "--draws", "3"]) == 0
    drawn = json.loads(capsys.readouterr().out)
    assert drawn["seed"] == 2 and [part["part"] for part in drawn["parts"]] == ["stiffness"]
    assert run([*options, "--draw", "1"]) == 0
    (again,) = json.loads(capsys.readouterr().out)["cases"]
    assert again == drawn["cases"][1] and again["draw"] == 1 and again["disturbance"].keys() == {"stiffness"}


def test_a_sweep_is_told_as_table_and_as_json(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["stress", "stand.npz", "lifted.npz", "--jobs", "1", "--sweep", "noise", "--draws", "1"]
    assert run(options) == 0
    out, _ = capsys.readouterr()
    assert "no fall at any level" in out and "swing foot loaded at 0.00 s" in out
    assert run([*options, "--json", "--check"]) == 1
    held, fell = json.loads(capsys.readouterr().out)["boundaries"]
    assert held["motion"] == "stand.npz" and held["survived"] == 10.0 and held["fell"] is None and not held["fallen"]
    assert fell["survived"] is None and fell["fell"] == 1.0 and fell["fallen"][0]["failure"] == LOADED


@pytest.mark.parametrize(
    "arguments",
    [
        ["--only", "wind"],
        ["--sweep", "wind"],
        ["--sweep", "push", "--only", "push"],
        ["--draws", "0"],
        ["--seed", "-1"],
        ["missing.npz"],
        ["builtin:fly"],
    ],
)
def test_a_mistake_is_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["stress", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "Traceback" not in err

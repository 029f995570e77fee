"""A robot of the user's own: a folder with its data and its CAN database beside them."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from can_rig import rig
from second_robot import write_second_robot

from naoimitate import load_robot
from naoimitate.cli import run
from naoimitate.core.errors import DriverError
from naoimitate.hw.can import CanDriver
from naoimitate.hw.can.codecs import database_path
from naoimitate.robot.load import BUILT_IN


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of a built-in robot, the same name in it, whose motors expect a command every 20 ms."""
    folder = tmp_path / "mine"
    shutil.copytree(BUILT_IN / "nao", folder)
    database = folder / "can.dbc"
    text = database.read_text()
    slower = text.replace('BA_ "GenMsgCycleTime" BO_ 257 10;', 'BA_ "GenMsgCycleTime" BO_ 257 20;')
    assert slower != text
    database.write_text(slower)
    return folder


def test_its_own_database_is_used_from_wherever_it_is_loaded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder.parent)
    robot = load_robot("mine")
    monkeypatch.chdir("/")
    assert database_path(robot) == folder / "can.dbc"
    with rig(robot, compensation=False) as it:
        assert it.driver.period == 0.02
        it.driver.connect()
        assert np.abs(it.driver.read().q - robot.postures["stand"]).max() < 0.001


def test_a_folder_without_its_database_is_one_clear_message(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """That of a built-in robot with the same name does not stand in for it."""
    (folder / "can.dbc").unlink()
    robot = load_robot(folder)
    with pytest.raises(DriverError, match=r"there is no CAN database .*mine/can\.dbc: put it beside") as error:
        CanDriver(robot, interface="virtual", channel="unused")
    assert "\n" not in str(error.value)
    assert run(["can-stub", "--robot", str(folder), "--interface", "virtual", "--channel", "cli"]) == 2
    said = capsys.readouterr().err
    assert f"there is no CAN database {folder / 'can.dbc'}" in said and said.count("\n") == 1


def test_a_robot_without_motors_on_a_bus_is_one_clear_message(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = write_second_robot(tmp_path)
    assert run(["can-stub", "--robot", str(folder), "--interface", "virtual", "--channel", "cli"]) == 2
    said = capsys.readouterr().err
    assert "second has no motors on a CAN bus: add a section `can`" in said and said.count("\n") == 1

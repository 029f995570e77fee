"""Fixtures that many tests share: the two robots. Loaded once; treat them as constants."""

from __future__ import annotations

from pathlib import Path

import pytest
from second_robot import write_second_robot

from naoimitate.robot import RobotModel, load_robot


@pytest.fixture(scope="session")
def nao() -> RobotModel:
    return load_robot("nao", "v4")


@pytest.fixture(scope="session")
def second_robot_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_second_robot(tmp_path_factory.mktemp("second_robot"))


@pytest.fixture(scope="session")
def second_robot(second_robot_folder: Path) -> RobotModel:
    return load_robot(second_robot_folder)


@pytest.fixture(scope="session", params=["nao", "second_robot"])
def robot(request: pytest.FixtureRequest) -> RobotModel:
    """Each of the two robots in turn."""
    model: RobotModel = request.getfixturevalue(request.param)
    return model

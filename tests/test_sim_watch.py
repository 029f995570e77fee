"""Whoever looks at a running simulation sees it, and cannot disturb it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest
from test_sim_driver import command

from naoimitate.core.errors import RenderingUnavailable, RobotModelError
from naoimitate.robot import RobotModel
from naoimitate.robot.model import Array
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.gl import Canvas, no_window
from naoimitate.sim.model import build_model
from naoimitate.sim.onlookers import FILM_RATE, FILM_SIZE
from naoimitate.sim.positions import Positions
from naoimitate.sim.watch import Watch, camera_names

SESSION = """
import sys, time
from pathlib import Path
from naoimitate.robot import load_robot
from naoimitate.sim.driver import MujocoDriver
from naoimitate.sim.watch import Watch

if __name__ == "__main__":
    driver = MujocoDriver(load_robot("nao"))
    driver.connect()
    with Watch(driver, video=Path(sys.argv[1]), video_camera="free", notice=lambda line: print(line, flush=True)):
        print("ready", flush=True)
        time.sleep(60.0)
"""


@pytest.fixture(scope="module")
def gl(nao: RobotModel) -> None:
    try:
        Canvas(build_model(nao), 64, 64).close()
    except RenderingUnavailable as reason:
        pytest.skip(str(reason))


def frames(path: Path) -> list[Array]:
    with imageio.get_reader(path) as video:
        assert video.get_meta_data()["fps"] == pytest.approx(FILM_RATE)
        return [np.asarray(frame) for frame in video]


def wave(driver: MujocoDriver, robot: RobotModel, seconds: float) -> list[float]:
    """Command at 100 Hz, arms up after half of the time; returns how late (s) each command came."""
    q = robot.postures["stand"].copy()
    up = q.copy()
    for side in "LR":
        up[robot.joint(f"{side}ShoulderPitch")] -= 1.2
    stand, late, begin = command(robot, q), [], time.monotonic()
    for step in range(round(100 * seconds)):
        late.append(time.monotonic() - begin - 0.01 * step)
        driver.write(replace(stand, q=up if step > 50 * seconds else q))
        time.sleep(max(0.0, begin + 0.01 * (step + 1) - time.monotonic()))
    return late


@pytest.mark.usefixtures("gl")
def test_the_film_lasts_as_long_as_it_was_watched_and_shows_the_robot_move(nao: RobotModel, tmp_path: Path) -> None:
    driver, said = MujocoDriver(nao), []
    driver.connect()
    path = tmp_path / "film.mp4"
    with Watch(driver, video=path, video_camera="free", notice=said.append):
        begin = time.monotonic()
        wave(driver, nao, 3.0)
        elapsed = time.monotonic() - begin
    driver.stop()
    shown = frames(path)
    assert len(shown) / FILM_RATE == pytest.approx(elapsed, abs=1.0)
    assert shown[0].shape == (FILM_SIZE[1], FILM_SIZE[0], 3)
    moved = np.abs(shown[-1].astype(int) - shown[5]).max(axis=2) > 60
    assert moved.sum() > 500
    assert len(said) == 1 and said[0].startswith(f"{path}: ")


@pytest.mark.usefixtures("gl")
def test_by_default_the_film_is_what_the_robots_own_camera_sees(nao: RobotModel, tmp_path: Path) -> None:
    driver = MujocoDriver(nao, real_time=False)
    driver.connect()
    assert camera_names(driver.model) == ("free", "top", "bottom")
    path = tmp_path / "film.mp4"
    with Watch(driver, video=path, notice=lambda _: None):
        time.sleep(0.2)
        q = nao.postures["stand"].copy()
        q[nao.joint("HeadPitch")] = 0.4
        driver.write(command(nao, q))
        driver.advance(1.0)
        time.sleep(0.5)
    shown = frames(path)
    tiles = [float(frame[140:150].std(axis=1).mean()) for frame in (shown[0], shown[-1])]
    assert tiles[0] < 2.0 and tiles[1] > 4.0  # above the middle: first the plain sky, then the floor


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("end", ["ctrl-c", "kill"])
def test_the_film_is_whole_when_the_program_is_interrupted_or_killed(tmp_path: Path, end: str) -> None:
    path, script = tmp_path / "film.mp4", tmp_path / "session.py"
    script.write_text(SESSION)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "text": True}
    session = subprocess.Popen([sys.executable, script, path], start_new_session=True, **pipes)
    assert session.stdout is not None and session.stdout.readline() == "ready\n"
    time.sleep(1.0)
    if end == "ctrl-c":
        os.killpg(session.pid, signal.SIGINT)  # as a terminal does: to the program and all its processes
    else:
        session.kill()
    session.wait(20.0)
    deadline = time.monotonic() + 20.0
    while _group_lives(session.pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _group_lives(session.pid)
    assert len(frames(path)) >= 0.7 * FILM_RATE


def _group_lives(group: int) -> bool:
    """Whether a process of a group still runs (zombies, which nobody may collect in a container, do not)."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, number = stat.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(number) == group and state != "Z":
            return True
    return False


def test_without_opengl_or_a_screen_one_line_each_says_so_and_nothing_ends(
    nao: RobotModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "off")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    driver, said = MujocoDriver(nao, real_time=False), []
    driver.connect()
    with Watch(driver, view=True, video=tmp_path / "film.mp4", notice=said.append):
        assert not driver.advance(0.1).fell
    assert len(said) == 2 and all("\n" not in line for line in said)
    assert said[0].startswith("No window") and said[1].startswith("No pictures")


@pytest.mark.usefixtures("gl")
def test_a_film_that_cannot_be_written_is_one_line(nao: RobotModel, tmp_path: Path) -> None:
    driver, said = MujocoDriver(nao, real_time=False), []
    driver.connect()
    with Watch(driver, video=tmp_path / "absent" / "film.mp4", notice=said.append):
        pass
    assert len(said) == 1 and said[0].startswith("No video") and "\n" not in said[0]


@pytest.mark.usefixtures("gl")
def test_an_onlooker_that_dies_is_told_of_and_the_simulation_goes_on(nao: RobotModel, tmp_path: Path) -> None:
    driver, said = MujocoDriver(nao), []
    driver.connect()
    with Watch(driver, video=tmp_path / "film.mp4", notice=said.append) as watch:
        watch._running[0].process.kill()
        deadline = time.monotonic() + 10.0
        while not said and time.monotonic() < deadline:
            time.sleep(0.02)
        assert len(said) == 1 and "failed" in said[0]
        before = driver.read().time
        time.sleep(0.2)
        assert driver.read().time > before
    driver.stop()
    assert len(said) == 1


def test_a_window_shows_where_there_is_a_screen(nao: RobotModel) -> None:
    reason = no_window()
    if reason is not None:
        pytest.skip(reason)
    driver, said = MujocoDriver(nao), []
    driver.connect()
    with Watch(driver, view=True, camera="bottom", notice=said.append) as watch:
        time.sleep(1.0)
        assert [onlooker.name for onlooker in watch._running] == ["the window"]
    driver.stop()
    assert said == []


def test_a_camera_that_is_not_there_is_a_mistake(nao: RobotModel, second_robot: RobotModel) -> None:
    driver = MujocoDriver(nao, real_time=False)
    with pytest.raises(RobotModelError, match="free, top, bottom"):
        Watch(driver, view=True, camera="elbow", notice=print)
    assert camera_names(MujocoDriver(second_robot, real_time=False).model) == ("free",)


def test_readers_get_the_newest_positions_of_one_write_as_a_whole() -> None:
    positions, halt = Positions(500), threading.Event()

    def writer() -> None:
        count = 0.0
        while not halt.is_set():
            count += 1.0
            positions.write(count, np.full(500, count))

    thread = threading.Thread(target=writer)
    thread.start()
    last = 0.0
    for _ in range(2000):
        moment, qpos = positions.read()
        assert (qpos == moment).all() and moment >= last
        last = moment
    halt.set()
    thread.join()
    assert last > 0.0
    positions.write(0.5, np.zeros(500))
    assert positions.read()[0] == 0.5

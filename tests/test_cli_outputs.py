"""What commands write is whole or not there, also where the user stops them or there are no pictures."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from naoimitate.cli import demo, motions, run
from naoimitate.cli.outputs import keep_apart, whole


def test_a_file_appears_when_all_went_well_only(tmp_path: Path) -> None:
    path = tmp_path / "video.mp4"
    with whole(path) as beside:
        assert beside.suffix == ".mp4"
        beside.write_text("first")
        assert not path.exists()
    with pytest.raises(KeyboardInterrupt), whole(path) as beside:
        beside.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "first"
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_is_written_over_what_is_read_or_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    keep_apart(("builtin:paper", None), [Path("run.npz"), None, Path("run.html")])
    for inputs, outputs in (
        (("clip.bvh",), [tmp_path / "clip.bvh"]),
        (("clip.bvh",), [Path("a.html"), None, Path("./a.html")]),
    ):
        with pytest.raises(click.UsageError, match="twice"):
            keep_apart(inputs, outputs)


def test_a_link_is_kept_and_its_file_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("link.yaml").symlink_to("subject.yaml")
    assert run(["calibrate", "builtin:paper", "--out", "link.yaml"]) == 0
    assert Path("link.yaml").is_symlink()
    assert Path("subject.yaml").is_file()


def test_without_opengl_the_run_is_made_and_a_line_says_why_there_is_no_video(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MUJOCO_GL", "disable")
    assert run(["imitate", "builtin:wave", "--end", "0.1", "--out", "run.npz", "--video", "run.mp4"]) == 0
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "apt install" in err
    assert [path.name for path in tmp_path.iterdir()] == ["run.npz"]


def in_compiled_code() -> None:
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as error:
        raise SystemError("returned a result with an exception set") from error


def interrupted() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("stop", [interrupted, in_compiled_code])
def test_ctrl_c_is_one_line_and_status_130(
    stop: object, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(motions, "callback", lambda **_: stop())  # type: ignore[operator]
    assert run(["motions"]) == 130
    assert capsys.readouterr().err.strip() == "naoimitate: interrupted"


def test_too_little_memory_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def exhaust(**_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(demo, "callback", exhaust)
    assert run(["demo"]) == 2
    assert "memory" in capsys.readouterr().err


def test_a_folder_that_cannot_be_written_is_told_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("naoimitate.cli.folder.is_writable", lambda folder: False)
    assert run(["demo", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith("naoimitate: cannot write into the folder")

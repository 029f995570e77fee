"""What README and examples/ show, runs as it stands there."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

import naoimitate

ROOT = Path(__file__).parent.parent


def test_the_readme_example_runs_and_is_about_twenty_lines(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert len(code.splitlines()) <= 22
    exec(compile(code, "README.md", "exec"), {})
    assert "left shoulder pitch" in capsys.readouterr().out


@pytest.mark.parametrize("example", sorted((ROOT / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_examples_run(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example)])
    runpy.run_path(str(example), run_name="__main__")
    assert list(tmp_path.iterdir())


def test_public_names_load_lazily_and_all_of_them_exist() -> None:
    for name in naoimitate.__all__:
        assert getattr(naoimitate, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        naoimitate.nonsense  # noqa: B018

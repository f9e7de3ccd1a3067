"""Every word of the README is true: its Python runs, its commands exist."""

import re
import shutil
from pathlib import Path
from typing import Any

import pytest
from flight_projects import Demo

from uavgram.cli.entry import app


@pytest.fixture(scope="module")
def readme(repository: Path) -> str:
    return (repository / "README.md").read_text(encoding="utf-8")


def test_the_python_of_the_readme_runs_on_the_demo(
    readme: str,
    demo: Demo,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    # A copy without its results: others read them.
    folder = tmp_path / "survey"
    shutil.copytree(demo.folder, folder, ignore=shutil.ignore_patterns("out"))
    monkeypatch.chdir(folder)
    blocks = re.findall(r"```python\n(.*?)```", readme, flags=re.DOTALL)
    names: dict[str, Any] = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)  # noqa: S102  (our own words)

    assert len(blocks) == 2
    assert re.search(r"skid left +16\.9", capsys.readouterr().out)
    assert names["again"].measurements.name == names["result"].measurements.name
    assert names["covariance"].shape == (6, 6)


def test_every_command_that_the_readme_names_exists(readme: str) -> None:
    named = set(re.findall(r"uavgram ([a-z]+)", "\n".join(re.findall(r"`+[^`]+`+", readme))))

    assert {"demo", "run", "check", "log", "view"} <= named
    assert named <= {name for name in app if not name.startswith("-")}


def test_the_files_and_the_picture_that_the_readme_names_are_there(
    readme: str, repository: Path
) -> None:
    for name in re.findall(r"!\[[^]]*\]\(([^)]+)\)", readme):
        assert (repository / name).is_file(), name
    assert Path(repository, "configs", "project.yaml").is_file()


def test_the_pages_and_sources_that_the_readme_names_are_there(
    readme: str, repository: Path
) -> None:
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", readme) if "://" not in link]
    sources = re.findall(r"`(uavgram/[\w/.]+)`", readme)

    assert "docs/architecture.md" in links
    assert "uavgram/pipeline/measure/compute.py" in sources
    for name in (*links, *sources):
        assert (repository / name).exists(), name

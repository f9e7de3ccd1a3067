"""A release: one version, the same wheel and sdist each time, no dead link in its text."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType

import pytest
import yaml

MAX_CHANGELOG_WORDS = 700
"""A page, as readers of a changelog expect."""


@pytest.fixture(scope="module")
def built(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, bytes]]:
    """Wheel and sdist, built twice."""
    both = []
    for name in ("once", "again"):
        folder = tmp_path_factory.mktemp(name)
        subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "--directory", folder],
            cwd=repository,
            env={**os.environ, "SOURCE_DATE_EPOCH": "1780000000"},
            check=True,
            capture_output=True,
        )
        both.append({path.name: path.read_bytes() for path in folder.iterdir()})
    return both


@pytest.fixture
def project(repository: Path) -> dict[str, object]:
    text = (repository / "pyproject.toml").read_text(encoding="utf-8")
    project: dict[str, object] = tomllib.loads(text)["project"]
    return project


@pytest.fixture
def readme(repository: Path) -> ModuleType:
    """What makes the package's description of the README."""
    path = repository / ".ci" / "release" / "readme.py"
    spec = importlib.util.spec_from_file_location("readme", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_wheel_and_sdist_are_the_same_each_time(built: list[dict[str, bytes]]) -> None:
    once, again = built

    assert sorted(once) == [
        f"uavgram-{importlib.metadata.version('uavgram')}-py3-none-any.whl",
        f"uavgram-{importlib.metadata.version('uavgram')}.tar.gz",
    ]
    assert once == again


def test_an_index_would_take_them(built: list[dict[str, bytes]], tmp_path: Path) -> None:
    for name, content in built[0].items():
        (tmp_path / name).write_bytes(content)
    paths = sorted(tmp_path.iterdir())
    twine = [sys.executable, "-m", "twine", "check", "--strict", *map(str, paths)]
    ran = subprocess.run(twine, capture_output=True, encoding="utf-8", check=False)

    assert ran.returncode == 0, ran.stdout
    assert ran.stdout.count("PASSED") == 2
    with zipfile.ZipFile(next(path for path in paths if path.suffix == ".whl")) as wheel:
        name = next(name for name in wheel.namelist() if name.endswith("/METADATA"))
        shown = wheel.read(name).decode("utf-8")
    assert re.findall(r"\]\((?!https://)[^)]*\)", shown) == []
    assert "pip install uavgram" not in shown


def test_links_of_the_description_are_absolute_or_left_out(readme: ModuleType) -> None:
    text = "![a plan](.readme/plan.jpg)\n\n[how](docs/a.md#b) and [Rerun](https://rerun.io)\n"

    assert readme.described(text, "") == "how and [Rerun](https://rerun.io)\n"
    assert readme.described(text, "https://example.org/v1/") == (
        "![a plan](https://example.org/v1/.readme/plan.jpg)\n\n"
        "[how](https://example.org/v1/docs/a.md#b) and [Rerun](https://rerun.io)\n"
    )


def test_all_places_have_one_version(project: dict[str, object], repository: Path) -> None:
    citation = yaml.safe_load((repository / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (repository / "docs" / "CHANGELOG.md").read_text(encoding="utf-8")

    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert re.findall(r"^## (\S+)", changes, re.MULTILINE)[0] == project["version"]
    assert len(changes.split()) <= MAX_CHANGELOG_WORDS


def test_the_lock_has_every_dependency_in_its_range(
    project: dict[str, object], repository: Path
) -> None:
    packaging = pytest.importorskip("packaging.requirements")
    lock = (repository / ".ci" / "release" / "requirements.lock").read_text(encoding="utf-8")
    locked = dict(re.findall(r"^([a-z0-9-]+)==([^ ;\\]+)", lock, re.MULTILINE))
    dependencies = project["dependencies"]
    assert isinstance(dependencies, list)

    for text in dependencies:
        wanted = packaging.Requirement(text)
        assert wanted.specifier.contains(locked[wanted.name.lower()], prereleases=True), text


def test_no_text_says_that_an_index_has_it(repository: Path) -> None:
    texts = [repository / "README.md", *(repository / "docs").rglob("*.md")]
    for path in texts:
        found = re.findall(r"pip install '?uavgram\b(?!-)[^/]", path.read_text(encoding="utf-8"))
        assert found == [], path

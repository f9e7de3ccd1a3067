"""A small project that runs in a moment: the simulated survey with blank photos."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from small_projects import Command, Done, Fails, Project, write_small_survey

from uavgram.cli import main


@pytest.fixture(scope="session")
def small_survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project with the results of a good run in `out`; copied, never changed."""
    folder = tmp_path_factory.mktemp("small") / "survey"
    project = write_small_survey(folder)
    assert main(["run", str(project)]) == 0
    return folder


@pytest.fixture
def project(small_survey: Path, tmp_path: Path) -> Project:
    """A fresh copy, with earlier results in `out`."""
    folder = tmp_path / "survey"
    shutil.copytree(small_survey, folder)
    return Project(folder)


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """The command line in this process: status and what was said."""

    def run(*arguments: object) -> Done:
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return Done(status, said.out, said.err)

    return run


@pytest.fixture
def fails(command: Command, project: Project) -> Fails:
    """Run the project: status 1, one message that names every place, earlier results untouched."""

    def run(*places: object) -> str:
        before = project.outputs()
        assert before, "the earlier results are missing: nothing would be proved"
        done = command("run", project.path)
        assert done.status == 1, done
        assert done.stdout == ""
        assert done.stderr.startswith("uavgram: ")
        assert done.stderr.count("uavgram: ") == 1
        assert "Traceback" not in done.stderr
        for place in places:
            assert str(place) in done.stderr, done.stderr
        assert project.outputs() == before
        return done.stderr

    return run

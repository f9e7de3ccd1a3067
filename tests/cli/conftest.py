"""A small project that runs in a moment: the simulated survey with blank photos."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from uavgram.cli import main
from uavgram.io.demo_files import write_demo
from uavgram.model.demo.scenario import CameraSpec, DemoScenario
from uavgram.stages.simulate.survey import simulate

WIDTH_PX, HEIGHT_PX = 400, 300


@pytest.fixture(scope="session")
def small_survey(tmp_path_factory: pytest.TempPathFactory):
    """A project with the results of a good run in `out`; copied, never changed."""
    scale = WIDTH_PX / CameraSpec().width_px
    full = CameraSpec()
    pixels = [scale] * 4 + [1.0] * 5
    camera = CameraSpec(
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        parameters=tuple(np.multiply(full.parameters, pixels).tolist()),
        sigma=tuple(np.multiply(full.sigma, pixels).tolist()),
    )
    survey = simulate(replace(DemoScenario(), camera=camera))
    photos = (np.full((HEIGHT_PX, WIDTH_PX, 3), 90, np.uint8) for _ in survey.frame_id)
    folder = tmp_path_factory.mktemp("small") / "survey"
    project = write_demo(folder, survey, photos)
    assert main(["run", str(project)]) == 0
    return folder


class Project:
    """A copy of the small project that a test may break."""

    def __init__(self, folder) -> None:
        self.folder = folder
        self.path = folder / "project.yaml"
        self.out = folder / "out"

    def __truediv__(self, name):
        return self.folder / name

    def edit(self, name, old, new) -> None:
        """Replace the first occurrence of some text in a file."""
        text = (self.folder / name).read_text(encoding="utf-8")
        assert old in text, f"{name} holds no {old!r}"
        (self.folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")

    def cell(self, name, row, column, value) -> None:
        """Set one cell of a CSV file; rows count from 1, below the header."""
        lines = (self.folder / name).read_text(encoding="utf-8").splitlines()
        cells = lines[row].split(",")
        cells[lines[0].split(",").index(column)] = value
        lines[row] = ",".join(cells)
        (self.folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")

    def set(self, **changes) -> None:
        """Change keys of project.yaml; None removes one."""
        data = yaml.safe_load(self.path.read_text(encoding="utf-8")) | changes
        kept = {key: value for key, value in data.items() if value is not None}
        self.path.write_text(yaml.safe_dump(kept, sort_keys=False), encoding="utf-8")

    def outputs(self):
        """Every file of the output folder, hidden ones too, with its bytes."""
        files = self.out.rglob("*") if self.out.exists() else ()
        return {str(p.relative_to(self.out)): p.read_bytes() for p in files if p.is_file()}


@pytest.fixture
def project(small_survey, tmp_path: Path):
    """A fresh copy, with earlier results in `out`."""
    folder = tmp_path / "survey"
    shutil.copytree(small_survey, folder)
    return Project(folder)


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]):
    """The command line in this process: status and what was said."""

    def run(*arguments):
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        said = capsys.readouterr()
        return SimpleNamespace(status=status, stdout=said.out, stderr=said.err)

    return run


@pytest.fixture
def fails(command, project):
    """Run the project: status 1, one message that names every place, earlier results untouched."""

    def run(*places):
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

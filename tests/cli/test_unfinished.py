"""Runs that break off while they write: earlier results stay, and no half-made file appears."""

from __future__ import annotations

import errno
import importlib
import os
import shutil
from pathlib import Path
from typing import Never

import pytest
from small_projects import Command, Fails, Project

from uavgram.pipeline.measure.compute import Computation, compute
from uavgram.pipeline.measure.inputs import read_inputs

run_module = importlib.import_module("uavgram.pipeline.measure.run")
outputs_module = importlib.import_module("uavgram.pipeline.measure.outputs")
exports_module = importlib.import_module("uavgram.pipeline.measure.exports")


@pytest.fixture(scope="module")
def computed(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Computation:
    """What would differ from the earlier results in every file: another measurement's name."""
    folder = tmp_path_factory.mktemp("computed") / "survey"
    shutil.copytree(small_survey, folder)
    project = Project(folder)
    project.cell("measure.csv", 1, "name", "other name")
    return compute(read_inputs(project.path))


@pytest.fixture(autouse=True)
def _computed_once(monkeypatch: pytest.MonkeyPatch, computed: Computation) -> None:
    """Nothing is broken off while it is computed, but once; so it need not be done each time."""
    monkeypatch.setattr(run_module, "compute", lambda *_args, **_named: computed)


def raise_at(name: str, fault: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_args: object, **_kwargs: object) -> Never:
        raise fault

    modules = run_module, outputs_module, exports_module
    module = next(one for one in modules if hasattr(one, name))
    monkeypatch.setattr(module, name, fail)


WRITERS = [
    "read_preview", "write_geojson", "write_measurements_csv", "write_geopackage", "write_kml",
    "write_dxf", "write_colmap_model", "write_report", "write_recording", "write_results",
]  # fmt: skip


@pytest.mark.parametrize("step", WRITERS)
def test_a_full_disk_is_told_and_changes_nothing(
    project: Project, fails: Fails, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    raise_at(step, full, monkeypatch)
    fails(project.out, "disk is full", "--output")


@pytest.mark.parametrize("step", ["compute", *WRITERS])
def test_ctrl_c_changes_nothing(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    before = project.outputs()
    raise_at(step, KeyboardInterrupt(), monkeypatch)
    done = command("run", project.path)
    assert done.status == 130
    assert done.stdout == ""
    assert done.stderr == "uavgram: interrupted; no result is half written\n"
    assert project.outputs() == before


@pytest.mark.parametrize("fault", [OSError(errno.ENOSPC, "full"), KeyboardInterrupt()])
@pytest.mark.parametrize("after", [0, 3, 5])
def test_a_failure_amid_moving_the_files_undoes_the_moved_ones(
    project: Project,
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    fault: BaseException,
    after: int,
) -> None:
    before = project.outputs()
    moved: list[str | Path] = []
    replace = Path.replace

    def fail(self: Path, target: str | Path) -> Path:
        if Path(target).parent == project.out and self.parent.name == "files":
            if len(moved) == after:
                moved.append("failed")
                raise fault
            moved.append(target)
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", fail)
    done = command("run", project.path)
    assert "failed" in moved
    assert done.status == (1 if isinstance(fault, OSError) else 130)
    assert done.stderr.count("uavgram: ") == 1
    assert project.outputs() == before


def test_a_bug_keeps_its_traceback_and_changes_nothing(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = project.outputs()
    raise_at("write_results", ZeroDivisionError("a bug"), monkeypatch)
    with pytest.raises(ZeroDivisionError):
        command("run", project.path)
    assert project.outputs() == before


def test_no_permission_is_told_with_the_folder(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the message of the system, because tests may run as root, whom nothing stops."""
    mkdir = Path.mkdir

    def refuse(
        self: Path, mode: int = 0o777, *, parents: bool = False, exist_ok: bool = False
    ) -> None:
        if self.name == "forbidden":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))
        mkdir(self, mode, parents=parents, exist_ok=exist_ok)

    monkeypatch.setattr(Path, "mkdir", refuse)
    folder = project.folder / "forbidden"
    done = command("run", project.path, "--output", folder)
    assert done.status == 1
    assert done.stderr.startswith("uavgram: ")
    assert str(folder) in done.stderr
    assert "Permission denied" in done.stderr
    assert not folder.exists()


def test_an_output_that_is_a_file_is_told(project: Project, command: Command) -> None:
    done = command("run", project.path, "--output", project / "picks.csv")
    assert done.status == 1
    assert str(project / "picks.csv") in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_first_run_that_fails_leaves_no_folder(
    project: Project, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    raise_at("write_results", OSError(errno.ENOSPC, "full"), monkeypatch)
    done = command("run", project.path, "--output", project / "new")
    assert done.status == 1
    assert not (project / "new").exists()


def test_files_of_others_in_the_folder_stay(project: Project, command: Command) -> None:
    (project.out / "notes.txt").write_text("mine", encoding="utf-8")
    assert command("run", project.path).status == 0
    assert (project.out / "notes.txt").read_text(encoding="utf-8") == "mine"

"""Projects run once per session: the real flight, its digital twins, and the built-in demo."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from flight_projects import Demo, RunFlight, Truth, Tutorial, copy_project
from manual_pages import manual_pages
from traced_programs import traced

import uavgram
from uavgram.cli import main
from uavgram.model.result.result import Result


@pytest.fixture(scope="session")
def run_flight(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> RunFlight:
    """Compute a flight of the data folder, with changes to its project; each variant once."""
    known: dict[tuple[str, str], Result] = {}

    def run(name: str, **changes: object) -> Result:
        key = (name, json.dumps(changes, sort_keys=True))
        if key not in known:
            source = data_dir / name
            if "log" in changes and changes["log"] is not None:
                changes = changes | {"log": str(source / str(changes["log"]))}
            project = copy_project(source, tmp_path_factory.mktemp(name), **changes)
            known[key] = uavgram.run(project, output=None)
        return known[key]

    return run


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    """What `uavgram demo` leaves and says."""
    folder = tmp_path_factory.mktemp("demo") / "survey"
    said, told = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
        status = main(["demo", "--output", str(folder)])
    return Demo(
        status=status,
        stdout=said.getvalue(),
        stderr=told.getvalue(),
        folder=folder,
        project=folder / "project.yaml",
        out=folder / "out",
        truth=json.loads((folder / "truth.json").read_text(encoding="utf-8")),
    )


@pytest.fixture(scope="session")
def tutorial(repository: Path, tmp_path_factory: pytest.TempPathFactory) -> Tutorial:
    """What the tutorial's commands leave and show, typed into one shell.

    The program is the wheel, installed beside its dependencies; the clone itself is not in sight.
    """
    folder = tmp_path_factory.mktemp("tutorial")
    wheel = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir"]
    subprocess.run([*build, wheel, repository], check=True, capture_output=True)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target"]
    subprocess.run([*pip, wheel / "site", *wheel.glob("*.whl")], check=True, capture_output=True)
    (page,) = (page for page in manual_pages() if page.name == "docs/start.md")
    where = f"{sys.executable} -c 'import uavgram; print(uavgram.__file__)'"
    environment = {
        "PATH": os.pathsep.join([str(wheel / "site" / "bin"), os.environ["PATH"]]),
        "PYTHONPATH": str(wheel / "site"),
        "OPENBLAS_NUM_THREADS": "1",
        "COLUMNS": "160",
    }
    script = "\n".join([where, *page.run("sh")])
    with traced(folder, "bash", "-e", "-c", script, **environment) as shell:
        shown = shell.communicate()[0]
    assert shell.returncode == 0, shown
    assert Path(shown.partition("\n")[0]).is_relative_to(wheel)
    return Tutorial(folder=folder, shown=shown)


@pytest.fixture(scope="session")
def truth(data_dir: Path) -> Callable[[str], Truth]:
    """What the simulator knows of a twin, in ENU metres about its true take-off point."""

    def load(name: str) -> Truth:
        known: Truth = json.loads((data_dir / "truth" / f"{name}.json").read_text(encoding="utf-8"))
        return known

    return load

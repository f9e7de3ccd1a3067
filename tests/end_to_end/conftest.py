"""Projects run once per session: the real flight, its digital twins, and the built-in demo."""

from __future__ import annotations

import contextlib
import io
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import uavgram
from uavgram.cli import main
from uavgram.geometry.earth.geodesy import enu_from_geodetic

FILES = ("log", "camera", "picks", "lines", "measure", "control", "check")


@pytest.fixture(scope="session")
def copy_project():
    """Write a project file elsewhere that names the same inputs by absolute paths."""

    def copy(source, folder, **changes):
        project = yaml.safe_load((source / "project.yaml").read_text(encoding="utf-8"))
        project |= {key: str(source / project[key]) for key in FILES if key in project}
        project |= {"images": str(source / project["images"]), "output": str(folder / "out")}
        project |= changes
        project = {key: value for key, value in project.items() if value is not None}
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "project.yaml"
        path.write_text(yaml.safe_dump(project, sort_keys=False), encoding="utf-8")
        return path

    return copy


@pytest.fixture(scope="session")
def run_flight(data_dir: Path, tmp_path_factory: pytest.TempPathFactory, copy_project):
    """Compute a flight of the data folder, with changes to its project; each variant once."""
    known = {}

    def run(name, **changes):
        key = (name, json.dumps(changes, sort_keys=True))
        if key not in known:
            source = data_dir / name
            if "log" in changes and changes["log"] is not None:
                changes = changes | {"log": str(source / changes["log"])}
            project = copy_project(source, tmp_path_factory.mktemp(name), **changes)
            known[key] = uavgram.run(project, output=None)
        return known[key]

    return run


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory):
    """What `uavgram demo` leaves and says."""
    folder = tmp_path_factory.mktemp("demo") / "survey"
    said, told = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told):
        status = main(["demo", "--output", str(folder)])
    return SimpleNamespace(
        status=status,
        stdout=said.getvalue(),
        stderr=told.getvalue(),
        folder=folder,
        project=folder / "project.yaml",
        out=folder / "out",
        truth=json.loads((folder / "truth.json").read_text(encoding="utf-8")),
    )


@pytest.fixture(scope="session")
def truth(data_dir: Path):
    """What the simulator knows of a twin, in ENU metres about its true take-off point."""

    def load(name):
        return json.loads((data_dir / "truth" / f"{name}.json").read_text(encoding="utf-8"))

    return load


@pytest.fixture(scope="session")
def into_true_world():
    """Shift from a result's world into the truth's: their origins differ (data/README.md)."""

    def shift(result, truth):
        world = truth["world"]
        height = world["height_amsl_m"]
        place = (world["latitude_deg"], world["longitude_deg"], height)
        offset = enu_from_geodetic(
            np.array([result.world.origin.latitude_deg]),
            np.array([result.world.origin.longitude_deg]),
            np.array([height]),
            place,
        )[0]
        # Horizontally by latitude and longitude; heights are above each origin's own height.
        return np.array([offset[0], offset[1], result.world.origin.height_m - height])

    return shift

"""Projects of the real flight and its digital twins, copied to be changed, and their truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import yaml

from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result

FILES = ("log", "camera", "picks", "lines", "measure", "control", "check")

Truth = dict[str, Any]
"""What the simulator knows of a twin, as JSON, in ENU metres about its true take-off point."""


class RunFlight(Protocol):
    """Computes a flight of the data folder by its name, with changes to its project."""

    def __call__(self, name: str, **changes: object) -> Result: ...


@dataclass(frozen=True, kw_only=True)
class Demo:
    """What `uavgram demo` leaves and says."""

    status: int
    stdout: str
    stderr: str
    folder: Path
    project: Path
    out: Path
    truth: Truth


@dataclass(frozen=True, kw_only=True)
class Tutorial:
    """What the tutorial's commands leave, and what they show."""

    folder: Path
    shown: str


def copy_project(source: Path, folder: Path, **changes: object) -> Path:
    """Write a project file elsewhere that names the same inputs by absolute paths."""
    project = yaml.safe_load((source / "project.yaml").read_text(encoding="utf-8"))
    project |= {key: str(source / project[key]) for key in FILES if key in project}
    project |= {"images": str(source / project["images"]), "output": str(folder / "out")}
    project |= changes
    project = {key: value for key, value in project.items() if value is not None}
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "project.yaml"
    path.write_text(yaml.safe_dump(project, sort_keys=False), encoding="utf-8")
    return path


def into_true_world(result: Result, truth: Truth) -> Floats:
    """Shift from a result's world into the truth's: their origins differ (data/README.md)."""
    origin, world = result.world.origin, truth["world"]
    assert origin is not None
    height = world["height_amsl_m"]
    offset = enu_from_geodetic(
        np.array([origin.latitude_deg]),
        np.array([origin.longitude_deg]),
        np.array([height]),
        (world["latitude_deg"], world["longitude_deg"], height),
    )[0]
    # Horizontally by latitude and longitude; heights are above each origin's own height.
    return np.array([offset[0], offset[1], origin.height_m - height])

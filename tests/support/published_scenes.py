"""Photos with surveyed truth, published with other people's programs: as projects to run."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pyproj import Transformer

from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result

NARRABEEN_ORIGIN = {"latitude_deg": -33.7299, "longitude_deg": 151.3006, "height_m": 2.475}


@dataclass(frozen=True)
class Published:
    """What stands beside the photos: points [m], pixels by photo, and the file itself."""

    folder: Path
    point: dict[str, Floats]
    pixels: dict[str, dict[str, list[float]]]
    control: dict[str, Any]


@dataclass(frozen=True)
class Targets(Published):
    """Such points in WGS 84 (latitude, longitude, height), and in local metres."""

    geodetic: dict[str, tuple[float, float, float]]
    world: dict[str, Floats]


def write_table(path: Path, header: str, rows: Sequence[Sequence[object]]) -> None:
    """A CSV file."""
    lines = [",".join(str(cell) for cell in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")


def write_project(
    folder: Path,
    camera: dict[str, Any],
    picks: Sequence[Sequence[object]],
    lines: Sequence[Sequence[object]],
    **content: object,
) -> Path:
    """A project in a folder; picks and lines are rows of their tables. Its path."""
    header = "image,label,u_px,v_px,height_m"[: None if len(picks[0]) == 5 else -9]
    write_table(folder / "picks.csv", header, picks)
    write_table(folder / "lines.csv", "name,from,to,length_m,sigma_m,use", lines)
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera), encoding="utf-8")
    files = {name: f"{name}.csv" for name in ("picks", "lines")} | {"camera": "camera.yaml"}
    path = folder / "project.yaml"
    path.write_text(yaml.safe_dump(files | content), encoding="utf-8")
    return path


def camera_file(
    size: tuple[int, int], parameters: Iterable[float], sigma: Iterable[float]
) -> dict[str, Any]:
    """What a camera.yaml holds."""
    return {
        "name": "published",
        "model": "brown",
        "width_px": size[0],
        "height_px": size[1],
        "parameters": [float(value) for value in parameters],
        "sigma": [float(value) for value in sigma],
    }


def published(folder: Path) -> Published:
    """What stands beside the photos: points [m], pixels by photo, and the file itself."""
    control = json.loads((folder / "control.json").read_text(encoding="utf-8"))
    point = {point["id"]: np.array(point["xyz"]) for point in control["points"]}
    pixels = {
        photo["file"].rpartition("/")[2]: {o["id"]: o["uv"] for o in photo["observations"]}
        for photo in control["photos"]
    }
    return Published(folder=folder, point=point, pixels=pixels, control=control)


def narrabeen_targets(folder: Path) -> Targets:
    """The four RTK targets in WGS 84 and in local metres, and their pixels by photo."""
    scene = published(folder)
    to_wgs84 = Transformer.from_crs("EPSG:28356", "EPSG:4326", always_xy=True)
    geodetic = {
        name: (*to_wgs84.transform(xyz[0], xyz[1])[::-1], xyz[2])
        for name, xyz in scene.point.items()
    }
    latitude, longitude, height = NARRABEEN_ORIGIN.values()
    world = {
        name: enu_from_geodetic(*place, origin=(latitude, longitude, height))
        for name, place in geodetic.items()
    }
    return Targets(**vars(scene), geodetic=geodetic, world=world)


def withheld(result: Result) -> tuple[Floats, Floats]:
    """Relative errors of the lengths that were not used, and their errors in sigmas."""
    lines = result.lines
    rows = [k for k, status in enumerate(lines.status) if status == "checked"]
    error = (lines.adjusted_m - lines.length_m)[rows]
    return error / lines.length_m[rows], error / lines.adjusted_sigma_m[rows]

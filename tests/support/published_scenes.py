"""Photos with surveyed truth, published with other people's programs: as projects to run."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import yaml
from pyproj import Transformer

from uavgram.geometry.earth.geodesy import enu_from_geodetic

NARRABEEN_ORIGIN = {"latitude_deg": -33.7299, "longitude_deg": 151.3006, "height_m": 2.475}


def write_table(path, header, rows) -> None:
    """A CSV file."""
    lines = [",".join(str(cell) for cell in row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n", encoding="utf-8")


def write_project(folder, camera, picks, lines, **content):
    """A project in a folder; picks and lines are rows of their tables. Its path."""
    header = "image,label,u_px,v_px,height_m"[: None if len(picks[0]) == 5 else -9]
    write_table(folder / "picks.csv", header, picks)
    write_table(folder / "lines.csv", "name,from,to,length_m,sigma_m,use", lines)
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera), encoding="utf-8")
    files = {name: f"{name}.csv" for name in ("picks", "lines")} | {"camera": "camera.yaml"}
    path = folder / "project.yaml"
    path.write_text(yaml.safe_dump(files | content), encoding="utf-8")
    return path


def camera_file(size, parameters, sigma):
    """What a camera.yaml holds."""
    return {
        "name": "published",
        "model": "brown",
        "width_px": size[0],
        "height_px": size[1],
        "parameters": [float(value) for value in parameters],
        "sigma": [float(value) for value in sigma],
    }


def published(folder):
    """What stands beside the photos: points [m], pixels by photo, and the file itself."""
    control = json.loads((folder / "control.json").read_text(encoding="utf-8"))
    point = {point["id"]: np.array(point["xyz"]) for point in control["points"]}
    pixels = {
        photo["file"].rpartition("/")[2]: {o["id"]: o["uv"] for o in photo["observations"]}
        for photo in control["photos"]
    }
    return SimpleNamespace(folder=folder, point=point, pixels=pixels, control=control)


def narrabeen_targets(folder):
    """The four RTK targets in WGS 84 and in local metres, and their pixels by photo."""
    scene = published(folder)
    to_wgs84 = Transformer.from_crs("EPSG:28356", "EPSG:4326", always_xy=True)
    scene.geodetic = {
        name: (*to_wgs84.transform(xyz[0], xyz[1])[::-1], xyz[2])
        for name, xyz in scene.point.items()
    }
    origin = tuple(NARRABEEN_ORIGIN.values())
    scene.world = {
        name: enu_from_geodetic(*place, origin) for name, place in scene.geodetic.items()
    }
    return scene


def withheld(result):
    """Relative errors of the lengths that were not used, and their errors in sigmas."""
    lines = result.lines
    rows = [k for k, status in enumerate(lines.status) if status == "checked"]
    error = (lines.adjusted_m - lines.length_m)[rows]
    return error / lines.length_m[rows], error / lines.adjusted_sigma_m[rows]

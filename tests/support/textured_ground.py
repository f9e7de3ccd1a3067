"""A small project whose photos are warped from one picture of flat ground, with known truth.

A car stands elsewhere in the last photo, and one label lies on stripes that repeat.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from csv_rows import read_rows
from place_only_scenes import PLACE, TO_EARTH

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

WIDTH_PX, HEIGHT_PX, FOCAL_PX = 480, 360, 400.0
ABOVE_M, METRES = 30.0, 0.075
"""Height of the flight, and size of a pixel of the ground's picture."""

HALF_M = 24.0
"""Half the side of the ground's picture."""

CENTERS = np.array([[-3.0, 0.0, ABOVE_M], [2.0, 3.0, 31.0], [4.0, -3.0, 29.5]])
HEADINGS_DEG = (10.0, 40.0, -25.0)
NAMES = ("a.png", "b.png", "c.png")

LABELS = {
    "P1": (-5.0, 2.0),
    "P2": (3.0, 5.0),
    "P3": (4.0, -4.0),
    "P4": (-2.0, -5.0),
    "P5": (0.5, 0.8),
    "P6": (7.0, 1.0),
}
STRIPE, CAR = (-1.0, 8.0), (2.0, -8.0)
"""A place on the stripes, and a corner of a thing on the car's roof."""

CAR_MOVED_M = np.array([0.35, 0.25])
PERIOD_M = 0.9


@dataclass(frozen=True)
class Textured:
    """A project file, and where its labels are in each photo: by (photo, label), (2,) pixels."""

    path: Path
    pixel_px: dict[tuple[str, str], Floats] = field(default_factory=dict)

    @property
    def picks(self) -> Path:
        """The table of picks."""
        return self.path.with_name("picks.csv")

    def rows(self) -> list[dict[str, str]]:
        """The table of picks, row by row."""
        return read_rows(self.picks)


def write_textured(folder: Path, *, extra: str = "", labels: tuple[str, ...] = ()) -> Textured:
    """Write the project: each label picked in the first photo, without noise.

    Parameters
    ----------
    folder
        Where.
    extra
        Text of more lines of project.yaml.
    labels
        Of `STRIPE` and `CAR` those to pick too.
    """
    places = {**LABELS, **{name: {"STRIPE": STRIPE, "CAR": CAR}[name] for name in labels}}
    project = Textured(folder / "project.yaml")
    for k, name in enumerate(NAMES):
        _write_photo(folder / name, k)
        for label, place in places.items():
            moved = CAR_MOVED_M if label == "CAR" and k == len(NAMES) - 1 else 0.0
            world = np.append(np.array(place) + moved, 0.0)
            project.pixel_px[name, label] = _pixel(k, world)
    first = NAMES[0]
    rows = [(first, label, *project.pixel_px[first, label].tolist()) for label in places]
    _table(project.picks, ("image", "label", "u_px", "v_px"), rows)
    ends = LABELS["P1"], LABELS["P2"], LABELS["P3"]
    lines = [
        ("L1", "P1", "P2", _length(ends[0], ends[1]), 0.01),
        ("L2", "P1", "P3", _length(ends[0], ends[2]), 0.01),
    ]
    _table(folder / "lines.csv", ("name", "from", "to", "length_m", "sigma_m"), lines)
    _write_poses(folder / "poses.csv")
    (folder / "camera.yaml").write_text(
        f"name: small\nmodel: brown\nwidth_px: {WIDTH_PX}\nheight_px: {HEIGHT_PX}\nparameters: "
        f"[{FOCAL_PX}, {FOCAL_PX}, {WIDTH_PX / 2}, {HEIGHT_PX / 2}, 0, 0, 0, 0, 0]\n"
        "sigma: [0.5, 0.5, 0.5, 0.5, 0, 0, 0, 0, 0]\n"
    )
    project.path.write_text(
        "name: textured\nimages: '*.png'\ncamera: camera.yaml\npicks: picks.csv\n"
        f"lines: lines.csv\noutput: out\nposes: poses.csv\nworld: {{heights: ellipsoid, origin: "
        f"{{latitude_deg: {PLACE[0]}, longitude_deg: {PLACE[1]}, height_m: {PLACE[2]}}}}}\n" + extra
    )
    return project


def _length(start: tuple[float, float], end: tuple[float, float]) -> float:
    return float(np.hypot(*np.subtract(start, end)))


def _table(path: Path, header: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> None:
    lines = [",".join(map(str, row)) for row in (header, *rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rotation(k: int) -> Floats:
    """World from camera of a photo that looks straight down, its top towards its heading."""
    turn = np.radians(HEADINGS_DEG[k])
    sine, cosine = np.sin(turn), np.cos(turn)
    return np.array([[cosine, -sine, 0.0], [-sine, -cosine, 0.0], [0.0, 0.0, -1.0]])


def _pixel(k: int, world: Floats) -> Floats:
    camera = _rotation(k).T @ (world - CENTERS[k])
    middle = np.array([WIDTH_PX / 2, HEIGHT_PX / 2])
    return np.asarray(FOCAL_PX * camera[:2] / camera[2] + middle)


def _write_poses(path: Path) -> None:
    """Places that are up to half a metre off, and headings by half a degree."""
    rng = np.random.default_rng(8)
    off = rng.uniform(-0.3, 0.3, (len(NAMES), 3))
    rows = []
    for k, name in enumerate(NAMES):
        longitude, latitude, height = TO_EARTH.transform(*(CENTERS[k] + off[k]))
        rows.append((name, latitude, longitude, height, HEADINGS_DEG[k] + 0.5, -90, 0, 0.4, 0.4, 1))
    header = "image,latitude_deg,longitude_deg,height_m,yaw_deg,pitch_deg,roll_deg"
    sigmas = "sigma_horizontal_m,sigma_vertical_m,sigma_attitude_deg"
    _table(path, (*header.split(","), *sigmas.split(",")), rows)


def _write_photo(path: Path, k: int) -> None:
    corners = np.array([[-HALF_M, HALF_M], [HALF_M, HALF_M], [HALF_M, -HALF_M], [-HALF_M, -HALF_M]])
    there = [_pixel(k, np.append(corner, 0.0)) for corner in corners]
    size = 2 * HALF_M / METRES
    here = np.array([[0.0, 0.0], [size, 0.0], [size, size], [0.0, size]]) - 0.5
    warp = cv2.getPerspectiveTransform(here.astype(np.float32), np.array(there, np.float32))
    moved = CAR_MOVED_M if k == len(NAMES) - 1 else np.zeros(2)
    photo = cv2.warpPerspective(_ground(moved), warp, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_CUBIC)
    noise = np.random.default_rng(90 + k).normal(0.0, 1.5, photo.shape)
    cv2.imwrite(str(path), np.clip(photo + noise, 0, 255).astype(np.uint8))


def _ground(car_moved_m: Floats) -> Image:
    """The ground from above, north up: noise of several sizes, stripes, and a car."""
    grey = _still_ground().copy()
    half = round(1.2 / METRES)
    car = cv2.GaussianBlur(_noise(2 * half), (0, 0), 0.125 / METRES)
    column = round((CAR[0] + car_moved_m[0] + HALF_M) / METRES) - half
    row = round((HALF_M - CAR[1] - car_moved_m[1]) / METRES) - half
    grey[row : row + 2 * half, column : column + 2 * half] = 150.0 + 35.0 * car / car.std()
    return np.clip(cv2.GaussianBlur(grey, (0, 0), 0.05 / METRES), 0, 255).astype(np.uint8)


@functools.cache
def _still_ground() -> Floats:
    size = int(2 * HALF_M / METRES)
    grey = np.full((size, size), 120.0)
    for grain_m, weight in ((0.15, 14.0), (0.4, 16.0), (1.5, 14.0)):
        noise = cv2.GaussianBlur(_noise(size), (0, 0), grain_m / METRES)
        grey += weight * noise / noise.std()
    middle = (np.arange(size) + 0.5) * METRES
    east, north = middle - HALF_M, HALF_M - middle
    striped = np.where(np.sin(2 * np.pi * east / PERIOD_M) > 0, 200.0, 70.0)
    band, wide = np.abs(north - STRIPE[1]) < 1.8, np.abs(east - STRIPE[0]) < 9.0
    grey[np.ix_(band, wide)] = striped[wide]
    return grey


def _noise(size: int) -> Floats:
    return np.random.default_rng(size).normal(size=(size, size))

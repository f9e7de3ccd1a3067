"""Project folders whose photos show kerbs of known position, with known truth; pixels by OpenCV."""

from __future__ import annotations

import csv
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import yaml
from scenes import cv_pixels, look_down

from uavgram.model.arrays import Bools, Floats

SIZE_PX = (2000, 1500)
LENS = np.array([1500.0, 1500.0, 999.5, 749.5, -0.05, 0.01, 0.0, 0.0, 0.0])
KERBS = (
    ((-16.0, -9.0), (15.0, -11.0)),
    ((-14.0, 10.0), (14.0, 8.0)),
    ((-12.0, -13.0), (-9.0, 13.0)),
    ((10.0, -12.0), (13.0, 12.0)),
    ((-10.0, -2.0), (9.0, 6.0)),
)
CHECKS = {"A": (-5.0, -6.0), "B": (6.0, 4.0), "C": (5.0, -7.0), "D": (-4.0, 5.0)}
SIGMA_M, PICK_PX, STRAIGHT_M = 0.01, 0.7, 0.005


@dataclass(frozen=True)
class Kerbs:
    """A project, and the true pose of each photo.

    Attributes
    ----------
    path
        The project file.
    center, rotation
        By photo, (3,) and (3, 3).
    """

    path: Path
    center: dict[str, Floats] = field(default_factory=dict)
    rotation: dict[str, Floats] = field(default_factory=dict)


def kerb_project(
    folder: Path,
    seed: int = 0,
    *,
    kerbs: int = 5,
    points: int = 2,
    photos: int = 1,
    heights: bool = False,
    shift: tuple[int, float] | None = None,
    noise: float = 1.0,
) -> Kerbs:
    """Write a project.

    Parameters
    ----------
    folder
        Empty.
    seed
        Of the draws.
    kerbs, points, photos
        How many; points on each kerb, the same in every photo.
    heights
        Whether the ends' heights are known.
    shift
        A kerb whose stated ends lie aside of the truth by so much [m].
    noise
        Factor of all errors.
    """
    rng = np.random.default_rng((19, seed))
    lines, picked = [], {}
    for k, ends in enumerate(np.array(KERBS[:kerbs])):
        away = ends[1] - ends[0]
        across = np.array([-away[1], away[0]]) / np.linalg.norm(away)
        share = np.sort(rng.uniform(0.05, 0.95, points))
        for j, t in enumerate(share):
            beside = across * STRAIGHT_M * noise * rng.normal()
            picked[f"k{k}p{j}"] = ends[0] + t * away + beside
        stated = ends + SIGMA_M * noise * rng.normal(size=(2, 2))
        if shift is not None and shift[0] == k:
            stated = stated + shift[1] * across
        up = SIGMA_M * noise * rng.normal(size=2)
        lines.append((k, stated, up))
    names = [f"k{k}p{j}" for k in range(kerbs) for j in range(points)]
    world = {name: np.array([*picked[name], 0.0]) for name in names}
    world |= {name: np.array([*place, 0.0]) for name, place in CHECKS.items()}
    made = Kerbs(folder / "project.yaml")
    rows = []
    for f in range(photos):
        image = f"photo{f}.jpg"
        rotation = look_down(rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 0.5))
        height = rng.uniform(28.0, 34.0)
        center = np.array([0.0, 0.0, height])
        center[:2] -= rotation[:2, 2] / -rotation[2, 2] * height
        made.center[image], made.rotation[image] = center, rotation
        pixel, _ = cv_pixels(LENS, center, rotation, np.array(list(world.values())))
        pixel = pixel + PICK_PX * noise * rng.normal(size=pixel.shape)
        inside: Bools = np.all((pixel > 0) & (pixel < np.array(SIZE_PX) - 1), axis=1)
        rows += [
            (image, name, *place)
            for name, place, seen in zip(world, pixel.tolist(), inside.tolist(), strict=True)
            if seen
        ]
        cv2.imwrite(str(folder / image), np.full(SIZE_PX[::-1], 120 + f, np.uint8))
    _table(folder / "picks.csv", ("image", "label", "u_px", "v_px"), rows)
    header = ["name", "points", "start_east_m", "start_north_m", "end_east_m", "end_north_m"]
    header += ["start_up_m", "end_up_m"] * heights + ["sigma_m"]
    _table(
        folder / "control_lines.csv",
        header,
        [
            (
                f"kerb {k}",
                ";".join(f"k{k}p{j}" for j in range(points)),
                *stated.ravel().tolist(),
                *(up.tolist() * heights),
                SIGMA_M,
            )
            for k, stated, up in lines
        ],
    )
    _table(
        folder / "check.csv",
        ("label", "east_m", "north_m", "up_m", "sigma_m"),
        [(name, *place, 0.0, 0.001) for name, place in CHECKS.items()],
    )
    _table(
        folder / "measure.csv",
        ("name", "kind", "points"),
        [("AB", "distance", "A;B"), ("CD", "distance", "C;D")],
    )
    camera = {
        "name": "camera",
        "model": "brown",
        "width_px": SIZE_PX[0],
        "height_px": SIZE_PX[1],
        "parameters": LENS.tolist(),
        "sigma": [0.5, 0.5, 0.5, 0.5, 1e-4, 1e-4, 1e-5, 1e-5, 1e-4],
    }
    (folder / "camera.yaml").write_text(yaml.safe_dump(camera), encoding="utf-8")
    project = {
        "images": "*.jpg",
        "camera": "camera.yaml",
        "picks": "picks.csv",
        "control_lines": "control_lines.csv",
        "check": "check.csv",
        "measure": "measure.csv",
        "picks_sigma_px": PICK_PX,
        "ground": {"height_sigma_m": 0.001, "slope_sigma_deg": 0.01},
    }
    made.path.write_text(yaml.safe_dump(project), encoding="utf-8")
    return made


def _table(path: Path, header: object, rows: list[tuple[object, ...]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)  # type: ignore[arg-type]
        writer.writerows(rows)

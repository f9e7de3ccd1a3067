"""A small project whose photo has round marks at known sub-pixel places."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats

WIDTH_PX, HEIGHT_PX = 2001, 1401  # odd on every level
BLOB_SIGMA_PX = 3.0
GROUND = 120.0  # well exposed: shown as it is
PLACES = np.array([[612.37, 433.81], [1403.62, 380.15], [999.5, 700.25], [480.9, 1010.44]])
TURNED_BY_90 = (  # a minimal EXIF segment: one tag, orientation 6
    b"\xff\xe1\x00\x22Exif\x00\x00MM\x00\x2a\x00\x00\x00\x08"
    b"\x00\x01\x01\x12\x00\x03\x00\x00\x00\x01\x00\x06\x00\x00\x00\x00\x00\x00"
)


@dataclass(frozen=True)
class PickingProject:
    """A project file, and where its photo's marks are: (N, 2) pixels."""

    path: Path
    marks_px: Floats


def marked_photo() -> Image:
    """Bright round marks on grey ground; their centres of gravity are where `PLACES` says."""
    v, u = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    grey = np.full((HEIGHT_PX, WIDTH_PX), GROUND)
    for u0, v0 in PLACES:
        grey += 130.0 * np.exp(-0.5 * ((u - u0) ** 2 + (v - v0) ** 2) / BLOB_SIGMA_PX**2)
    return np.repeat(np.round(grey).astype(np.uint8)[..., None], 3, axis=2)


def write_project(folder: Path, *, turned: bool = False) -> PickingProject:
    """Write a project without log, picks or lengths."""
    encoded = cv2.imencode(".jpg", marked_photo(), [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    if turned:
        encoded = encoded[:2] + TURNED_BY_90 + encoded[2:]
    (folder / "photo.jpg").write_bytes(encoded)
    (folder / "camera.yaml").write_text(
        f"name: test\nmodel: brown\nwidth_px: {WIDTH_PX}\nheight_px: {HEIGHT_PX}\n"
        f"parameters: [1500.0, 1500.0, {WIDTH_PX / 2}, {HEIGHT_PX / 2}, 0, 0, 0, 0, 0]\n"
        "sigma: [1.0, 1.0, 1.0, 1.0, 0, 0, 0, 0, 0]\n"
    )
    project = folder / "project.yaml"
    project.write_text(
        "name: planted\nimages: photo.jpg\ncamera: camera.yaml\npicks: picks.csv\n"
        "lines: lines.csv\nmeasure: measure.csv\n"
    )
    return PickingProject(project, PLACES)

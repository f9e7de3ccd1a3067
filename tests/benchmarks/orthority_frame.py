"""One frame rectified by orthority, in its own environment; prints the seconds that it
took, and those of processor time.

    python orthority_frame.py JOB.json OUTPUT.tif

The job holds the photo, size_px, intrinsics (OpenCV's order), centre and rotation in the map's
axes, height of the ground, pixel_m, crs, and options of the output. Reading the parameters and
loading the modules is not timed; making the camera, reading the (flat) elevation model, decoding
the photo, warping, and writing with overviews is.
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from orthority.camera import OpenCVCamera
from orthority.ortho import Ortho
from rasterio.transform import from_origin

TO_PATB = np.diag([1.0, -1.0, -1.0])


def angles(world_from_camera: np.ndarray) -> tuple[float, float, float]:
    """Omega, phi, kappa of Rx(omega) Ry(phi) Rz(kappa), camera in the PATB convention."""
    r = world_from_camera @ TO_PATB
    return (
        float(np.arctan2(-r[1, 2], r[2, 2])),
        float(np.arcsin(r[0, 2])),
        float(np.arctan2(-r[0, 1], r[0, 0])),
    )


def flat_ground(job: dict[str, Any], path: Path) -> None:
    """An elevation model of two metres' step around the camera."""
    reach, step = 400.0, 2.0
    size = int(2 * reach / step)
    profile = {
        "driver": "GTiff", "count": 1, "dtype": "float32", "width": size, "height": size,
        "crs": job["crs"],
        "transform": from_origin(job["center"][0] - reach, job["center"][1] + reach, step, step),
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as file:
        file.write(np.full((1, size, size), job["ground_m"], np.float32))


def main(job_path: str, output: str) -> None:
    """Rectify and print seconds."""
    job = json.loads(Path(job_path).read_text(encoding="utf-8"))
    warnings.simplefilter("ignore")
    ground = Path(output).with_suffix(".dem.tif")
    flat_ground(job, ground)
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = job["intrinsics"]
    size = np.array(job["size_px"])
    offset = (np.array([cx, cy]) - (size - 1) / 2) / size.max()
    started, busy = time.perf_counter(), time.process_time()
    camera = OpenCVCamera(
        tuple(job["size_px"]), (fx, fy), tuple(job["size_px"]), *offset, k1, k2, k3, p1, p2,
        xyz=tuple(job["center"]), opk=angles(np.array(job["rotation"])),
    )  # fmt: skip
    ortho = Ortho(job["photo"], str(ground), camera, job["crs"])
    ortho.process(
        output,
        resolution=(job["pixel_m"],) * 2,
        interp="bilinear",
        overwrite=True,
        write_mask=False,
        **job["output"],
    )
    print(time.perf_counter() - started, time.process_time() - busy)


if __name__ == "__main__":
    main(*sys.argv[1:])

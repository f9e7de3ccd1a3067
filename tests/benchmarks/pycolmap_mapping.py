"""pycolmap's incremental mapping of a folder of photos; run by a Python that has it.

    PYTHON pycolmap_mapping.py PHOTOS CAMERA OUT

CAMERA is our camera file; its interior orientation is given to pycolmap and held. Everything else
is pycolmap's default: SIFT, every pair of photos, incremental mapping. OUT gets the poses and
points of the largest model, with what the whole took.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pycolmap


def main() -> None:
    photos, camera_file, out = (Path(given) for given in sys.argv[1:])
    camera = json.loads(camera_file.read_text())
    lens = list(camera["parameters"])
    if camera["model"] != "brown" or lens[8] != 0:
        sys.exit("OPENCV has eight parameters: the third radial one must be zero")
    # COLMAP has the middle of the first pixel at 0.5.
    lens[2:4] = [lens[2] + 0.5, lens[3] + 0.5]
    reader = pycolmap.ImageReaderOptions(
        camera_model="OPENCV", camera_params=",".join(map(repr, lens[:8]))
    )
    rules = pycolmap.IncrementalPipelineOptions(
        ba_refine_focal_length=False, ba_refine_principal_point=False, ba_refine_extra_params=False
    )
    rules.mapper.abs_pose_refine_focal_length = False
    rules.mapper.abs_pose_refine_extra_params = False
    single, device = pycolmap.CameraMode.SINGLE, pycolmap.Device.cpu
    start = time.perf_counter()
    with TemporaryDirectory(prefix="colmap") as folder:
        base = Path(folder) / "base.db"
        pycolmap.extract_features(
            base, photos, camera_mode=single, reader_options=reader, device=device
        )
        pycolmap.match_exhaustive(base, device=device)
        models = pycolmap.incremental_mapping(base, photos, Path(folder), options=rules)
    spent = {"wall_s": time.perf_counter() - start, "cpu_s": sum(os.times()[:4])}
    out.write_text(json.dumps(_largest(models) | spent | {"memory_mb": _memory_mb()}))


def _largest(models: dict[int, Any]) -> dict[str, Any]:
    """Poses by photo and points of the model with most photos."""
    poses: dict[str, Any] = {}
    points: list[list[float]] = []
    if models:
        model = max(models.values(), key=lambda each: int(each.num_reg_images()))
        for image in model.images.values():
            if image.has_pose:
                turn = image.cam_from_world().rotation.matrix()
                poses[image.name] = [image.projection_center().tolist(), turn.T.tolist()]
        points = [point.xyz.tolist() for point in model.points3D.values()]
    return {"poses": poses, "points": points, "models": len(models)}


def _memory_mb() -> float:
    """The most memory that this process had."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


if __name__ == "__main__":
    main()

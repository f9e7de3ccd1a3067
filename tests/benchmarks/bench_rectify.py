"""One frame rectified, side by side with orthority in one run.

    python tests/benchmarks/bench_rectify.py PROJECT.yaml FRAME ORTHORITY_PYTHON

ORTHORITY_PYTHON (or the environment's ORTHORITY_PYTHON) is the Python of an environment that holds
orthority 0.7. Both take the same photo, pose, lens, flat ground, pixel size and bilinear
interpolation, on all cores, and write a tiled GeoTIFF with overviews: this program red, green, blue
and opacity; orthority red, green and blue, once with this program's DEFLATE options (level 1, with
predictor) and once with its own DEFLATE. Timed is the rectification: photo file to GeoTIFF, without
adjusting and without loading modules (orthority has no pose to adjust). The whole command, which
also reads every input, adjusts, and writes the map of sigmas and the sheet, is said beside it, and
so is orthority's whole process.

Rounds go in turn, so that what else the machine does falls on both alike; ratios are medians of
neighbouring runs, of the clock and of processor time. The two pictures are compared too: places
apart, and grey values. Demanded: at least ten times as fast.

The pictures of a survey lie apart, by half a pixel and more, and it is nobody's half pixel: both
programs put (0, 0) of a photo into the middle of its first pixel, and both sample the middle of a
pixel of the map; orthority's camera and OpenCV's agree to 1e-12 px. What orthority does not have is
a ground that slopes and a shutter that rolls. So it is said where each program takes places of the
ground from, in the photo: orthority with flat ground and one pose; with the height of each place,
which leaves the shutter; and with both taken from our own survey too (`plain`), which leaves
nothing but the map's scale. The pictures that are compared are of that plain survey.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import rasterio
from rasterio.warp import Resampling, reproject

from uavgram.geometry.geodesy import projected_from_enu
from uavgram.geometry.ground.top_view import View
from uavgram.io.exports.geotiff import write_colour_geotiff
from uavgram.io.files import photo_files
from uavgram.model.maps import GroundRaster
from uavgram.pipeline.ground_picture import warp_windows
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.stages.products.top_view import choose_view, lay_raster

HERE = Path(__file__).parent
ROUNDS, DEMAND = 5, 10.0
BLAS = "OPENBLAS_NUM_THREADS"
OUTPUTS: dict[str, dict[str, object]] = {
    "the same DEFLATE": {
        "creation_options": {
            "tiled": True, "blockxsize": 256, "blockysize": 256, "compress": "deflate", "zlevel": 1,
            "predictor": 2, "num_threads": "all_cpus", "photometric": "rgb",
        }
    },
    "its own DEFLATE": {"compress": "deflate"},
}  # fmt: skip


def job_for(view: View, raster: GroundRaster) -> dict[str, object]:
    """What orthority needs: the pose in the map's axes, which turn and stretch at the camera."""
    result, row = view.result, view.rows[0]
    center = result.frames.refined.center_world_m[row]
    steps = np.concatenate([center[None], center + np.eye(3)])
    assert view.origin is not None
    assert raster.crs is not None
    placed = projected_from_enu(steps, view.origin, raster.crs)
    u, _, vt = np.linalg.svd((placed[1:] - placed[0]).T)
    ground = projected_from_enu(
        np.append(result.plane.pivot_m, result.plane.height_m.value)[None],
        view.origin,
        raster.crs,
    )
    return {
        "photo": photo_files(result.frames)[row],
        "size_px": [result.camera.width_px, result.camera.height_px],
        "intrinsics": result.shared.intrinsics.value.tolist(),
        "center": placed[0].tolist(),
        "rotation": (u @ vt @ result.frames.refined.world_from_camera[row]).tolist(),
        "ground_m": float(ground[0, 2]),
        "pixel_m": raster.pixel_m,
        "crs": raster.crs,
    }


class Took(NamedTuple):
    """Seconds of a rectification, of processor time in it, and of the process around it."""

    clock: float
    processor: float
    process: float


def ours(view: View, pixel_m: float, path: Path) -> Took:
    """From photo file to GeoTIFF."""
    started, busy = time.perf_counter(), time.process_time()
    raster = lay_raster(view, pixel_m)
    write_colour_geotiff(raster, warp_windows(view, raster), {}, path)
    return Took(time.perf_counter() - started, time.process_time() - busy, np.nan)


def peer(python: str, job: dict[str, object], path: Path) -> Took:
    """The same by orthority."""
    written = path.with_suffix(".json")
    written.write_text(json.dumps(job), encoding="utf-8")
    started = time.perf_counter()
    command = [python, str(HERE / "orthority_frame.py"), str(written), str(path)]
    environment = {name: value for name, value in os.environ.items() if name != BLAS}
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    clock, processor = map(float, done.stdout.split()[-2:])
    return Took(clock, processor, time.perf_counter() - started)


def plain(view: View) -> View:
    """The same photo over level ground, all of its rows taken at one moment."""
    result = view.result
    frames = replace(result.frames, sweep=np.zeros_like(result.frames.sweep))
    level = replace(result.plane.slope_deg, value=np.zeros(2))
    areas = (replace(result.plane, slope_deg=level), *result.areas[1:])
    return replace(view, result=replace(result, areas=areas, frames=frames))


def places_apart(view: View, raster: GroundRaster, job: dict[str, object]) -> str:
    """Where orthority takes places of the ground from in the photo, minus where we do [px]."""
    share = np.linspace(0.25, 0.75, 9)
    columns, rows = share * raster.width, share * raster.height
    ground = view.ground(raster, columns, rows)
    assert view.origin is not None
    assert raster.crs is not None
    placed = projected_from_enu(ground.reshape(-1, 3), view.origin, raster.crs)
    fx, fy, cx, cy, *lens = np.array(job["intrinsics"])
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    own = view.look(0, ground)[0].reshape(-1, 2)
    told = []
    flat = np.full(len(placed), job["ground_m"])
    for name, height in (("flat", flat), ("true height", placed[:, 2])):
        places = np.column_stack([placed[:, :2], height])
        seen = (places - job["center"]) @ np.array(job["rotation"])
        # as orthority's camera does it, to 1e-12 px
        theirs, _ = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), matrix, np.array(lens))
        off = theirs[:, 0] - own
        u, v = off.mean(axis=0)
        told.append(f"{name}: {u:+.2f} {v:+.2f} in the mean, {np.hypot(*off.T).max():.2f} at most")
    return "; ".join(told)


def apart(first: Path, second: Path) -> tuple[float, float]:
    """Shift between two pictures of the same ground [px], and median difference of grey."""
    with rasterio.open(first) as file:
        grey = file.read([1, 2, 3]).mean(axis=0, dtype=np.float32)
        place = {"dst_transform": file.transform, "dst_crs": file.crs}
    other = np.zeros_like(grey)
    with rasterio.open(second) as file:
        source = file.read([1, 2, 3]).mean(axis=0, dtype=np.float32)
        reproject(
            source, other, src_transform=file.transform, src_crs=file.crs,
            resampling=Resampling.bilinear, **place,
        )  # fmt: skip
    middle = np.s_[
        grey.shape[0] // 4 : -grey.shape[0] // 4, grey.shape[1] // 4 : -grey.shape[1] // 4
    ]
    one, two = np.ascontiguousarray(grey[middle]), np.ascontiguousarray(other[middle])
    shift, _ = cv2.phaseCorrelate(one, two)
    return float(np.hypot(shift[0], shift[1])), float(np.median(np.abs(one - two)))


def main(project: str, frame: str, python: str | None) -> int:
    """Print seconds and ratios; status 1 where the demand is not met."""
    if python is None or not Path(python).is_file():
        print("skipped: name the Python of an environment with orthority (ORTHORITY_PYTHON)")
        return 0
    view = choose_view(compute(read_inputs(Path(project)), curved=False).result, frame)
    raster = lay_raster(view)
    job = job_for(view, raster)
    for name, one in (("the survey", view), ("plain", plain(view))):
        print(
            f"orthority minus uavgram, {name} [px of the photo]: {places_apart(one, raster, job)}"
        )
    print(
        f"{raster.width} x {raster.height} pixels of {raster.pixel_m:g} m, {os.cpu_count()} cores"
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        mine, other = folder / "ours.tif", folder / "peer.tif"
        ratio = np.inf
        for name, output in OUTPUTS.items():
            rounds = [
                (ours(view, raster.pixel_m, mine), peer(python, job | {"output": output}, other))
                for _ in range(ROUNDS)
            ]
            took = np.array(rounds)
            ratios = np.median(took[:, 1] / took[:, 0], axis=0)
            ratio = min(ratio, ratios[0])
            (own, busy, _), (clock, peer_busy, process) = np.median(took, axis=0)
            sizes = [path.stat().st_size / 1e6 for path in (mine, other)]
            ours(plain(view), raster.pixel_m, mine)
            shift, grey = apart(mine, other)
            print(
                f"orthority with {name}: {clock:.2f} s (processor {peer_busy:.2f} s, process "
                f"{process:.2f} s), uavgram {own:.2f} s (processor {busy:.2f} s): "
                f"{ratios[0]:.1f} times, {ratios[1]:.1f} in processor time; "
                f"{sizes[1]:.1f} and {sizes[0]:.1f} MB; {shift:.3f} px apart, grey {grey:.2f}"
            )
        command = [sys.executable, "-m", "uavgram", "rectify", project, "--frame", frame]
        started = time.perf_counter()
        subprocess.run([*command, "--output", str(folder / "out")], check=True, capture_output=True)
        whole = time.perf_counter() - started
    print(f"the whole command: uavgram {whole:.2f} s (inputs, adjustment, sigmas, sheet)")
    return int(ratio < DEMAND)


if __name__ == "__main__":
    if BLAS not in os.environ:  # as the command does, before NumPy is loaded
        os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | {BLAS: "1"})  # noqa: S606
    chosen = sys.argv[3] if len(sys.argv) > 3 else os.environ.get("ORTHORITY_PYTHON")
    sys.exit(main(sys.argv[1], sys.argv[2], chosen))

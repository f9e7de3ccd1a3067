"""Time and size of every export of a large survey.

    python tests/benchmarks/bench_exports.py [FRAMES] [POINTS]

A made-up result of FRAMES (5000) frames and POINTS (20000) points, each picked in five of them,
with a measured distance for every tenth point.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

import synthetic_survey

from uavgram.geometry.geodesy import utm_crs
from uavgram.model.result.result import Result
from uavgram.model.result.tables import FrameResults, PickResults, PickStatus, PoseTable
from uavgram.pipeline.measure.exports import make_writers

PICKS_A_POINT = 5

USED: PickStatus = "used"


def large(frames: int, points: int) -> Result:
    """A result of that size."""
    measures: tuple[synthetic_survey.Measure, ...] = tuple(
        (f"d{k}", "distance", (f"P{k:02d}", f"P{k + 1:02d}"), "m") for k in range(0, points - 1, 10)
    )
    base = synthetic_survey.build(
        frame_count=20, point_count=points, measures=measures, clean=False
    )
    rng = np.random.default_rng(1)
    row = np.arange(frames) % 20
    names = tuple(f"DSC_{k:05d}.jpg" for k in range(frames))
    shift = np.stack([70.0 * (np.arange(frames) // 20), np.zeros(frames), np.zeros(frames)], 1)

    def table(poses: PoseTable) -> PoseTable:
        return PoseTable(
            center_world_m=poses.center_world_m[row] + shift,
            world_from_camera=poses.world_from_camera[row],
            covariance=poses.covariance[row],
        )

    old = base.frames
    made = FrameResults(
        frame_id=names,
        path=names,
        time_utc_s=old.time_utc_s[row],
        status=tuple(old.status[k] for k in row),
        reason=tuple(old.reason[k] for k in row),
        seed=table(old.seed),
        refined=table(old.refined),
    )
    count = PICKS_A_POINT * points
    image = rng.integers(0, frames, count)
    none = np.full(count, 0.5)
    picks = PickResults(
        image=tuple(names[k] for k in image),
        label=tuple(np.repeat(base.points.label, PICKS_A_POINT).tolist()),
        pixel_px=rng.uniform(0, 1000, (count, 2)),
        residual_px=rng.normal(0, 0.7, (count, 2)),
        w=none,
        redundancy=none,
        status=(USED,) * count,
        sigma_px=none,
    )
    assert base.world.origin is not None
    crs = utm_crs(base.world.origin.latitude_deg, base.world.origin.longitude_deg)
    return replace(base, frames=made, picks=picks, world=replace(base.world, crs=crs))


def main(frames: int, points: int) -> int:
    """Print seconds and megabytes of each."""
    result = large(frames, points)
    started = time.perf_counter()
    writers = make_writers(result)
    print(f"{'layers':28s} {time.perf_counter() - started:7.2f} s")
    with tempfile.TemporaryDirectory() as scratch:
        for name, write in writers.items():
            path = Path(scratch) / name
            path.parent.mkdir(exist_ok=True)
            started, busy = time.perf_counter(), time.process_time()
            write(path)
            took, cpu = time.perf_counter() - started, time.process_time() - busy
            files = [path] if path.is_file() else list(path.rglob("*"))
            size = sum(file.stat().st_size for file in files) / 1e6
            print(f"{name:28s} {took:7.2f} s {cpu:7.2f} s of processor {size:8.1f} MB")
    print(f"peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3:.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main(*(int(a) for a in [*sys.argv[1:], *("5000", "20000")[len(sys.argv) - 1 :]])))

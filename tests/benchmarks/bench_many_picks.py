"""How long `uavgram check` takes for a table of many picks: seconds of processor time and memory.

python tests/benchmarks/bench_many_picks.py [picks] [photos]
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

from uavgram.pipeline.check import check

WIDTH_PX, HEIGHT_PX = 64, 48


def write(folder: Path, picks: int, photos: int) -> Path:
    rng = np.random.default_rng(0)
    with (folder / "picks.csv").open("w", encoding="utf-8") as file:
        file.write("image,label,u_px,v_px,sigma_px,height_m\n")
        for k in range(photos):
            name = f"p{k:05d}.jpg"
            grey = np.full((HEIGHT_PX, WIDTH_PX), k % 250, np.uint8)
            grey[k % HEIGHT_PX, k // HEIGHT_PX % WIDTH_PX] = 255
            (folder / name).write_bytes(cv2.imencode(".jpg", grey)[1].tobytes())
            places = rng.uniform(0, [WIDTH_PX - 1, HEIGHT_PX - 1], (picks // photos, 2)).round(3)
            file.writelines(
                f"{name},L{7 * k + j},{u},{v},0.7,\n" for j, (u, v) in enumerate(places.tolist())
            )
    (folder / "camera.yaml").write_text(
        f"name: t\nmodel: brown\nwidth_px: {WIDTH_PX}\nheight_px: {HEIGHT_PX}\n"
        "parameters: [60, 60, 32, 24, 0, 0, 0, 0, 0]\nsigma: [1, 1, 1, 1, 0, 0, 0, 0, 0]\n"
    )
    project = folder / "project.yaml"
    project.write_text("images: '*.jpg'\ncamera: camera.yaml\npicks: picks.csv\n")
    return project


def main() -> None:
    picks, photos = (*map(int, sys.argv[1:3]), *(1_000_000, 100)[len(sys.argv) - 1 :])
    with tempfile.TemporaryDirectory() as folder:
        project = write(Path(folder), picks, photos)
        started = time.process_time()
        check(project)
        seconds = time.process_time() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{picks} picks in {photos} photos: {seconds:.1f} s of processor time, {peak:.0f} MB")


if __name__ == "__main__":
    main()

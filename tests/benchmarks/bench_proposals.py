"""A click on the picking page: how soon the same point is proposed in ten other photos.

python tests/benchmarks/bench_proposals.py [MEGAPIXELS [PHOTOS]]

Photos of level ground, warped from one picture. Prints the time from a click (its message) to the
last proposal, before the photos are decoded and afterwards; exit status 1 where the bar is missed.
Wants a quiet machine with two cores.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from open_projects import change, opened

from uavgram.imaging.raster import Image
from uavgram.model.arrays import Floats
from uavgram.picking.session.project import OpenProject

BAR_S, CLICKS, LONGEST_WAIT_S = 0.3, 12, 60.0
HEIGHT_M, APART_M, ACROSS_M = 40.0, 0.6, 53.3
"""Of the flight; from photo to photo; width of the ground that one shows."""

Json = dict[str, Any]
LABELS = 8


def textured(size: int) -> Image:
    """Ground with texture of all sizes from two pixels on."""
    rng = np.random.default_rng(5)
    picture = np.full((size, size), 110.0, np.float32)
    cells, contrast = size // 2, 14.0
    while cells > 8:
        coarse = rng.normal(0, contrast, (cells, cells)).astype(np.float32)
        picture += cv2.resize(coarse, (size, size), interpolation=cv2.INTER_LINEAR)
        cells //= 3
    return np.clip(picture, 0, 255).astype(np.uint8)


def write_flight(folder: Path, megapixels: float, photos: int) -> tuple[Path, Floats]:
    """Write the project; its file, and the pixels (CLICKS, 2) to click in the first photo."""
    width = round(np.sqrt(megapixels * 1e6 * 4 / 3))
    height = round(width * 3 / 4)
    focal = width * HEIGHT_M / ACROSS_M
    per_px, rng = HEIGHT_M / focal, np.random.default_rng(6)
    ground_px = round(1.3 * width)
    ground = textured(ground_px)
    middle = (np.array([width, height]) - 1) / 2
    place = rng.uniform(-0.35, 0.35, (LABELS + CLICKS, 2)) * height * per_px
    rows = ["image,label,u_px,v_px"]
    for k in range(photos):
        center = np.array([APART_M * (k - photos / 2), 0.8 * np.sin(k)])
        turn, scale = 0.02 * np.sin(2.0 * k), 1.0 + 0.01 * np.cos(k)
        from_ground = scale * np.array(
            [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        )
        # Ground pixel g shows the place (g - middle of the ground) per_px metres.
        offset = middle - from_ground @ (center / per_px + (ground_px - 1) / 2)
        photo = cv2.warpAffine(ground, np.column_stack([from_ground, offset]), (width, height))
        noisy = photo.astype(np.int16) + rng.integers(-3, 4, photo.shape, np.int16)
        name = f"photo{k:02d}.jpg"
        cv2.imwrite(str(folder / name), np.clip(noisy, 0, 255).astype(np.uint8))
        pixel = (place / per_px + (ground_px - 1) / 2) @ from_ground.T + offset
        if k == 0:
            clicks = pixel[LABELS:]
        picked = pixel[:LABELS] + rng.normal(0, 0.5, (LABELS, 2))
        rows += [f"{name},R{i + 1},{u:.3f},{v:.3f}" for i, (u, v) in enumerate(picked)]
    (folder / "picks.csv").write_text("\n".join(rows) + "\n")
    lines = ["name,from,to,length_m,sigma_m"]
    for i in range(0, LABELS, 2):
        length = np.linalg.norm(place[i] - place[i + 1])
        lines.append(f"L{i},R{i + 1},R{i + 2},{length:.4f},0.01")
    (folder / "lines.csv").write_text("\n".join(lines) + "\n")
    (folder / "measure.csv").write_text("name,kind,points\n")
    (folder / "camera.yaml").write_text(
        f"name: bench\nmodel: brown\nwidth_px: {width}\nheight_px: {height}\n"
        f"parameters: [{focal}, {focal}, {middle[0]}, {middle[1]}, 0, 0, 0, 0, 0]\n"
        "sigma: [6.0, 6.0, 6.0, 6.0, 0.001, 0.001, 0.0001, 0.0001, 0.0005]\n"
    )
    project = folder / "project.yaml"
    project.write_text(
        "name: bench\nimages: photo*.jpg\ncamera: camera.yaml\npicks: picks.csv\n"
        "lines: lines.csv\nmeasure: measure.csv\n"
    )
    return project, clicks


def clicked(project: OpenProject, sent: list[Json], label: str, pixel: Floats) -> tuple[float, int]:
    """Seconds from a click to the last proposal of its label, and how many there are."""
    sent.clear()
    begun = time.perf_counter()
    change(project, "place", image=0, label=label, u_px=float(pixel[0]), v_px=float(pixel[1]))
    others = len(project.picking.photos) - 1
    while time.perf_counter() - begun < LONGEST_WAIT_S:
        for message in list(sent):
            if message["t"] == "proposals" and label in message["labels"]:
                found, asked = len(message["found"]), len(message["asked"])
                if found + asked >= others:
                    return time.perf_counter() - begun, found
        time.sleep(0.001)
    raise TimeoutError(f"{label} was not sought everywhere")


def main(megapixels: float, photos: int) -> int:
    """Print the times; whether the bar is missed."""
    with tempfile.TemporaryDirectory() as folder:
        path, clicks = write_flight(Path(folder), megapixels, photos)
        with opened(path) as (project, sent):
            picking = project.picking
            picking.open()
            while not any(message["t"] == "live" for message in list(sent)):
                time.sleep(0.01)
            cold, found = clicked(project, sent, "C0", clicks[0])
            print(f"{photos - 1} photos of {megapixels:g} MP, {found} found")
            print(f"first click, photos not decoded: {cold:.2f} s")
            picking.show("bench", (0,))
            time.sleep(2.0)
            took = []
            for k, pixel in enumerate(clicks[1:], 1):
                seconds, found = clicked(project, sent, f"C{k}", pixel)
                took.append(seconds)
                print(f"  click {k}: {seconds:.3f} s, {found} of {photos - 1} found")
                time.sleep(1.0)  # as a person does
            project.picking.stop()
    median = statistics.median(took)
    print(f"decoded beforehand: median {median:.3f} s, longest {max(took):.3f} s, bar {BAR_S} s")
    return int(median > BAR_S)


if __name__ == "__main__":
    given = [float(text) for text in sys.argv[1:]]
    sys.exit(main(given[0] if given else 12.0, int(given[1]) if len(given) > 1 else 11))

"""A project of large photos with many picks: what the picking page must carry with ease."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

FOCAL_PX, HEIGHT_M = 6000.0, 30.0


def write_large_project(
    folder: Path, width_px: int = 8000, height_px: int = 6000, labels: int = 100, photos: int = 2
) -> Path:
    """Nadir photos of level ground with texture; every label is picked in the first two."""
    rng = np.random.default_rng(7)
    half_m = np.array([width_px, height_px]) * HEIGHT_M / FOCAL_PX / 2
    point = rng.uniform(-0.8, 0.8, (labels, 2)) * half_m
    rows = ["image,label,u_px,v_px,sigma_px"]
    for k, shift in enumerate((-0.05, 0.05)):
        name = f"photo{k}.jpg"
        coarse = rng.integers(60, 190, (height_px // 16, width_px // 16, 3), np.uint8)
        fine = cv2.resize(coarse, (width_px, height_px), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(folder / name), fine, [cv2.IMWRITE_JPEG_QUALITY, 90])
        from_camera = point - np.array([shift * half_m[0], 0.0])
        pixel = np.array([1.0, -1.0]) * from_camera * FOCAL_PX / HEIGHT_M
        pixel += (np.array([width_px, height_px]) - 1) / 2 + rng.normal(0, 0.5, pixel.shape)
        rows += [f"{name},P{i + 1},{u:.3f},{v:.3f},0.5" for i, (u, v) in enumerate(pixel)]
    again = (folder / "photo1.jpg").read_bytes()
    for k in range(2, photos):  # the same picture, in another file
        (folder / f"photo{k}.jpg").write_bytes(again + bytes(k))
    (folder / "picks.csv").write_text("\n".join(rows) + "\n")
    lines = ["name,from,to,length_m,sigma_m"]
    for i in range(0, 16, 2):
        length = np.linalg.norm(point[i] - point[i + 1]) + rng.normal(0, 0.005)
        lines.append(f"L{i},P{i + 1},P{i + 2},{length:.4f},0.005")
    (folder / "lines.csv").write_text("\n".join(lines) + "\n")
    (folder / "measure.csv").write_text(
        "name,kind,points\n" + "".join(f"D{i},distance,P{i};P{i + 1}\n" for i in range(1, 21))
    )
    center = f"{(width_px - 1) / 2}, {(height_px - 1) / 2}"
    (folder / "camera.yaml").write_text(
        f"name: large\nmodel: brown\nwidth_px: {width_px}\nheight_px: {height_px}\n"
        f"parameters: [{FOCAL_PX}, {FOCAL_PX}, {center}, 0, 0, 0, 0, 0]\n"
        "sigma: [6.0, 6.0, 6.0, 6.0, 0.001, 0.001, 0.0001, 0.0001, 0.0005]\n"
    )
    project = folder / "project.yaml"
    project.write_text(
        "name: large\nimages: photo*.jpg\ncamera: camera.yaml\npicks: picks.csv\n"
        "lines: lines.csv\nmeasure: measure.csv\n"
    )
    return project

"""Ground of a street that is picked in two photos is found in all others."""

from __future__ import annotations

import csv
import json
import random
import shutil
from pathlib import Path

import numpy as np

from uavgram.cli import main

STREET, SIZE_PX, MARGIN_PX = "street_oblique", (2400, 1800), 12
"""Name of the street; size of its photos, and least distance of a pick from their edges."""

CLICK_PX = 0.0
"""Sigma of a click."""

SEED = "street_obliqueground234"
"""Choice of photos with which unknown heights, from first values, went to 25 m."""


def test_ground_in_two_photos_each_is_found_in_the_others(data_dir: Path, tmp_path: Path) -> None:
    folder = tmp_path / STREET
    shutil.copytree(data_dir / STREET, folder, copy_function=shutil.copyfile)
    shown: dict[str, list[tuple[str, float, float]]] = {}
    truth = json.loads((data_dir / "truth" / f"{STREET}.json").read_text(encoding="utf-8"))
    for image, labels in truth["pixels"].items():
        for label, (u, v, is_visible) in labels.items():
            place = np.array([u, v])
            inside = (place > MARGIN_PX) & (place < np.array(SIZE_PX) - MARGIN_PX)
            if is_visible and inside.all() and label[0] in "PR":
                shown.setdefault(label, []).append((image, u, v))
    chosen = random.Random(SEED)  # noqa: S311 - no secret
    rows = []
    for label in sorted(shown):
        for image, *clicked in chosen.sample(shown[label], min(2, len(shown[label]))):
            u, v = (each + chosen.gauss(0.0, CLICK_PX) for each in clicked)
            rows.append(f"{image},{label},{u:.3f},{v:.3f},0.8,")
    table = folder / "picks.csv"
    header = "image,label,u_px,v_px,sigma_px,height_m"
    table.write_text("\n".join([header, *sorted(rows), ""]), encoding="utf-8")

    assert main(["picks", "match", str(folder)]) == 0

    with table.open(encoding="utf-8", newline="") as file:
        found = [row for row in csv.DictReader(file) if row["source"] == "match"]
    off_px = [
        np.hypot(float(row["u_px"]) - u, float(row["v_px"]) - v)
        for row in found
        for u, v, _ in (truth["pixels"][row["image"]][row["label"]],)
    ]
    assert len(found) > 140
    assert max(off_px) < 3.0

"""Ground of a street that is picked in one photo or two is found in all others."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from csv_rows import read_rows

from uavgram.cli import main

STREET, SIZE_PX, MARGIN_PX = "street_oblique", (2400, 1800), 12
"""Name of the street; size of its photos, and least distance of a pick from their edges."""


class Clicks(NamedTuple):
    """Choice of photos with which unknown heights, from first values, went to 25 m.

    Attributes
    ----------
    seed, kinds
        The choice, and first letters of the picked labels: P and R are on the ground.
    photos, sigma_px
        Photos in which each label is clicked, and sigma of a click.
    least, most_px
        Least number of finds on the ground, and largest error of one.
    """

    seed: str
    kinds: str
    photos: int
    sigma_px: float
    least: int
    most_px: float


TWICE = Clicks("street_obliqueground234", "PR", 2, 0.0, 141, 3.0)
ONCE = Clicks("street_obliqueone1px34", "VWPR", 1, 1.0, 160, 12.0)
"""The same, and each label in one photo: one pick lost its place.

A match repeats the error of its click, enlarged up to three times in nearer photos.
"""


@pytest.mark.parametrize("clicks", [TWICE, ONCE])
def test_ground_in_few_photos_is_found_in_the_others(
    data_dir: Path, tmp_path: Path, clicks: Clicks
) -> None:
    folder = tmp_path / STREET
    shutil.copytree(data_dir / STREET, folder, copy_function=shutil.copyfile)
    shown: dict[str, list[tuple[str, float, float]]] = {}
    truth = json.loads((data_dir / "truth" / f"{STREET}.json").read_text(encoding="utf-8"))
    for image, labels in truth["pixels"].items():
        for label, (u, v, is_visible) in labels.items():
            place = np.array([u, v])
            inside = (place > MARGIN_PX) & (place < np.array(SIZE_PX) - MARGIN_PX)
            if is_visible and inside.all() and label[0] in clicks.kinds:
                shown.setdefault(label, []).append((image, u, v))
    chosen = random.Random(clicks.seed)  # noqa: S311 - no secret
    rows = []
    for label in sorted(shown):
        for image, *clicked in chosen.sample(shown[label], min(clicks.photos, len(shown[label]))):
            u, v = (each + chosen.gauss(0.0, clicks.sigma_px) for each in clicked)
            rows.append(f"{image},{label},{u:.3f},{v:.3f},{clicks.sigma_px or 0.8},")
    table = folder / "picks.csv"
    header = "image,label,u_px,v_px,sigma_px,height_m"
    table.write_text("\n".join([header, *sorted(rows), ""]), encoding="utf-8")

    assert main(["picks", "match", str(folder)]) == 0

    found = [row for row in read_rows(table) if row["source"] == "match"]
    found = [row for row in found if row["label"][0] in "PR"]
    off_px = [
        np.hypot(float(row["u_px"]) - u, float(row["v_px"]) - v)
        for row in found
        for u, v, _ in (truth["pixels"][row["image"]][row["label"]],)
    ]
    assert len(found) >= clicks.least
    assert max(off_px) < clicks.most_px

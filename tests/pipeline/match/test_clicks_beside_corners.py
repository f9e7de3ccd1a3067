"""Corners of cars that were clicked a pixel beside: found where they are, or not at all."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from uavgram.pipeline.match.run import match_picks
from uavgram.stages.match import Matches

STREET = "street_nadir"
WRONG_PX, LEAST_GROUND = 3.0, 55
"""Error beyond that of the click from which a match is wrong; least number of ground points."""

CLICKS = {
    # A dark car in its own shadow: the click is on the ground.
    "V37": ("IMG_0006.jpg", (0.23, -1.38)),
    # A roof's corner just before the lower corner of the rear window.
    "V52": ("IMG_0003.jpg", (0.08, -1.55)),
    "V23": ("IMG_0005.jpg", (0.69, -0.91)),
}
"""Photo and error of clicks (u, v) [px]; each was matched at another height than its corner."""


@pytest.fixture(scope="module")
def truth(data_dir: Path) -> dict[str, dict[str, tuple[float, float, bool]]]:
    text = (data_dir / "truth" / f"{STREET}.json").read_text(encoding="utf-8")
    return dict(json.loads(text)["pixels"])


@pytest.fixture(scope="module")
def matches(
    data_dir: Path,
    truth: dict[str, dict[str, tuple[float, float, bool]]],
    tmp_path_factory: pytest.TempPathFactory,
) -> Matches:
    """Of these corners, and of points on the ground, each clicked in two photos."""
    folder = tmp_path_factory.mktemp("beside") / STREET
    shutil.copytree(data_dir / STREET, folder, copy_function=shutil.copyfile)
    rows = [["image", "label", "u_px", "v_px", "sigma_px"]]
    seen: dict[str, int] = {}
    for image, labels in truth.items():
        for label, (u, v, is_visible) in labels.items():
            if is_visible and label[0] in "PR" and seen.setdefault(label, 0) < 2:
                seen[label] += 1
                rows.append([image, label, f"{u:.3f}", f"{v:.3f}", "0.8"])
    for label, (image, off) in CLICKS.items():
        u, v = np.add(truth[image][label][:2], off).tolist()
        rows.append([image, label, f"{u:.3f}", f"{v:.3f}", "0.8"])
    with (folder / "picks.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    return match_picks(folder, dry_run=True)


def test_no_match_of_a_click_beside_a_corner_is_wrong(
    matches: Matches, truth: dict[str, dict[str, tuple[float, float, bool]]]
) -> None:
    wrong = {
        pair: off_px
        for pair, one in matches.record.found.items()
        if pair[1] in CLICKS
        for off_px in [np.linalg.norm(np.subtract(one.pixel_px, truth[pair[0]][pair[1]][:2]))]
        if off_px > WRONG_PX + np.linalg.norm(CLICKS[pair[1]][1])
    }
    assert wrong == {}


def test_ground_points_around_are_found(matches: Matches) -> None:
    assert sum(label[0] == "P" for _, label in matches.record.found) >= LEAST_GROUND

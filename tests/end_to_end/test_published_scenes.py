"""Photos published with surveyed truth: what is left out comes back within one per cent or two.

Nothing is tuned on the answers: cameras and their sigmas are those published with the photos, the
sigmas of picks, tapes and targets what such things have, every option at its default or from what
is said of the scene. One is neither: the slope of the beach at Narrabeen (see `LEVEL_BEACH_DEG`).
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np
import pytest
from published_projects import (
    CROP,
    LENGTHS,
    STILL,
    Known,
    Pair,
    board_project,
    duck_project,
    narrabeen_project,
)
from published_scenes import Targets, narrabeen_targets, published, withheld

import uavgram
from uavgram.model.arrays import Floats


class ErrorsBeside(Protocol):
    def __call__(
        self, kind: str, adjust: Known, *, slope_deg: float | None = ...
    ) -> tuple[Floats, Floats]: ...


LEVEL_BEACH_DEG = 0.5
"""Sigma of the slope: the default when the bounds of these lengths were made; now it is 3 degrees.
Nothing published with the photos states it: it is the premise of the bounds, and they do not hold
without it. The targets rise by 0.3 m in 240 m along the water; across it, where they hardly spread,
the plane through them slopes 1.5 degrees."""


@pytest.fixture(scope="module")
def narrabeen(data_dir: Path) -> Targets:
    return narrabeen_targets(data_dir / "narrabeen_mavic")


@pytest.fixture(scope="module")
def errors_beside(narrabeen: Targets, tmp_path_factory: pytest.TempPathFactory) -> ErrorsBeside:
    """Relative errors and errors in sigmas of the lengths beside some known ones."""
    known = {}

    def run(
        kind: str, adjust: Known, *, slope_deg: float | None = LEVEL_BEACH_DEG
    ) -> tuple[Floats, Floats]:
        key = kind, adjust, slope_deg
        if key not in known:
            folder = tmp_path_factory.mktemp("narrabeen")
            project = narrabeen_project(narrabeen, folder, kind, adjust, slope_deg)
            known[key] = withheld(uavgram.run(project, output=None))
        return known[key]

    return run


def test_the_still_has_the_scale_of_the_video(narrabeen: Targets) -> None:
    # From what both show, not from the targets: so the video's lens is the still's, but for where
    # the crop lies; the 10 px by which the drone moved are within the still's sigma of 15.
    video = min(name for name in narrabeen.pixels if name != STILL)
    files = [narrabeen.folder / name for name in (f"frames/{video}", STILL)]
    images = [cv2.imread(str(file), cv2.IMREAD_REDUCED_GRAYSCALE_4) for file in files]
    sift = cv2.SIFT.create(2000)
    (a, da), (b, db) = (sift.detectAndCompute(image, None) for image in images if image is not None)
    pairs = [m for m, n in cv2.BFMatcher().knnMatch(da, db, k=2) if m.distance < 0.75 * n.distance]
    source = np.array([a[m.queryIdx].pt for m in pairs], np.float64)
    target = np.array([b[m.trainIdx].pt for m in pairs], np.float64)
    similar, inliers = cv2.estimateAffinePartial2D(source, target, ransacReprojThreshold=0.75)

    assert inliers.sum() > 300
    assert np.hypot(*similar[:, 0]) == pytest.approx(1.0, abs=0.003)
    middle = np.array([1919.5, 1079.5]) / 4
    moved = 4 * (similar @ [*middle, 1.0] - middle) - CROP
    assert np.abs(moved).max() < 15


@pytest.mark.parametrize("kind", ["still", "video"])
@pytest.mark.parametrize("known", LENGTHS, ids="-".join)
def test_one_known_length_at_narrabeen_gives_the_five_others(
    errors_beside: ErrorsBeside, kind: str, known: Pair
) -> None:
    relative, in_sigmas = errors_beside(kind, (known,))

    assert len(relative) == 5
    assert np.abs(relative).mean() < 0.013  # worst measured 0.0114
    assert np.abs(in_sigmas).max() < 2


@pytest.mark.parametrize("kind", ["still", "video"])
@pytest.mark.parametrize("known", [LENGTHS[0], LENGTHS[-1]], ids="-".join)
def test_without_a_word_of_the_slope_the_five_others_stay_within_two_sigmas(
    errors_beside: ErrorsBeside, kind: str, known: Pair
) -> None:
    # 14 degrees below the horizon, a slope and the camera's pitch are nearly one: the mean errors
    # are 2.6 and 4.2 % beside GCP1-GCP2 where half a degree leaves 0.9 and 1.1 %.
    _, in_sigmas = errors_beside(kind, (known,), slope_deg=None)

    assert len(in_sigmas) == 5
    assert np.abs(in_sigmas).max() < 2


@pytest.mark.parametrize("kind", ["still", "video"])
def test_two_known_lengths_at_narrabeen_give_the_four_others(
    errors_beside: ErrorsBeside, kind: str
) -> None:
    mean = {}
    for pair in combinations(LENGTHS, 2):
        relative, in_sigmas = errors_beside(kind, pair)
        mean[pair] = np.abs(relative).mean()
        assert np.abs(in_sigmas).max() < 2

    assert np.mean(list(mean.values())) < 0.004  # measured 0.0021
    # 1-4 and 2-3 lie about one middle: together they say no more of the camera's pitch than one.
    concentric = mean.pop((("GCP1", "GCP4"), ("GCP2", "GCP3")))
    assert max(mean.values()) < 0.004
    assert concentric < 0.0065  # measured 0.0047 and 0.0055


@pytest.mark.parametrize("ground", ["known heights", "rough ground"])
@pytest.mark.parametrize("left_out", ["pier1", "pier2", "pier3", "dune6", "dune7"])
def test_a_target_left_out_at_duck_comes_back(
    data_dir: Path, tmp_path: Path, left_out: str, ground: str
) -> None:
    scene = published(data_dir / "cirn_duck")
    result = uavgram.run(duck_project(scene, tmp_path, left_out, ground), output=None)
    relative, in_sigmas = withheld(result)

    assert len(relative) == 4  # its distances to the targets that gave the pose
    assert np.abs(relative).max() < 0.013  # worst measured 0.0056 and 0.0071
    assert np.abs(in_sigmas).max() < 3


@pytest.mark.parametrize(
    ("known", "worst"),
    [  # worst photo; measured 0.0059, 0.0059 and 0.0063
        ("four corners", 0.0062),
        ("six lengths between its corners", 0.0062),
        ("six lengths of its rim", 0.0067),
    ],
)
def test_lengths_on_a_board_follow_from_its_corners_or_six_lengths(
    data_dir: Path, tmp_path: Path, known: str, worst: float
) -> None:
    scene = published(data_dir / "phantom3_lenscalib")
    mean, square = [], []
    for photo in sorted(scene.pixels):
        project = board_project(scene, tmp_path, photo, known)
        relative, in_sigmas = withheld(uavgram.run(project, output=None))
        mean.append(np.abs(relative).mean())
        square.append(np.mean(in_sigmas**2))

    assert len(mean) == 6
    assert np.mean(mean) < 0.006  # measured 0.0042, 0.0041 and 0.0041
    assert max(mean) < worst
    assert max(square) < 2

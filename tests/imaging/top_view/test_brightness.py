"""Photos of other exposures are made alike by what they show of the same ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from top_views import cv_project, looking, make_view, write_photo

from uavgram.imaging.top_view.brightness import (
    apply_gain,
    create_photo_cache,
    estimate_exposure_gains,
)
from uavgram.stages.products.top_view import lay_raster

LIGHT = np.array([1.0, 0.6, 1.3])
CENTERS = np.array([[-8.0, 0.0, 30.0], [0.0, 0.0, 30.0], [9.0, 2.0, 31.0]])


def ground(east_m: np.ndarray, north_m: np.ndarray) -> np.ndarray:
    return 110.0 + 40.0 * np.sin(east_m / 5.0) * np.cos(north_m / 6.0)


def test_gains_undo_what_the_exposures_did(tmp_path: Path) -> None:
    paths = [str(tmp_path / f"{k}.png") for k in range(3)]
    view = make_view(CENTERS, [looking()] * 3, paths=paths)
    u, v = np.meshgrid(np.arange(800.0), np.arange(600.0))
    corners = np.array([[-40.0, -30, 0], [40, -30, 0], [40, 30, 0], [-40, 30, 0]])
    for path, center, light in zip(paths, CENTERS, LIGHT, strict=True):
        # it looks straight down: but for the lens, pixels are an affine function of the ground
        pixel = cv_project("brown", center, looking(), corners * 0.3)
        design = np.column_stack([pixel, np.ones(4)])
        east, north = np.linalg.lstsq(design, corners[:, :2] * 0.3, rcond=None)[0].T
        at = [row[0] * u + row[1] * v + row[2] for row in (east, north)]
        grey = np.clip(light * ground(*at), 0, 255).astype(np.uint8)
        write_photo(Path(path), np.dstack([grey] * 3))

    gains = estimate_exposure_gains(
        view, lay_raster(view, 0.2), create_photo_cache(paths, [4, 4, 4])
    )

    assert gains * LIGHT == pytest.approx(np.full(3, (gains * LIGHT).mean()), rel=0.03)
    assert np.log(gains).mean() == pytest.approx(0.0, abs=1e-6)


def test_a_gain_leaves_the_opacity_and_stops_at_white() -> None:
    rgba = np.array([[[100, 200, 0, 255], [10, 20, 30, 0]]], np.uint8)

    assert apply_gain(rgba, 1.5).tolist() == [[[150, 255, 0, 255], [15, 30, 45, 0]]]

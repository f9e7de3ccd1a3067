"""A plan from a result and its photos."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from PIL import Image
from top_views import SIZE_PX, looking, make_view, write_photo

from uavgram.errors import GeometryError
from uavgram.model.maps import PLAN_PDF, PlanPaper
from uavgram.model.result.result import Result
from uavgram.pipeline.measure.site_plan import PLAN_MAP, PLAN_PNG, write_plan


@pytest.fixture
def result(tmp_path: Path) -> Result:
    """Two photos of a green meadow, one of them half as bright."""
    paths = []
    for k, light in enumerate((200, 100)):
        rgb = np.zeros((SIZE_PX[1], SIZE_PX[0], 3), np.uint8)
        rgb[..., 1], rgb[..., 0] = light, light // 4
        paths.append(write_photo(tmp_path / f"{k}.png", rgb))
    view = make_view([[-10.0, 0, 60.0], [10.0, 0, 60.0]], [looking()] * 2, paths=paths)
    return view.result


def test_it_shows_the_photos_in_one_light(result: Result, tmp_path: Path) -> None:
    write_plan(result, PlanPaper("a4"), tmp_path)
    shown = np.asarray(Image.open(tmp_path / PLAN_PNG).convert("RGB")).astype(int)
    is_green = (shown[..., 1] > 2 * shown[..., 0]) & (shown[..., 1] > 2 * shown[..., 2])
    green = shown[..., 1][is_green]

    with rasterio.open(tmp_path / PLAN_MAP) as file:
        assert file.count == 4
    assert (tmp_path / PLAN_PDF).read_bytes().startswith(b"%PDF")
    assert is_green.mean() > 0.2
    assert np.ptp(np.quantile(green, [0.05, 0.95])) < 12


def test_a_survey_without_adjusted_photos_says_so(result: Result, tmp_path: Path) -> None:
    frames = result.frames
    nowhere = replace(
        frames.refined, center_world_m=np.full_like(frames.refined.center_world_m, np.nan)
    )
    without = replace(result, frames=replace(frames, refined=nowhere))

    with pytest.raises(GeometryError, match="no photo was adjusted"):
        write_plan(without, PlanPaper("a4"), tmp_path)

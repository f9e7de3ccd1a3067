"""The ground below the report's plans."""

from __future__ import annotations

import io
import re
from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from PIL import Image

from uavgram.imaging.photos.preview import IDENTITY_TONE
from uavgram.imaging.top_view.mosaic import MOST_PX, GroundTexture, cut_ground
from uavgram.model.result.result import NO_PICTURES
from uavgram.views.report import ground_extent, render_report
from uavgram.views.survey.top_view import top_view

SIZE_M = 0.1
WEST_M, NORTH_M = -80.0, 70.0


def texture() -> GroundTexture:
    """Its red counts metres east of the western side, its green metres south of the northern."""
    rows, columns = np.mgrid[:1400, :1600]
    rgb = np.dstack([columns * SIZE_M, rows * SIZE_M, np.full(rows.shape, 40.0)]).astype(np.uint8)
    covered = columns < 1200
    return GroundTexture(rgb, covered, WEST_M, NORTH_M, SIZE_M, IDENTITY_TONE)


def test_a_point_of_the_picture_is_where_it_is_on_the_ground() -> None:
    made = cut_ground(texture(), np.array([-31.0, -22.0]), np.array([17.0, 20.0]))
    assert made is not None
    shown = np.asarray(Image.open(io.BytesIO(made.jpeg)).convert("RGB")).astype(float)
    height, width = shown.shape[:2]
    row, column = height // 3, width // 4
    east = made.west_m + (column + 0.5) * made.width_m / width
    north = made.north_m - (row + 0.5) * made.height_m / height

    assert (made.west_m, made.north_m) == pytest.approx((-31.0, 20.0), abs=SIZE_M)
    assert max(shown.shape) <= MOST_PX
    assert shown[row, column, 0] == pytest.approx(east - WEST_M, abs=3)
    assert shown[row, column, 1] == pytest.approx(NORTH_M - north, abs=3)


def test_what_no_photo_shows_is_white_and_of_nothing_there_is_no_picture() -> None:
    made = cut_ground(texture(), np.array([0.0, 0.0]), np.array([79.0, 50.0]))
    assert made is not None
    shown = np.asarray(Image.open(io.BytesIO(made.jpeg)))

    assert shown[50, -20:].min() > 245
    assert cut_ground(texture(), np.array([45.0, 0.0]), np.array([79.0, 50.0])) is None


def test_the_backdrop_lies_where_the_drawing_has_its_corners() -> None:
    result = survey.build()
    corners = ground_extent(result)
    assert corners is not None
    ground = cut_ground(texture(), *corners)
    view = top_view(result, ground=ground, address="data:")
    assert ground is not None
    assert view is not None
    image = re.search('<image x="(.+?)" y="(.+?)" width="(.+?)"', view.drawing.__html__())
    assert image is not None
    x, y, width = map(float, image.groups())
    per_metre = view.drawing.bar / float(view.drawing.bar_text.split()[0])
    (dot,), point = view.drawing.named("points")[0], result.points.position_world_m[0]

    assert x == pytest.approx(dot[0] + (ground.west_m - point[0]) * per_metre, abs=0.01)
    assert y == pytest.approx(dot[1] - (ground.north_m - point[1]) * per_metre, abs=0.01)
    assert width == pytest.approx(ground.width_m * per_metre, abs=0.01)
    html = render_report(result, replace(NO_PICTURES, ground=ground))
    assert html.count("<image ") == 1
    assert "appear displaced away from the camera" in html
    assert '<section id="plan">' not in render_report(result)

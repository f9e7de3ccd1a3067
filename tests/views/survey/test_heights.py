"""Where the ground is no plane: colours, and the report's drawing of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from uneven_ground import DEPARTURE_M, uneven

from uavgram.views.style import diverging_colours, hex_colour
from uavgram.views.survey.heights import collect_departures
from uavgram.views.survey.top_view import top_view


def test_only_points_off_the_plane_are_told() -> None:
    result = uneven(survey.build())
    found = collect_departures(result)

    assert found is not None
    assert {result.points.label[row] for row in found.rows} == set(DEPARTURE_M)
    assert found.value_m[found.largest] == -0.2
    np.testing.assert_allclose(found.full_m, np.quantile([0.031, 0.012, 0.004, 0.2], 0.9))


@pytest.mark.parametrize("least", [0.0, 4e-4, 0.05])
def test_a_plane_and_ordinary_roughness_have_none(least: float) -> None:
    result = survey.build()
    count = len(result.points.label)
    same = replace(
        result.points,
        departure_m=np.full(count, least),
        departure_sigma_m=np.full(count, 0.02),
    )
    assert collect_departures(result) is None
    assert collect_departures(replace(result, points=same)) is None


def test_colours_run_from_blue_below_over_white_to_red_above() -> None:
    below, level, above, beyond = diverging_colours(np.array([-1.0, 0.0, 1.0, 7.0])).astype(int)

    assert below[2] > below[0] + 100
    assert above[0] > above[2] + 100
    assert np.ptp(level) == 0
    np.testing.assert_array_equal(above, beyond)
    assert hex_colour((5, 113, 176)) == "#0571b0"


def test_the_drawing_has_a_coloured_dot_and_a_number_where_the_ground_is_no_plane() -> None:
    result = uneven(survey.build(lines=(), measures=()))
    view = top_view(result)
    assert view is not None
    rows = [result.points.label.index(label) for label in DEPARTURE_M]

    dots = np.concatenate(view.drawing.find_shapes("points"))
    coloured = [one for one in view.drawing.shapes if one.name == "off_plane"]

    np.testing.assert_array_equal([one.lines[0][0] for one in coloured], dots[rows])
    assert coloured[3].look.fill == "#0571b0"
    numbers = [text for text in view.drawing.texts if text.kind == "off_plane"]
    assert len(numbers) >= 2
    expected = dict(zip(rows, ("+3", "-1", "0", "-20"), strict=True))
    for text in numbers:
        beside = [row for row in rows if math.dist(dots[row], (text.x, text.y)) < 25]
        assert text.text in {expected[row] for row in beside}
    assert "-20" in {text.text for text in numbers}


def test_the_drawing_of_a_plane_is_as_it_was() -> None:
    flat, rough = top_view(survey.build()), top_view(uneven(survey.build()))
    assert flat is not None
    assert rough is not None
    assert (flat.drawing.find_shapes("off_plane"), flat.full_m) == ([], 0.0)
    assert not [text for text in flat.drawing.texts if text.kind == "off_plane"]
    kept = tuple(text for text in rough.drawing.texts if text.kind != "off_plane")
    assert kept == flat.drawing.texts
    for name in ("points", "lines", "ellipses"):
        pairs = zip(rough.drawing.find_shapes(name), flat.drawing.find_shapes(name), strict=True)
        assert all(np.array_equal(one, other) for one, other in pairs)

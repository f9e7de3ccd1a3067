"""Heights over the ground in the report: the table of points, the plan, the method."""

from __future__ import annotations

import numpy as np
import pytest
import synthetic_survey as survey
from html_page import Page
from raised_survey import RAISED, raised
from uneven_ground import uneven

from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource
from uavgram.views.formatting import height_text
from uavgram.views.report import render_annex
from uavgram.views.survey.top_view import top_view

SIGMAS = "east, north, up, and their sigmas on the earth [m]"


def table(result: Result) -> tuple[list[str], dict[str, list[str]]]:
    """Head and rows of the table of points."""
    rows = Page(render_annex(result)).rows
    start = next(i for i, row in enumerate(rows) if row[:1] == ["label"])
    return rows[start], {row[0]: row for row in rows[start + 1 :] if len(row) == len(rows[start])}


def test_each_point_has_its_height_and_says_where_that_is_from() -> None:
    result = raised(survey.build())
    head, rows = table(result)
    told = {label: row[head.index("height over the ground")] for label, row in rows.items()}

    assert told["P00"] == "1.402 ± 0.021 mfound"
    assert told["P13"] == "0.500 mas stated"
    assert told["P16"] == "2.250 ± 0.040 mstated and adjusted"
    assert told["P26"] == "-0.800 ± 0.050 mfound"
    assert {told[label] for label in result.points.label if label not in RAISED} == {"on it"}


def test_coordinates_have_three_sigmas() -> None:
    result = raised(survey.build())
    head, rows = table(result)
    for k, label in enumerate(result.points.label):
        cell = rows[label][head.index(SIGMAS)]
        place, sigmas = cell.split("± ")
        wanted = np.sqrt(np.diag(result.points.covariance_m3[k]))
        np.testing.assert_allclose([float(x) for x in sigmas.split(", ")], wanted, atol=5.001e-4)
        np.testing.assert_allclose(
            [float(x) for x in place.split(", ")], result.points.position_world_m[k], atol=5.001e-4
        )


def test_rough_ground_has_sigmas_and_no_heights_and_a_plane_has_neither() -> None:
    rough, plane = table(uneven(survey.build()))[0], table(survey.build())[0]

    assert SIGMAS in rough
    assert "height over the ground" not in rough
    assert "east, north, up [m]" in plane
    assert "height over the ground" not in plane
    assert "Some points are off the ground" not in render_annex(survey.build())


def test_the_plan_marks_points_off_the_ground_and_writes_their_heights() -> None:
    result = raised(survey.build(lines=(), measures=()))
    view = top_view(result)
    assert view is not None
    rows = [k for k, label in enumerate(result.points.label) if label in RAISED]
    dots = np.concatenate(view.drawing.named("points"))
    middles = np.concatenate(view.drawing.named("off_ground"))

    np.testing.assert_array_equal(middles, dots[rows])
    assert np.ptp(middles[:, 0]) > 0
    written = {
        text.text: (text.x, text.y) for text in view.drawing.texts if text.kind == "off_ground"
    }
    assert set(written) == {"+1.402 m", "+0.50 m", "+2.250 m", "-0.800 m"}
    for row in rows:  # below its mark, where its nearer end is
        label, (x, y) = result.points.label[row], dots[row]
        at = next(place for text, place in written.items() if float(text[:-2]) == RAISED[label][0])
        assert 0 < at[1] - y < 20
        assert abs(at[0] - x) < 35  # half of its width
    assert "a point off the ground" in render_annex(result)


def test_the_plan_of_a_plane_has_no_such_marks() -> None:
    view = top_view(survey.build())
    assert view is not None
    assert not view.has_off_ground
    assert view.drawing.named("off_ground") == []
    assert "a point off the ground" not in render_annex(survey.build())


def test_the_method_tells_of_heights_where_there_are_some() -> None:
    with_heights, without = render_annex(raised(survey.build())), render_annex(survey.build())

    assert "The measured points of the ground were picked" in without
    assert "The measured points were picked" in with_heights
    assert "One that was left free is an unknown" in with_heights
    assert "One that was left free" not in without


@pytest.mark.parametrize(
    ("source", "sigma", "text"),
    [("ground", 0.0, "on it"), ("free", 0.25, "1.500 ± 0.250 m, found")],
)
def test_heights_in_words(source: HeightSource, sigma: float, text: str) -> None:
    assert height_text(1.5, sigma, source) == text

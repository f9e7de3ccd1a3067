"""Heights on the page: what is found of free ones, and how points lie seen from the side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uavgram.model.naming import METRIC
from uavgram.model.observations import MeasurementRequest
from uavgram.picking.document.commands import SideView
from uavgram.picking.protocol.encode_answers import side_json
from uavgram.picking.protocol.encode_survey import adjusted_json, linearised_json
from uavgram.pipeline.pick.live_survey import (
    LiveAdjustment,
    LiveSurvey,
    Observations,
    make_side_view,
)
from uavgram.views.units import quantity

FREE, ALONE = "R2", "alone"
REQUESTS = (
    MeasurementRequest(name="D", kind="distance", points=("R1", FREE)),
    MeasurementRequest(name="A", kind="area", points=("R1", FREE, "R7", "R4")),
    MeasurementRequest(name="P", kind="profile", points=("R1", "R7", FREE)),
    MeasurementRequest(name="height", kind="height", points=(FREE,)),
    MeasurementRequest(name="unseen", kind="distance", points=("R1", ALONE)),
)


@pytest.fixture(scope="module")
def survey(data_dir: Path) -> tuple[LiveSurvey, Observations]:
    """A survey in which one height is free, and another that only one photo shows."""
    live = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    picks = live.inputs.picks
    label = list(picks.label)
    label[next(i for i, name in enumerate(label) if name == "P12")] = ALONE
    is_free = np.isin(label, [FREE, ALONE])
    picks = replace(picks, label=tuple(label), is_free=is_free)
    return live, Observations(picks=picks, lines=live.inputs.lines, requests=REQUESTS)


@pytest.fixture(scope="module")
def adjusted(survey: tuple[LiveSurvey, Observations]) -> LiveAdjustment:
    live, observed = survey
    return live.adjust(observed)


def test_the_page_is_told_how_high_free_points_stand_and_whose_height_is_not_found(
    adjusted: LiveAdjustment,
) -> None:
    index = {name: k for k, name in enumerate(adjusted.result.frames.frame_id)}
    told: Any = adjusted_json(adjusted, index)
    high = {label: point for label, point in told["points"].items() if point["height"]}
    assert list(high) == [FREE]  # of points on the ground nothing is said
    height, sigma = map(float, high[FREE]["height"](METRIC).removesuffix(" m").split(" ± "))
    assert 0.0 < sigma < 1.0
    assert abs(height) < 4 * sigma  # in truth it lies on the ground
    assert told["measurements"]["height"]["text"](METRIC) == high[FREE]["height"](METRIC)
    assert "the ground, ± " in high[FREE]["sentence"](METRIC)
    (left_out,) = (m for m in told["messages"] if m["code"] == "pick-left-out")
    assert left_out["labels"] == [ALONE]


def test_heights_follow_a_drag_to_first_order(
    survey: tuple[LiveSurvey, Observations], adjusted: LiveAdjustment
) -> None:
    live, observed = survey
    pixel = observed.picks.pixel_px.copy()
    pixel[observed.picks.label.index(FREE)] += (0.0, 0.5)
    moved = replace(observed, picks=replace(observed.picks, pixel_px=pixel))
    quick = live.update_linearly(adjusted, moved)
    assert quick is not None
    index = {name: k for k, name in enumerate(live.inputs.photos.frame_id)}
    told: Any = linearised_json(quick, index)
    (row,) = np.flatnonzero(adjusted.result.points.is_off_ground)
    before = adjusted.result.points.height_above_ground_m[row]
    after = live.adjust(moved).result.points.height_above_ground_m[row]
    assert abs(after - before) > 1e-3
    quick_m = quick.height_m[adjusted.adjustment.survey.label.index(FREE)]
    assert quick_m == pytest.approx(after, abs=0.03 * abs(after - before))
    assert set(told["heights"]) == {FREE}
    sigma = float(adjusted.result.points.height_sigma_m[row])
    assert told["heights"][FREE]["height"](METRIC) == quantity(float(quick_m), sigma, "m")


def test_a_side_view_has_the_numbers_of_a_profile(adjusted: LiveAdjustment) -> None:
    found, profile = make_side_view(adjusted, "P"), adjusted.result.profiles
    assert found is not None
    assert found.label == profile.label == ("R1", "R7", FREE)
    np.testing.assert_array_equal(found.place_m, profile.place_m)
    np.testing.assert_array_equal(found.sigma_m, profile.sigma_m)


def test_what_is_no_profile_is_seen_across_its_longest_line(adjusted: LiveAdjustment) -> None:
    points = adjusted.result.points
    place = dict(zip(points.label, points.position_world_m, strict=True))
    around = [place[label] for label in REQUESTS[1].points]
    away = [float(np.hypot(*(one - around[0])[:2])) for one in around]
    found = make_side_view(adjusted, "A")
    assert found is not None
    assert sorted(found.label) == sorted(REQUESTS[1].points)
    assert found.label[0] == "R1"
    assert found.label[-1] == REQUESTS[1].points[int(np.argmax(away))]
    assert found.place_m[-1, 0] == pytest.approx(max(away))
    up = [place[label][2] - around[0][2] for label in found.label]
    np.testing.assert_allclose(found.place_m[:, 2], up, atol=1e-9)


def test_a_side_view_of_what_is_not_adjusted_is_empty(adjusted: LiveAdjustment) -> None:
    for name in ("height", "unseen", "nobody asked for this"):
        assert side_json(adjusted, SideView(name=name))["points"] == []
    assert side_json(None, SideView(name="D"))["points"] == []
    shown = side_json(adjusted, SideView(name="D"))["points"]
    assert [point["label"] for point in shown] == ["R1", FREE]
    assert shown[0]["station_m"] == (0.0, 0.0)
    sigma_m = shown[1]["height_m"][1]
    assert sigma_m is not None
    assert sigma_m > 0

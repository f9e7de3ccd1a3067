"""Latitude and longitude of measured coordinates: of an adjustment, and while a pick moves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pyproj import Geod

from uavgram.model.observations import MeasurementRequest
from uavgram.model.survey import World
from uavgram.picking.protocol.encode_places import places_on_earth
from uavgram.picking.protocol.encode_survey import adjusted_json, linearised_json
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, Observations

Surveyed = tuple[LiveSurvey, LiveAdjustment, dict[str, int]]


@pytest.fixture(scope="module")
def surveyed(data_dir: Path) -> Surveyed:
    """A survey in which the coordinate of one point is measured, and the numbers of its photos."""
    live = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    inputs = live.inputs
    asked = MeasurementRequest(name="C1", kind="coordinate", points=("R1",))
    observed = Observations(picks=inputs.picks, lines=inputs.lines, requests=(asked,))
    index = {name: k for k, name in enumerate(dict.fromkeys(inputs.picks.image))}
    return live, live.adjust(observed), index


def test_only_what_is_asked_for_has_a_place_and_it_is_the_results(surveyed: Surveyed) -> None:
    _, adjusted, index = surveyed
    points = adjusted.result.points
    k = points.label.index("R1")
    found = places_on_earth(adjusted, points.label, points.position_world_m)
    assert set(found) == {"R1"}
    assert found["R1"] == pytest.approx([points.latitude_deg[k], points.longitude_deg[k]], abs=1e-9)
    told = adjusted_json(adjusted, index)["measurements"]
    words = [told[f"C1 {axis}"]["earth"] for axis in ("north", "east")]
    assert [word.split()[0] for word in words] == ["lat", "lon"]
    degrees = [float(word.split()[1].removesuffix("°")) for word in words]
    assert degrees == pytest.approx(found["R1"], abs=1e-5)  # a metre, as the log has it


def test_the_place_follows_a_pick_that_moves(surveyed: Surveyed) -> None:
    live, adjusted, index = surveyed
    picks = adjusted.observed.picks
    pixel = picks.pixel_px.copy()
    pixel[[label == "R1" for label in picks.label]] += (4.0, -3.0)
    observed = replace(adjusted.observed, picks=replace(picks, pixel_px=pixel))
    quick = live.update_linearly(adjusted, observed)
    assert quick is not None
    k = adjusted.adjustment.survey.label.index("R1")
    moved_m = (quick.world_m - adjusted.result.points.position_world_m)[k, :2]
    points, survey = adjusted.result.points, quick.base.adjustment.survey
    (lat0, lon0), (lat1, lon1) = (
        places_on_earth(adjusted, label, place)["R1"]
        for label, place in (
            (points.label, points.position_world_m),
            (survey.label, quick.world_m),
        )
    )
    words = linearised_json(quick, index)["measurements"]["C1 north"]["earth"]
    assert float(words.split()[1].removesuffix("°")) == pytest.approx(lat1, abs=1e-5)
    azimuth, _, distance = Geod(ellps="WGS84").inv(lon0, lat0, lon1, lat1)
    north_m, east_m = distance * np.cos(np.deg2rad(azimuth)), distance * np.sin(np.deg2rad(azimuth))
    assert distance > 0.02
    assert [east_m, north_m] == pytest.approx(moved_m, abs=1e-3)


def test_a_survey_that_nothing_ties_to_the_earth_has_no_places() -> None:
    nowhere = World(origin=None, height_datum="msl", gauge="plane")
    asked = MeasurementRequest(name="C1", kind="coordinate", points=("A",))
    stand_in = SimpleNamespace(  # all that is asked for
        result=SimpleNamespace(world=nowhere), observed=SimpleNamespace(requests=(asked,))
    )
    assert places_on_earth(cast("LiveAdjustment", stand_in), ["A"], np.zeros((1, 3))) == {}

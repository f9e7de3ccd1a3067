"""Sentences in the project's units, numbers and names as they are, and places on earth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pyproj import Geod

from uavgram.model.naming import FOOT_M, IMPERIAL, METRIC, Units
from uavgram.model.observations import MeasurementRequest
from uavgram.model.survey import World
from uavgram.picking.document.state import Line, State
from uavgram.picking.protocol.encode_quantities import (
    collect_lengths,
    list_kept_names,
    places_on_earth,
    word_for_page,
)
from uavgram.picking.protocol.encode_survey import adjusted_json, linearised_json
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, Observations

MESSAGE = {
    "t": "live",
    "seconds": 0.4,
    "verdict": {
        "words": "off by 3.2 cm",
        "why": [{"text": "wall 4.10 m: 1.40 m high", "labels": ["P 4 m"], "mends": []}],
    },
    "lines": {"wall 4.10 m": {"adjusted_m": 4.1, "shows": "shows from 3.2 cm on"}},
    "diff": {"lines": [{"name": "x", "text": "1.40 m"}]},
    "messages": [{"level": "info", "text": "at 13.9 m/s"}],
}


def test_sentences_are_told_in_feet_and_nothing_else_is_changed() -> None:
    told = word_for_page(MESSAGE, IMPERIAL, ("wall 4.10 m",))

    assert told["verdict"]["words"] == "off by 1.26 in"
    assert told["verdict"]["why"][0]["text"] == "wall 4.10 m: 4 ft 7 in high"
    assert told["verdict"]["why"][0]["labels"] == ["P 4 m"]
    assert told["lines"] == {"wall 4.10 m": {"adjusted_m": 4.1, "shows": "shows from 1.26 in on"}}
    assert told["diff"] == MESSAGE["diff"]
    assert told["messages"][0]["text"] == "at 31.1 mph"


def test_sentences_tell_what_was_typed_and_not_what_its_rounded_metres_are() -> None:
    """10.5 ft are 3.2004 m, which a sentence tells as 3.200 m: 10.499 ft."""
    line = Line(name="L1", start="A", end="B", length_m=10.5 * FOOT_M, sigma_m=0.01)
    state = State(lines=(line,))
    message = {
        "mode": "adjusted",
        "lines": {"L1": {"adjusted_m": 10.53 * FOOT_M, "unit": "m"}},
        "measurements": {"D1": {"value": 7.25 * FOOT_M, "sigma": None, "unit": "m"}},
        "why": [
            {"text": "taped 3.200 m, found 3.210 m; D1 is 2.21 m"},
            {"words": "Correct L1 to 3.05 m", "changes": [{"length_m": 10 * FOOT_M}]},
            {"words": "Free it, 3.05 m up", "changes": [{"t": "height"}]},
        ],
    }
    exact = collect_lengths(message, state)

    for units, text, words in (
        (
            Units(length="ft", speed="mph"),
            "taped 10.500 ft, found 10.530 ft; D1 is 7.25 ft",
            "10.00 ft",
        ),
        (IMPERIAL, "taped 10 ft 6 in, found 10 ft 6 3/8 in; D1 is 7 ft 3 in", "10 ft 0 in"),
    ):
        first, button, other = word_for_page(message, units, (), exact)["why"]
        assert first["text"] == text
        assert button["words"] == f"Correct L1 to {words}"
        assert other["words"].startswith("Free it, 10")
    assert collect_lengths({"t": "saved"}, state) == (0.01, 10.5 * FOOT_M)


def test_in_metres_only_speeds_are_told_anew() -> None:
    told = word_for_page(MESSAGE, METRIC, ())

    assert told["messages"][0]["text"] == "at 50.0 km/h"
    assert {**told, "messages": MESSAGE["messages"]} == MESSAGE


def test_names_of_an_empty_project_need_no_care() -> None:
    assert list_kept_names(State()) == ()


# Latitude and longitude of measured coordinates: of an adjustment, and while a pick moves.


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

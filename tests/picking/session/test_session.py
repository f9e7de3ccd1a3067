"""The picking session: remedies that put a survey right, snapping, and heights."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import hostile_faults as faults
import hostile_length_faults as lengths
import numpy as np
import pytest
from hostile_conditions import Condition
from hostile_faults import Fault, Sound
from hostile_project import write_project
from hostile_surveys import make_survey
from open_projects import opened

from uavgram.model.naming import METRIC
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result.reliability import VerdictLevel
from uavgram.picking.document.commands import All, Repeat, SideView
from uavgram.picking.document.history import apply_change
from uavgram.picking.document.state import State, make_observations, make_state
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_answers import side_json
from uavgram.picking.protocol.encode_survey import adjusted_json, linearised_json
from uavgram.picking.protocol.encode_verdict import verdict_json
from uavgram.picking.protocol.parse import PhotoSize, parse_message
from uavgram.picking.session.project import OpenProject
from uavgram.pipeline.pick.live_survey import (
    LiveAdjustment,
    LiveSurvey,
    Observations,
    make_side_view,
)
from uavgram.views.units import format_quantity

POOR = Condition(labels=7, photos=3, picked_share=1.0, radius_m=10.0)
ORDER: tuple[VerdictLevel, ...] = ("green", "amber", "red")
IN_FEET = partial(lengths.one_length, reading=lengths.in_feet)
TRANSPOSED = partial(lengths.one_length, reading=lengths.transposed)
RAISED = partial(faults.raised_label, from_m=1.0, to_m=2.0)
GROSS = partial(faults.gross_pick, far_px=60.0)
CLICKED_ELSEWHERE = partial(faults.clicked_elsewhere, both=False)


class Project(NamedTuple):
    """A survey with a fault, open; and its photos, as messages name them."""

    live: LiveSurvey
    photos: tuple[PhotoSize, ...]

    def verdict(self, state: State) -> m.Verdict:
        """What the page is told of a state."""
        picks, lines = make_observations(state)
        requests = self.live.inputs.requests
        found = self.live.adjust(Observations(picks=picks, lines=lines, requests=requests))
        index = {photo.name: k for k, photo in enumerate(self.photos)}
        return verdict_json(found.result, lines, index)

    def pressed(self, state: State, mend: m.Mend) -> State:
        """The state after a button, as the page sends it."""
        text = json.dumps({"seq": 1, "t": "all", "changes": mend["changes"]})
        command = parse_message(text, self.photos).body
        assert isinstance(command, All)
        return apply_change(state, command)


def opened_survey(folder: Path, fault: Fault, seed: int) -> tuple[Project, State]:
    sound = Sound(make_survey(POOR, seed), POOR, seed, np.random.default_rng([seed, 99]))
    path = write_project(fault(sound).survey, folder, heights="unstated")
    inputs = LiveSurvey.open(path).inputs
    sizes = zip(
        inputs.photos.frame_id, inputs.photos.width_px, inputs.photos.height_px, strict=True
    )
    photos = tuple(PhotoSize(name, round(float(w)), round(float(h))) for name, w, h in sizes)
    return Project(LiveSurvey(inputs), photos), make_state(
        inputs.picks, inputs.lines, inputs.requests
    )


@pytest.mark.parametrize(
    ("fault", "seed", "code", "plain", "button"),
    [
        (faults.swapped_once, 3, "labels-swapped", "P2 and P5 seem swapped in ", "Swap P2 and P5"),
        (CLICKED_ELSEWHERE, 6, "label-elsewhere", "P0 is picked where P2 b", "Change P0 to P2 in"),
        (IN_FEET, 0, "line-wrong-unit", "L0 seems to be in feet", "Take L0 as feet: 10.21 m"),
        (
            TRANSPOSED,
            3,
            "line-wrong-digit",
            "L3 seems misread: it is written as 4.56",
            "Correct L3",
        ),
        (lengths.other_ends, 0, "line-other-ends", "L0 seems to be b", "Take L0 from P2 to P6"),
        (RAISED, 0, "point-off-ground", "P0 is 1.1 m above the ground.", "Free the height of P0"),
        (GROSS, 5, "pick-left-out", "The pick of P0 in ", "Remove the pick of P0 in "),
    ],
)
def test_the_button_beside_the_first_reason_makes_the_verdict_better(
    tmp_path: Path, fault: Fault, seed: int, code: str, plain: str, button: str
) -> None:
    project, state = opened_survey(tmp_path, fault, seed)
    before = project.verdict(state)
    first = before["first"]
    (mend,) = first["mends"]
    after = project.verdict(project.pressed(state, mend))

    assert first["code"].startswith(code)
    assert first["plain"].startswith(plain)
    assert mend["words"].startswith(button)
    assert first["show"]
    assert ORDER.index(after["level"]) < ORDER.index(before["level"])
    assert not [one for one in after["why"] if one["code"] == first["code"]]


def test_of_a_wrong_second_click_the_button_keeps_the_first(tmp_path: Path) -> None:
    project, state = opened_survey(tmp_path, faults.none, 5)
    right = next(pick for pick in state.picks if pick.label == "P0")
    again = Repeat(image=right.image, label="P0", u_px=right.u_px + 80.0, v_px=right.v_px)
    twice = apply_change(state, again)
    verdict = project.verdict(twice)
    mends = [
        mend
        for one in (verdict["first"], *verdict["why"])
        for mend in one["mends"]
        if [change["t"] for change in mend["changes"]] == ["unpick"]
    ]

    assert {mend["words"].partition(" in ")[0] for mend in mends} == {
        "Take back the second click of P0"
    }
    for mend in mends:
        assert project.pressed(twice, mend).picks == state.picks


# Snapping where a label is expected: wherever the pointer is, the target there is taken.


PHOTO, LABEL = "IMG_0046.jpg", "P2"
FAR = {"u_px": 200.0, "v_px": 200.0}


@pytest.fixture
def survey(data_dir: Path, tmp_path: Path) -> tuple[Path, tuple[float, float]]:
    """A survey whose targets are picked but for one in one photo, and where that is."""
    leave = shutil.ignore_patterns("out", "*.tlog", "measure.csv")
    shutil.copytree(data_dir / "calm_nadir", tmp_path / "survey", ignore=leave)
    (tmp_path / "survey" / "measure.csv").write_text("name,kind,points\n")
    table = tmp_path / "survey" / "picks.csv"
    rows = table.read_text().splitlines(keepends=True)
    gone = next(row for row in rows if row.startswith(f"{PHOTO},{LABEL},"))
    table.write_text("".join(row for row in rows if row is not gone))
    u, v = (float(cell) for cell in gone.split(",")[2:4])
    return tmp_path / "survey" / "project.yaml", (u, v)


def snapped(project: OpenProject, **fields: object) -> Mapping[str, Any]:
    asked = {"seq": 1, "t": "snap", "image": project.picking.index[PHOTO], "target": "target"}
    text = json.dumps({**asked, **fields})
    return project.picking.answer(parse_message(text, project.picking.photos))


def test_the_target_where_the_label_is_expected_is_taken(
    survey: tuple[Path, tuple[float, float]],
) -> None:
    path, (u, v) = survey
    with opened(path) as (project, _):
        project.open()
        until = time.monotonic() + 60.0
        while project.picking.initial_state()["live"] is None:
            assert time.monotonic() < until
            time.sleep(0.02)
        found = snapped(project, **FAR, expected=LABEL)
        assert found["u_px"] == pytest.approx(u, abs=3.0)  # the pick itself has noise of 0.8 px
        assert found["v_px"] == pytest.approx(v, abs=3.0)
        assert "why" in snapped(project, **FAR)
        # Where the label is picked, or nothing is known of it, the pointer says where.
        assert "why" in snapped(project, **FAR, expected="R1")
        assert "why" in snapped(project, **FAR, expected="nobody's")
        project.picking.stop()


# Heights on the page: what is found of free ones, and how points lie seen from the side.


FREE, ALONE = "R2", "alone"
REQUESTS = (
    MeasurementRequest(name="D", kind="distance", points=("R1", FREE)),
    MeasurementRequest(name="A", kind="area", points=("R1", FREE, "R7", "R4")),
    MeasurementRequest(name="P", kind="profile", points=("R1", "R7", FREE)),
    MeasurementRequest(name="height", kind="height", points=(FREE,)),
    MeasurementRequest(name="unseen", kind="distance", points=("R1", ALONE)),
)


@pytest.fixture(scope="module")
def free_heights(data_dir: Path) -> tuple[LiveSurvey, Observations]:
    """A survey in which one height is free, and another that only one photo shows."""
    live = LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")
    picks = live.inputs.picks
    label = list(picks.label)
    label[next(i for i, name in enumerate(label) if name == "P12")] = ALONE
    is_free = np.isin(label, [FREE, ALONE])
    picks = replace(picks, label=tuple(label), is_free=is_free)
    return live, Observations(picks=picks, lines=live.inputs.lines, requests=REQUESTS)


@pytest.fixture(scope="module")
def adjusted(free_heights: tuple[LiveSurvey, Observations]) -> LiveAdjustment:
    live, observed = free_heights
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
    free_heights: tuple[LiveSurvey, Observations], adjusted: LiveAdjustment
) -> None:
    live, observed = free_heights
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
    assert told["heights"][FREE]["height"](METRIC) == format_quantity(float(quick_m), sigma, "m")


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

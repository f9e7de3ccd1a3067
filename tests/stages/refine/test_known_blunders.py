"""A wrong known value is found, named, taken out where that is asked for, and bends nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scenes import Scene, make_scene

from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.ground import measurements
from uavgram.model.observations import KnownThing
from uavgram.model.options import SolveOptions
from uavgram.stages.refine import refine

REPORT, REMOVE = SolveOptions(noise="stated"), SolveOptions(outliers="remove", noise="stated")
THINGS = {
    "wide": ("distance", (0, 1)),
    "long": ("distance", (2, 3)),
    "field": ("area", (4, 5, 6, 7)),
    "corner": ("angle", (0, 4, 2)),
    "aside": ("line_distance", (8, 2, 3)),
}


def in_order(scene: Scene, label: tuple[int, ...]) -> tuple[int, ...]:
    """Points in their order around their middle."""
    arm = scene.world[list(label), :2] - scene.world[list(label), :2].mean(axis=0)
    return tuple(np.array(label)[np.argsort(np.arctan2(arm[:, 1], arm[:, 0]))].tolist())


def scene_with(off: dict[str, float], *, telemetry: bool = True) -> Scene:
    """A scene in which five things are known, some of them wrong by so much."""
    gauge: Literal["world", "plane"] = "world" if telemetry else "plane"
    scene = make_scene(6, frames=6, lines=8, telemetry=telemetry, gauge=gauge)
    rng = np.random.default_rng(5)
    things = []
    for i, (name, (kind, given)) in enumerate(THINGS.items()):
        label = in_order(scene, given) if kind == "area" else given
        value = float(getattr(measurements, kind)(scene.world[list(label)])[0])
        value = float(np.rad2deg(value)) if kind == "angle" else value
        sigma = 0.1 if kind in ("angle", "area") else 0.02
        value += sigma * rng.normal() + off.get(name, 0.0)
        things.append(
            KnownThing(index=i, name=name, kind=kind, label=label, value=value, sigma=sigma)
        )
    return replace(scene, survey=replace(scene.survey, known=tuple(things)))


def solve(scene: Scene, options: SolveOptions = REPORT) -> tuple[Refined, list[str]]:
    refined, messages = refine(scene.survey, options)
    return refined, [message.code for message in messages]


def used(refined: Refined) -> list[str]:
    return [thing.name for thing in refined.adjustment.survey.known]


def test_what_is_right_stays() -> None:
    refined, _ = solve(scene_with({}), REMOVE)

    assert used(refined) == list(THINGS)
    assert not refined.removals


@pytest.mark.parametrize("telemetry", [True, False])
@pytest.mark.parametrize(("name", "off"), [("long", 0.3), ("corner", 1.5), ("field", -2.0)])
def test_a_wrong_value_is_left_out_alone(name: str, off: float, *, telemetry: bool) -> None:
    refined, _ = solve(scene_with({name: off}, telemetry=telemetry))

    assert refined.known_removed == {list(THINGS).index(name)}
    assert [(one.kind, one.index) for one in refined.removals] == [
        ("known", list(THINGS).index(name))
    ]
    assert not refined.line_removed.any()
    assert refined.pick_reason == {}


@pytest.mark.parametrize("telemetry", [True, False])
def test_a_wrong_value_is_taken_out_alone(*, telemetry: bool) -> None:
    refined, _ = solve(scene_with({"long": 0.3}, telemetry=telemetry), REMOVE)

    assert used(refined) == [name for name in THINGS if name != "long"]
    assert [removal.kind for removal in refined.removals] == ["known"]


@pytest.mark.parametrize("telemetry", [True, False])
@pytest.mark.parametrize("options", [REPORT, REMOVE])
def test_a_value_in_another_unit_does_not_take_part(
    options: SolveOptions, *, telemetry: bool
) -> None:
    right, _ = solve(scene_with({}, telemetry=telemetry))
    refined, _ = solve(scene_with({"wide": 30.0}, telemetry=telemetry), options)

    assert "wide" not in used(refined)
    assert [name for name in THINGS if name != "wide"] == used(refined)
    apart = np.linalg.norm(np.diff(refined.adjustment.points()[0][:2], axis=0))
    expected = np.linalg.norm(np.diff(right.adjustment.points()[0][:2], axis=0))
    assert apart == pytest.approx(expected, abs=0.1)


def test_one_that_loses_a_point_is_not_used() -> None:
    scene = scene_with({})
    keep = scene.survey.pick_label != 7
    names = ("pick_frame", "pick_label", "pixel_px", "pick_sigma_px")
    survey = replace(scene.survey, **{n: getattr(scene.survey, n)[keep] for n in names})
    refined, _ = refine(survey, REPORT)

    assert used(refined) == [name for name in THINGS if name != "field"]
    labels = refined.adjustment.survey.label
    assert [labels[k] for k in refined.adjustment.survey.known[-1].label] == ["P8", "P2", "P3"]


CROSSED = ((0, 5), (1, 6), (2, 7), (3, 8), (0, 6), (1, 7), (2, 8), (3, 5), (4, 9))
"""Of these lengths, one alone ends at each of the last points of both rows."""


@pytest.mark.parametrize("wrong", ["known", "click"])
@pytest.mark.parametrize("off", [0.3, 3.0])
def test_in_one_photo_a_click_may_be_wrong_in_place_of_a_known_thing(
    wrong: str, off: float
) -> None:
    scene = make_scene(7, frames=1, labels=10, ends=CROSSED, telemetry=False, gauge="plane")
    label, survey = (9, 2), scene.survey
    value = float(measurements.distance(scene.world[list(label)])[0])
    pixel = np.array(survey.pixel_px)
    if wrong == "known":
        value += off
    else:
        pixel[survey.pick_label == 9] += [60.0 * off, 0.0]
    thing = KnownThing(index=0, name="k", kind="distance", label=label, value=value, sigma=0.02)
    refined, _ = refine(replace(survey, known=(thing,), pixel_px=pixel), REPORT)

    rivals = {one for rival in refined.rivals for one in rival.readings}
    named = {(one.kind, one.name) for one in (*refined.left_out, *rivals)}
    assert len(refined.left_out) == 1
    # A wrong click contradicts two readings, which no single other one explains.
    assert ("pixels", survey.label[9]) in named
    assert (("known", "k") in named) == (wrong == "known")


@pytest.mark.parametrize("wrong", ["control", "click"])
def test_in_one_photo_a_click_may_be_wrong_in_place_of_a_control_point(wrong: str) -> None:
    scene = make_scene(3, frames=1, labels=10, lines=0, control=6, telemetry=False)
    survey = scene.survey
    pixel, place = np.array(survey.pixel_px), np.array(survey.control_world_m)
    label = int(survey.control_label[2])
    if wrong == "control":
        place[2, 0] += 1.5
    else:
        pixel[survey.pick_label == label] += [120.0, 0.0]
    refined, _ = refine(replace(survey, control_world_m=place, pixel_px=pixel), REPORT)

    rivals = {one for rival in refined.rivals for one in rival.readings}
    named = {(one.kind, one.name) for one in (*refined.left_out, *rivals)}
    assert named == {("control", survey.label[label]), ("pixels", survey.label[label])}

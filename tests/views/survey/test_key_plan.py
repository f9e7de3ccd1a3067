"""Where photos were taken, drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_survey as survey

from uavgram.model.result.result import Result
from uavgram.views.survey.key_plan import ARROW, KeyPlan, key_plan


def drawing(result: Result) -> KeyPlan:
    """The drawing of a result that has one."""
    plan = key_plan(result)
    assert plan is not None
    return plan


def spots(plan: KeyPlan, name: str) -> np.ndarray:
    """(n, 2) middles of the signs of a name."""
    return np.concatenate(plan.drawing.named(name))


def shown_first(result: Result, adjusted: np.ndarray) -> np.ndarray:
    """The rows of the cameras in the order in which they are drawn: unused ones last."""
    rows = np.flatnonzero(result.has_refined | result.has_seed)
    return rows[np.argsort(~adjusted[rows], kind="stable")]


def test_cameras_lie_among_the_points_to_one_scale_and_north_is_up() -> None:
    result = survey.build()
    plan = drawing(result)
    rows = shown_first(result, result.has_refined)
    poses = result.frames
    centers = np.where(
        result.has_refined[rows, None],
        poses.refined.center_world_m[rows],
        poses.seed.center_world_m[rows],
    )
    world = np.concatenate([centers[:, :2], result.points.position_world_m[:, :2]])
    drawn = np.concatenate([spots(plan, "cameras"), spots(plan, "points")])
    per_metre = plan.drawing.bar / float(plan.drawing.bar_text.split()[0])

    np.testing.assert_allclose(
        np.diff(drawn, axis=0), np.diff(world, axis=0) * per_metre * [1, -1], atol=1e-6
    )


def test_an_arrow_points_where_the_camera_looks_and_is_the_longer_the_flatter() -> None:
    made = survey.build()
    tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.0, -0.8, 0.6]])
    refined = made.frames.refined
    tilted = replace(refined, world_from_camera=refined.world_from_camera @ tilt)
    result = replace(made, frames=replace(made.frames, refined=tilted))
    forward = result.frames.refined.world_from_camera[result.has_refined, :, 2]
    flat = np.linalg.norm(forward[:, :2], axis=1) * ARROW > 5
    arrows = drawing(result).drawing.named("arrows")[: flat.sum()]

    assert len(arrows) == flat.sum() > 0
    for (start, tip), (east, north, _) in zip(arrows, forward[flat], strict=True):
        np.testing.assert_allclose(tip - start, ARROW * np.array([east, -north]), atol=1e-6)


def test_a_footprint_is_the_ground_below_the_corners_of_its_photo() -> None:
    result = survey.build(clean=True)
    plan = drawing(result)
    first, camera = plan.drawing.named("footprints")[0], spots(plan, "cameras")[0]

    # it looks nearly straight down: the camera is over what it shows
    assert (first.min(axis=0) < camera).all()
    assert (first.max(axis=0) > camera).all()


def test_ground_that_several_photos_show_is_darker() -> None:
    plan = drawing(survey.build(clean=True))
    layers = [one for one in plan.drawing.shapes if one.name == "footprints"]

    assert len(layers) == len(plan.drawing.named("footprints")) > 1
    assert all(0 < one.look.fill_opacity < 0.1 for one in layers)


def test_names_cover_no_other_and_what_all_begin_with_is_told_once() -> None:
    plan = drawing(survey.build())
    photos = [text for text in plan.drawing.texts if text.kind == "photo"]
    half = {"photo": 3.1, "label": 2.8}

    assert plan.prefix == "DSC_00"
    assert len(photos) + plan.drawing.missing == len(spots(plan, "cameras"))
    assert not any(text.text.startswith("DSC") for text in photos)
    for i, one in enumerate(plan.drawing.texts):
        for other in plan.drawing.texts[:i]:
            room = half[one.kind] * len(one.text) + half[other.kind] * len(other.text)
            assert abs(one.x - other.x) >= room or abs(one.y - other.y) >= 12.0


def test_names_of_the_grid_are_whole_and_count_from_the_origin() -> None:
    result = survey.build()
    plan = drawing(result)
    named = [one for one in plan.drawing.written if one.kind == "grid"]
    per_metre = plan.drawing.bar / float(plan.drawing.bar_text.split()[0])
    dot, point = spots(plan, "points")[0], result.points.position_world_m[0]
    lines = np.array(plan.drawing.named("grid"))

    assert {one.text[0] for one in named} == {"E", "N"}
    for one in named:
        off, axis = float(one.text.split()[1]), "EN".index(one.text[0])
        assert one.x - 2.8 * len(one.text) >= 0
        at = dot[axis] + (1, -1)[axis] * (off - point[axis]) * per_metre
        assert np.abs(lines[:, :, axis] - at).max(axis=1).min() < 1e-6


def test_without_poses_there_is_no_key_plan_and_without_a_log_no_north() -> None:
    made = survey.build()
    nowhere = np.full_like(made.frames.refined.center_world_m, np.nan)
    unposed = replace(made.frames.refined, center_world_m=nowhere)
    frames = replace(made.frames, refined=unposed, seed=unposed)

    assert key_plan(replace(made, frames=frames)) is None
    for result, text in ((made, "N"), (survey.build(telemetry=False), "up in photo 1")):
        assert text in [one.text for one in drawing(result).drawing.written]

"""Where photos were taken, drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey

from uavgram.model.result.result import Result
from uavgram.views.survey.key_plan import ARROW, KeyPlan, key_plan


def drawing(result: Result) -> KeyPlan:
    """The drawing of a result that has one."""
    plan = key_plan(result)
    assert plan is not None
    return plan


def spots(points: str) -> np.ndarray:
    return np.array([pair.split(",") for pair in points.split()], dtype=np.float64)


def test_cameras_lie_among_the_points_to_one_scale_and_north_is_up() -> None:
    result = survey.build()
    plan = drawing(result)
    rows = np.flatnonzero(result.has_refined | result.has_seed)
    poses = result.frames
    centers = np.where(
        result.has_refined[rows, None],
        poses.refined.center_world_m[rows],
        poses.seed.center_world_m[rows],
    )
    world = np.concatenate([centers[:, :2], result.points.position_world_m[:, :2]])
    drawn = np.array([*((one.x, one.y) for one in plan.cameras), *plan.dots])
    per_metre = plan.bar / float(plan.bar_text.split()[0])

    np.testing.assert_allclose(
        np.diff(drawn, axis=0), np.diff(world, axis=0) * per_metre * [1, -1], atol=1e-6
    )


def test_an_arrow_points_where_the_camera_looks_and_is_the_longer_the_flatter() -> None:
    result = survey.build()
    plan = drawing(result)
    rows = np.flatnonzero(result.has_refined | result.has_seed)
    refined = result.frames.refined.world_from_camera
    arrows = 0
    for row, one in zip(rows, plan.cameras, strict=True):
        if not result.has_refined[row] or not one.arrow:
            continue
        east, north, _ = refined[row][:, 2]
        start, tip = spots(one.arrow)
        np.testing.assert_allclose(tip - start, ARROW * np.array([east, -north]), atol=0.11)
        arrows += 1
    steep = [
        np.linalg.norm(refined[row][:2, 2]) * ARROW < 5
        for row in np.flatnonzero(result.has_refined)
    ]

    assert arrows == len(steep) - sum(steep)


def test_a_footprint_is_the_ground_below_the_corners_of_its_photo() -> None:
    result = survey.build(clean=True)
    plan = drawing(result)
    first = spots(plan.footprints[0])
    row = int(np.flatnonzero(result.has_refined)[0])
    camera = plan.cameras[np.flatnonzero(result.has_refined | result.has_seed).tolist().index(row)]

    # it looks nearly straight down: the camera is over what it shows
    assert (first.min(axis=0) < [camera.x, camera.y]).all()
    assert (first.max(axis=0) > [camera.x, camera.y]).all()


def test_names_cover_no_other_and_what_all_begin_with_is_told_once() -> None:
    plan = drawing(survey.build())
    photos = [text for text in plan.texts if text.kind == "photo"]
    half = {"photo": 3.1, "label": 2.8}

    assert plan.prefix == "DSC_00"
    assert len(photos) + plan.unnamed == len(plan.cameras)
    assert not any(text.text.startswith("DSC") for text in photos)
    for i, one in enumerate(plan.texts):
        for other in plan.texts[:i]:
            room = half[one.kind] * len(one.text) + half[other.kind] * len(other.text)
            assert abs(one.x - other.x) >= room or abs(one.y - other.y) >= 12.0


def test_names_of_the_grid_are_whole_and_count_from_the_origin() -> None:
    result = survey.build()
    plan = drawing(result)
    named = [line for line in plan.grid if line.text]
    per_metre = plan.bar / float(plan.bar_text.split()[0])
    dot, point = plan.dots[0], result.points.position_world_m[0]

    assert {line.text[0] for line in named} == {"E", "N"}
    for line in named:
        off = float(line.text.split()[1])
        assert line.x - 2.8 * len(line.text) >= 0
        if line.text[0] == "E":
            assert line.x1 == pytest.approx(dot[0] + (off - point[0]) * per_metre)
        else:
            assert line.y1 == pytest.approx(dot[1] - (off - point[1]) * per_metre)


def test_without_poses_there_is_no_key_plan_and_without_a_log_no_north() -> None:
    made = survey.build()
    nowhere = np.full_like(made.frames.refined.center_world_m, np.nan)
    unposed = replace(made.frames.refined, center_world_m=nowhere)
    frames = replace(made.frames, refined=unposed, seed=unposed)

    assert key_plan(replace(made, frames=frames)) is None
    assert drawing(made).north_known
    assert not drawing(survey.build(telemetry=False)).north_known

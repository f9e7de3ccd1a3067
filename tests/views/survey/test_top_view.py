"""The scaled drawing of the report."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import synthetic_survey as survey
from drawn_texts import check_texts, in_svg

from uavgram.model.result.result import Result
from uavgram.views.survey.drawing import Look
from uavgram.views.survey.top_view import (
    ARROW,
    KeyPlan,
    TopView,
    count_unnamed,
    key_plan,
    mark_used_points,
    top_view,
)


def stroke(look: Look) -> str:
    """The style of a line in SVG."""
    dashes = f' stroke-dasharray="{look.dashes}"' if look.dashes else ""
    return f'stroke="{look.stroke}" stroke-width="{look.width:g}"{dashes}'


def dots(view: TopView) -> np.ndarray:
    """(n, 2) places of the points."""
    return np.concatenate(view.drawing.find_shapes("points"))


def drawing(result: Result) -> TopView:
    """The drawing of a result that has one."""
    view = top_view(result)
    assert view is not None
    return view


def test_the_drawing_is_to_scale_and_north_is_up() -> None:
    result = survey.build()
    view = drawing(result)
    drawn = dots(view)
    world = result.points.position_world_m[:, :2]
    per_metre = view.drawing.bar / float(view.drawing.bar_text.split()[0])

    np.testing.assert_allclose(np.diff(drawn[:, 0]), np.diff(world[:, 0]) * per_metre, atol=1e-6)
    np.testing.assert_allclose(np.diff(drawn[:, 1]), -np.diff(world[:, 1]) * per_metre, atol=1e-6)


def test_everything_lies_on_the_sheet() -> None:
    view = drawing(survey.build())
    spots = np.concatenate(view.drawing.find_shapes("lines") + view.drawing.find_shapes("ellipses"))

    assert (spots >= 0).all()
    assert (spots <= [view.drawing.width, view.drawing.height]).all()


def test_ellipses_as_large_as_the_scene_are_neither_filled_nor_enlarged() -> None:
    result = survey.build()
    within = result.points.relative
    wide = replace(result.points, relative=replace(within, ellipse_95_m=within.ellipse_95_m + 5.0))
    view = drawing(replace(result, points=wide))

    assert (view.ellipse_factor, view.fill_ellipses) == (1, False)
    assert drawing(result).fill_ellipses


def test_ellipses_are_those_within_the_survey() -> None:
    result = survey.build()
    view = drawing(result)
    outline = view.drawing.find_shapes("ellipses")[3]
    reach = np.linalg.norm(outline - dots(view)[3], axis=1).max()

    per_metre = view.drawing.bar / float(view.drawing.bar_text.split()[0])
    expected = per_metre * view.ellipse_factor * result.points.relative.ellipse_95_m[3, 0]
    assert reach == pytest.approx(expected, rel=0.02)


def test_many_measured_lines_are_thin_and_few_are_named() -> None:
    labels = [f"P{i:02d}" for i in range(30)]
    pairs = enumerate(pairwise(labels))
    measures: tuple[survey.Measure, ...] = tuple(
        (f"D{i}", "distance", pair, "m") for i, pair in pairs
    )
    view = drawing(survey.build(measures=measures))

    assert {one.look.width for one in view.drawing.shapes if one.name == "lines"} == {0.5, 2.0}
    assert 0 < len([text for text in view.drawing.texts if text.kind == "measured"]) <= 12


def test_lines_of_one_look_are_one_and_none_is_lost() -> None:
    view = drawing(survey.build())
    together = [one for one in view.drawing.shapes if one.name == "lines"]
    svg = view.drawing.__html__()

    assert (
        len({one.look for one in together})
        == len(together)
        < len(view.drawing.find_shapes("lines"))
    )
    for one in together:
        (path,) = re.findall(f'd="([^"]+)" fill="none" {stroke(one.look)}/>', svg)
        assert path.count("M") == len(one.lines)


def test_without_telemetry_north_is_not_claimed() -> None:
    for result, text in ((survey.build(), "N"), (survey.build(telemetry=False), "up in photo 1")):
        written = [one.text for one in drawing(result).drawing.written if one.kind == "scale"]
        assert written[1:] == [text]


def test_one_point_alone_can_be_drawn_and_none_is_no_drawing() -> None:
    assert drawing(survey.build(point_count=1, lines=(), measures=())).drawing.find_shapes("points")
    assert top_view(survey.build(point_count=0, lines=(), measures=())) is None


@pytest.mark.parametrize("name", ["R3 hedge: 11.21 m", "path: 38.212 m ?"])
def test_lines_and_measurements_are_named(name: str) -> None:
    assert name in [text.text for text in drawing(survey.build()).drawing.texts]


def test_a_known_length_has_all_decimals_of_its_tape() -> None:
    result = survey.build()
    length_m = np.array([2.925, *result.lines.length_m[1:]])
    told = drawing(replace(result, lines=replace(result.lines, length_m=length_m)))

    assert f"{result.lines.name[0]}: 2.925 m" in [text.text for text in told.drawing.texts]


def test_no_text_is_cut_off_or_covers_another() -> None:
    labels = [f"P{i:02d}" for i in range(30)]
    measures: tuple[survey.Measure, ...] = tuple(
        (f"a distance with a very long name {i}", "distance", pair, "m")
        for i, pair in enumerate(pairwise(labels))
    )
    view = drawing(survey.build(measures=measures))
    drawn = in_svg(view.drawing.__html__())
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * drawn.boxes[:, None, 2:4]
    cos, sin = np.cos(drawn.boxes[:, 4, None]), np.sin(drawn.boxes[:, 4, None])
    x = drawn.boxes[:, :1] + corners[..., 0] * cos - corners[..., 1] * sin

    assert sum("very long name" in text for text in drawn.texts) > 5
    assert (x >= 0).all()
    assert (x <= view.drawing.width).all()
    check_texts(drawn)


@pytest.mark.parametrize("seed", range(3))
def test_every_point_is_named_however_crowded_and_no_text_covers_another(seed: int) -> None:
    result = survey.build(lines=(), measures=())
    rng = np.random.default_rng(seed)
    place = result.points.position_world_m.copy()
    place[5:25] = place[5] + rng.normal(size=(20, 3)) * [0.4, 0.4, 0.0]
    view = drawing(replace(result, points=replace(result.points, position_world_m=place)))
    names = [text for text in view.drawing.texts if text.kind == "name"]
    size = view.drawing.texts[0].size
    half = np.array([0.5 * 0.62 * 10 * size * len(text.text) for text in names])
    x, y = np.array([(text.x, text.y) for text in names]).T
    aside = np.abs(x[:, None] - x) < half[:, None] + half
    level = np.abs(y[:, None] - y) < 10 * size

    assert sorted(text.text for text in names) == sorted(result.points.label)
    assert view.drawing.missing == 0
    assert not np.triu(aside & level, 1).any()
    starts = {text.text: text.leader[0] for text in names if text.leader is not None}
    assert starts
    for label, start in starts.items():
        row = result.points.label.index(label)
        np.testing.assert_allclose(start, dots(view)[row], atol=0.1)


def test_of_thousands_of_points_some_are_named_and_the_others_counted() -> None:
    view = drawing(survey.build(point_count=1200, lines=(), measures=()))
    names = [text for text in view.drawing.texts if text.kind == "name"]

    assert len(names) > 20
    assert len(names) + view.drawing.missing == 1200


def test_many_known_lengths_are_thin_but_the_suspect_ones() -> None:
    lines: tuple[survey.Line, ...] = tuple(
        (f"L{k}", f"P{k:02d}", f"P{k + 3:02d}", "suspect" if k == 7 else "used", 0.004)
        for k in range(25)
    )
    view = drawing(survey.build(lines=lines, measures=()))

    widths = {one.look.width: len(one.lines) for one in view.drawing.shapes if one.name == "lines"}
    assert widths == {1.0: 24, 2.0: 1}


# Where photos were taken, drawn.


def key_drawing(result: Result) -> KeyPlan:
    """The drawing of a result that has one."""
    plan = key_plan(result)
    assert plan is not None
    return plan


def spots(plan: KeyPlan, name: str) -> np.ndarray:
    """(n, 2) middles of the signs of a name."""
    return np.concatenate(plan.drawing.find_shapes(name))


def shown_first(result: Result, adjusted: np.ndarray) -> np.ndarray:
    """The rows of the cameras in the order in which they are drawn: unused ones last."""
    rows = np.flatnonzero(result.has_refined | result.has_seed)
    return rows[np.argsort(~adjusted[rows], kind="stable")]


def test_cameras_lie_among_the_points_to_one_scale_and_north_is_up() -> None:
    result = survey.build()
    plan = key_drawing(result)
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
    arrows = key_drawing(result).drawing.find_shapes("arrows")[: flat.sum()]

    assert len(arrows) == flat.sum() > 0
    for (start, tip), (east, north, _) in zip(arrows, forward[flat], strict=True):
        np.testing.assert_allclose(tip - start, ARROW * np.array([east, -north]), atol=1e-6)


def test_a_footprint_is_the_ground_below_the_corners_of_its_photo() -> None:
    result = survey.build(clean=True)
    plan = key_drawing(result)
    first, camera = plan.drawing.find_shapes("footprints")[0], spots(plan, "cameras")[0]

    # it looks nearly straight down: the camera is over what it shows
    assert (first.min(axis=0) < camera).all()
    assert (first.max(axis=0) > camera).all()


def test_ground_that_several_photos_show_is_darker() -> None:
    plan = key_drawing(survey.build(clean=True))
    layers = [one for one in plan.drawing.shapes if one.name == "footprints"]

    assert len(layers) == len(plan.drawing.find_shapes("footprints")) > 1
    assert all(0 < one.look.fill_opacity < 0.1 for one in layers)


def test_names_cover_no_other_and_what_all_begin_with_is_told_once() -> None:
    plan = key_drawing(survey.build())
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
    plan = key_drawing(result)
    named = [one for one in plan.drawing.written if one.kind == "grid"]
    per_metre = plan.drawing.bar / float(plan.drawing.bar_text.split()[0])
    dot, point = spots(plan, "points")[0], result.points.position_world_m[0]
    lines = np.array(plan.drawing.find_shapes("grid"))

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
        assert text in [one.text for one in key_drawing(result).drawing.written]


def test_ends_of_measured_lines_without_a_name_are_not_named_on_the_first_page() -> None:
    labels = [f"P{i:02d}" for i in range(60)]
    measures: tuple[survey.Measure, ...] = tuple(
        (f"D{i}", "distance", (labels[2 * i], labels[2 * i + 1]), "m") for i in range(30)
    )
    result = survey.build(measures=measures, point_count=70)
    view = top_view(result, shown=mark_used_points(result))
    assert view is not None
    measured = {
        text.text.partition(":")[0] for text in view.drawing.texts if text.kind == "measured"
    }
    assert len(measured) == len(measures) - count_unnamed(result) == 12
    named = {text.text for text in view.drawing.texts if text.kind == "name"}
    ends = {label for name, _, points, _ in measures if name in measured for label in points}
    assert ends <= named
    known = {*result.lines.start, *result.lines.end, *result.point_checks.label}
    assert not named & ({*labels} - ends - known.union(*result.known.points))

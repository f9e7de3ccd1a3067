"""The sheet for the field: what it says, on how many pages, in whose units."""

from __future__ import annotations

import dataclasses
import html as escaping
import io
import re
from typing import Any

import numpy as np
import pytest
from planned_sample import bare_plan, none_of, sample_plan

from uavgram.errors import UavgramError
from uavgram.model.maps import Paper
from uavgram.model.naming import METRIC, Units
from uavgram.model.planned import AccuracyGrid, FlightPlanned
from uavgram.stages.products.planned_layers import grid_cells
from uavgram.stages.products.text_places import overlaps
from uavgram.views.field_sheet import (
    WIDTH,
    class_edges,
    field_drawing,
    field_sheet,
    field_sheet_pdf,
)
from uavgram.views.flight_plan import (
    describe_accuracy,
    describe_alternatives,
    find_unchecked_lines,
    flight_facts,
    summarise_work,
)

PLAN = sample_plan()
PAGE = field_sheet(PLAN)


def text_of(page: str) -> str:
    """What a reader sees, without style and tags."""
    body = re.sub(r"<style>.*?</style>", " ", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", escaping.unescape(re.sub(r"<[^>]+>", " ", body)))


def without(planned: FlightPlanned, **changes: object) -> FlightPlanned:
    return dataclasses.replace(planned, **changes)  # type: ignore[arg-type]


def test_the_nose_points_from_0_to_359_degrees() -> None:
    for heading, said in (
        ([359.9, 0.1, 359.8, 0.0, 0.2, 359.9], "0° from north"),
        ([152.0] * 6, "152° from north"),
        ([0.0, 0.0, 0.0, 180.0, 180.0, 180.0], "turns: see each photo"),
    ):
        frames = dataclasses.replace(PLAN.frames, heading_deg=np.array(heading))
        assert dict(flight_facts(without(PLAN, frames=frames)))["Nose"] == said


def test_the_first_sentence_says_what_to_do() -> None:
    assert summarise_work(PLAN) == (
        "Lay and tape 5 lines, then take 6 photos from 40 m above the ground."
    )
    bare = without(PLAN, lines=none_of(PLAN.lines))
    assert summarise_work(bare) == "Take 6 photos from 40 m above the ground."


def test_what_is_not_good_enough_is_named() -> None:
    assert (
        describe_accuracy(PLAN)[0]
        == "Not as good as you wish, even if all goes well: impact <to> kerb."
    )
    better = dataclasses.replace(PLAN.measurements, sigma=PLAN.measurements.sigma / 2)
    assert describe_accuracy(without(PLAN, measurements=better))[0].startswith(
        "Everything will be as good"
    )
    assert len(describe_accuracy(without(PLAN, measurements=none_of(PLAN.measurements)))) == 1


def test_a_line_that_nothing_replaces_and_one_that_nothing_checks() -> None:
    told = " ".join(describe_alternatives(PLAN))
    assert "Without L5 the survey has no scale" in told
    assert "L3 matters most: without it, expect ± 1.9 cm" in told
    assert find_unchecked_lines(PLAN) == ("L4",)
    shown = text_of(PAGE)
    assert "L4 above all, as nothing else checks its reading" in shown
    assert "never: tape it twice" in shown


def test_everything_to_lay_and_to_measure_is_in_the_tables() -> None:
    shown = text_of(PAGE)
    for name in (*PLAN.lines.name, *PLAN.lines.start_label, *PLAN.measurements.name):
        assert name in shown
    assert "1.2 m from corner 1 towards corner 2, then 1.2 m inwards" in shown
    assert shown.count(" NO ") == 1
    assert "-33.856973, 151.215149" in shown


def test_names_that_people_wrote_are_no_markup() -> None:
    assert "<to>" not in PAGE
    assert "impact &lt;to&gt; kerb" in PAGE


@pytest.mark.parametrize("length", ["ft", "ft-in"])
def test_in_feet_nothing_is_said_in_metres(length: Any) -> None:  # noqa: ANN401
    shown = text_of(field_sheet(PLAN, Units(length=length, speed="mph")))
    assert not re.search(r"\d (m|cm|mm|km/h|m/s)\b", shown)
    assert "131 ft above the ground" in shown
    assert re.search(r"L1 46.6 ft|L1 46 ft 7 in", shown)


def test_a_plan_of_photos_alone_has_a_sheet() -> None:
    shown = text_of(field_sheet(bare_plan()))
    assert "1. Fly" in shown
    for absent in ("tape", "keep out", "nan", "None"):
        assert absent not in shown


@pytest.mark.parametrize(("paper", "size"), [("a4", (595.28, 841.89)), ("letter", (612.0, 792.0))])
def test_it_is_two_pages_of_paper(paper: Paper, size: tuple[float, float]) -> None:
    pikepdf = pytest.importorskip("pikepdf", reason="pikepdf is not installed")
    try:
        made = field_sheet_pdf(PAGE, paper)
    except UavgramError as fault:
        pytest.skip(str(fault))
    pages = pikepdf.open(io.BytesIO(made)).pages
    assert len(pages) == 2
    assert [float(edge) for edge in pages[0].mediabox][2:] == pytest.approx(size, abs=0.01)


# The drawing of a plan is to scale, north up, and no name covers another.


SHEET = field_drawing(PLAN, METRIC)
DRAWING = SHEET.drawing


SCALE = DRAWING.bar / float(DRAWING.bar_text.removesuffix(" m"))


def test_it_is_to_scale_with_north_up() -> None:
    (drawn,), ground = DRAWING.find_shapes("area"), PLAN.area_world_m[:, :2]
    flipped = (drawn - drawn[0]) * [1.0, -1.0] / SCALE
    np.testing.assert_allclose(flipped, ground - ground[0], atol=1e-9)
    for (start, end), length_m in zip(
        DRAWING.find_shapes("lines"), PLAN.lines.length_m, strict=True
    ):
        assert np.linalg.norm(end - start) / SCALE == pytest.approx(length_m, abs=0.02)


def test_all_that_must_be_seen_is_on_the_sheet() -> None:
    for name in ("area", "path", "no_go", "lines", "wanted"):
        places = np.concatenate(DRAWING.find_shapes(name))
        assert (places >= 0).all()
        assert (places <= [WIDTH, DRAWING.height]).all()


def test_a_photo_points_where_the_nose_does() -> None:
    headings = np.deg2rad(PLAN.frames.heading_deg)
    for corners, heading in zip(DRAWING.find_shapes("photos"), headings, strict=True):
        ahead = (corners[0] - corners[2]) / np.linalg.norm(corners[0] - corners[2])
        np.testing.assert_allclose(ahead, [np.sin(heading), -np.cos(heading)], atol=0.02)


def test_no_name_covers_another_or_a_line_to_lay() -> None:
    names = np.array([[n.x, n.y, n.half_width, n.half_height, 0.0] for n in DRAWING.texts])
    other = ~np.eye(len(names), dtype=bool)
    assert not (overlaps(names, names) & other).any()
    assert (names[:, 0] - names[:, 2] >= 0).all()
    assert (names[:, 0] + names[:, 2] <= WIDTH).all()
    for start, end in DRAWING.find_shapes("lines"):
        on_line = start + np.linspace(0, 1, 100)[:, None] * (end - start)
        beside = np.abs(on_line[:, None] - names[None, :, :2]) < names[None, :, 2:4]
        assert not beside.all(axis=2).any()
    told = {name.text for name in DRAWING.texts}
    assert {"L1 14.2 m", "L5b", "corner 4", "P6", "skid left", "A"} <= told


@pytest.mark.parametrize("turn_deg", [15, 28, 45])
def test_no_name_is_hidden_by_scale_bar_or_arrow(turn_deg: float) -> None:
    turn = np.deg2rad(turn_deg)
    cos, sin = np.cos(turn), np.sin(turn)
    corners = (
        PLAN.area_world_m * [3.0, 1.2, 1.0] @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    )
    drawn = field_drawing(dataclasses.replace(PLAN, area_world_m=corners), METRIC).drawing
    bar = (12.0, drawn.height - 35.0, 32.0 + drawn.bar, drawn.height)  # their patches
    arrow = (WIDTH - 46.0, 12.0, WIDTH - 14.0, 74.0)
    for name in drawn.texts:
        for left, top, right, bottom in (bar, arrow):
            beside = max(left - name.x, name.x - right) - name.half_width
            above = max(top - name.y, name.y - bottom) - name.half_height
            assert max(beside, above) >= 0, name


@pytest.mark.parametrize(
    ("low", "high"), [(0.012, 0.0227), (0.01, 0.01), (0.0031, 2.2), (0.4, 0.41)]
)
def test_steps_of_grey_are_round_and_cover_the_map(low: float, high: float) -> None:
    edges = class_edges(np.array([low, (low + high) / 2, high]))
    steps = np.diff(edges)
    assert edges[0] <= low + 1e-9
    assert high <= edges[-1] + 1e-9
    assert 1 <= len(steps) <= 6
    np.testing.assert_allclose(steps, steps[0])
    assert re.fullmatch(r"[125]e[+-]\d\d", f"{steps[0]:.0e}")


def test_the_darker_the_worse_and_white_is_best() -> None:
    sigma = PLAN.grid.sigma_m
    levels = [int(shade.colour[1:3], 16) for shade in SHEET.shades]
    shaded = [one for one in DRAWING.shapes if one.name == "cells"]
    places = PLAN.grid.center_world_m[:, :2] * [1.0, -1.0]
    middles = np.array([ring.mean(axis=0) for one in shaded for ring in one.lines]) / SCALE
    level = np.array([int(one.look.fill[1:3], 16) for one in shaded for _ in one.lines])
    offset = DRAWING.find_shapes("area")[0][0] / SCALE - PLAN.area_world_m[0, :2] * [1.0, -1.0]
    away = np.linalg.norm(middles[:, None] - offset - places, axis=2)
    order = np.argsort(sigma[away.argmin(axis=1)], kind="stable")

    assert away.min(axis=1).max() < 1e-6
    assert (np.diff(level[order]) <= 0).all()
    assert levels[0] == 255
    assert levels == sorted(levels, reverse=True)
    assert len(DRAWING.find_shapes("unseen")) == 2 * np.isnan(sigma).sum()


def test_cells_of_a_turned_map_lie_side_by_side() -> None:
    cells = np.array(DRAWING.find_shapes("cells"))
    others = cells[1:].reshape(-1, 2)
    shared = np.linalg.norm(cells[0][:, None] - others, axis=2) < 1e-6
    assert shared.any(axis=1).sum() >= 2
    sides = np.linalg.norm(np.roll(cells[0], -1, axis=0) - cells[0], axis=1)
    np.testing.assert_allclose(sides, PLAN.grid.cell_m * SCALE)


@pytest.mark.parametrize("turn_deg", [0.0, 28.0, 100.0])
def test_cells_fit_a_map_whose_steps_differ(turn_deg: float) -> None:
    turn = np.deg2rad(turn_deg)
    ahead, left = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    along, across = np.meshgrid(2.1 * np.arange(9), 1.9 * np.arange(5), indexing="ij")
    places = along.reshape(-1, 1) * ahead + across.reshape(-1, 1) * left
    keep = np.arange(len(places)) % 7 != 3  # an area with bays
    places = np.column_stack([places, np.zeros(len(places))])[keep]
    grid = AccuracyGrid(
        center_world_m=places, cell_m=2.0, length_m=5.0, sigma_m=np.full(len(places), 0.01)
    )
    cells = grid_cells(dataclasses.replace(PLAN, grid=grid))
    np.testing.assert_allclose(cells.mean(axis=1), places, atol=1e-9)
    sides = np.roll(cells, -1, axis=1) - cells
    lengths = np.sort(np.linalg.norm(sides, axis=2), axis=1)
    np.testing.assert_allclose(lengths, [[1.9, 1.9, 2.1, 2.1]] * len(cells), atol=1e-9)
    x, y = cells[..., 0], cells[..., 1]
    area = np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1) / 2
    np.testing.assert_allclose(area, 2.1 * 1.9, atol=1e-9)


def test_of_many_photos_some_are_outlined() -> None:
    frames = PLAN.frames
    many = dataclasses.replace(
        frames,
        **{
            field.name: np.tile(
                getattr(frames, field.name), (5, *[1] * (getattr(frames, field.name).ndim - 1))
            )
            for field in dataclasses.fields(frames)
            if field.name != "name"
        },
        name=tuple(f"P{k}" for k in range(1, 31)),
    )
    drawing = field_drawing(dataclasses.replace(PLAN, frames=many), METRIC)
    assert drawing.outlined == ("P1", "P5", "P9", "P13", "P17", "P21", "P25", "P29")
    assert len(drawing.drawing.find_shapes("footprints")) == 8


def test_ends_that_nobody_named_have_no_name_of_their_own() -> None:
    """`skid left 1` says no more than `skid left` beside it; labels of people are all there."""
    points = dataclasses.replace(PLAN.points, label=("skid left 1", "skid left 2", "C", "D"))
    measured = dataclasses.replace(
        PLAN.measurements, points=(("skid left 1", "skid left 2"), *[("C", "D")] * 3)
    )
    plan = dataclasses.replace(PLAN, points=points, measurements=measured)
    shown = [name.text for name in field_drawing(plan, METRIC).drawing.texts]
    assert {"skid left", "C", "D"} <= set(shown)
    assert not {"skid left 1", "skid left 2"} & set(shown)

"""Texts as each kind of drawing has them: their rectangles, and the lines to what they name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg

from uavgram.io.exports.dxf import place_texts
from uavgram.model.arrays import Floats
from uavgram.model.maps import Paper
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import features_of
from uavgram.stages.products.plan_sheets import find_surveyed_extent, lay_plan
from uavgram.stages.products.text_places import overlaps
from uavgram.views.recording.labels import (
    HALF_LETTER_ON_SCREEN,
    LINE_ON_SCREEN,
    ViewTexts,
    place_in_space,
    survey_labels,
)
from uavgram.views.recording.photo import HALF_LETTER, LINE_HEIGHT, place_on_photo, project_picks
from uavgram.views.recording.scene import Eye, measure_scene
from uavgram.views.report import render_annex, render_report
from uavgram.views.site_plan import PlanContent, PlanPage, draw_sheet
from uavgram.views.survey.figure import draw_figure

PLAN = re.compile(r'<svg class="(?:drawing|photo)".*?</svg>', re.DOTALL)
TEXT = re.compile(
    r'<text x="([-\d.]+)" y="([-\d.]+)" class="(\w+)"[^>]* textLength="([-\d.]+)"[^>]*'
    r'font-size="([\d.]+)"[^>]*?(?: transform="rotate\(([-\d.]+)[^>]*)?>(.*?)</text>'
)
LEADER = re.compile(
    r'<path d="((?:M[-\d.]+,[-\d.]+ [-\d.]+,[-\d.]+)+)" fill="none" stroke="#1b1f24"'
)


class Drawn(NamedTuple):
    """Texts of a drawing, (n, 5) rectangles of their letters, and (m, 2) ends of lines to them.

    `height` is that of a line of text.
    """

    texts: list[str]
    boxes: Floats
    line_ends: Floats
    height: float


def in_svg(svg: str) -> Drawn:
    """Texts of a drawing of the report or the field sheet."""
    texts, boxes, height = [], [], 1.0
    for x, y, kind, width, size, turn, text in TEXT.findall(svg):
        if kind != "scale":
            height, angle = float(size), np.radians(float(turn or 0.0))
            middle = (
                float(x) + 0.3 * height * np.sin(angle),
                float(y) - 0.3 * height * np.cos(angle),
            )
            texts.append(text)
            boxes.append((*middle, float(width) / 2, 0.4 * height, angle))
    ends = [
        pair.split(" ")[1].split(",")
        for path in LEADER.findall(svg)
        for pair in path.removeprefix("M").split("M")
    ]
    return Drawn(texts, np.array(boxes), np.array(ends, dtype=np.float64).reshape(-1, 2), height)


def in_report(result: Result) -> Iterator[Drawn]:
    """Texts of every drawing of the report."""
    yield from map(in_svg, PLAN.findall(render_report(result)))


def in_annex(result: Result) -> Iterator[Drawn]:
    """Texts of every drawing of the annex."""
    yield from map(in_svg, PLAN.findall(render_annex(result)))


def in_cad(result: Result) -> Drawn:
    """Texts of the CAD drawing that are no dimensions, and of these."""
    placed = place_texts(features_of(result, None))
    boxes, leaders, _, _ = placed.places
    far = np.isfinite(leaders[:, 0, 0]) & [len(text.ends) == 1 for text in placed.texts]
    return Drawn([text.words for text in placed.texts], boxes, leaders[far, 1], placed.text_m)


def on_plan(result: Result) -> Drawn:
    """Texts of the plan to scale, as Matplotlib draws them [mm]."""
    page = plan_page(result)
    placed, figure = page.drawing.texts, draw_figure(page.drawing)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    mm, boxes = figure.dpi / 25.4, []
    shown = figure.axes[0].texts[-len(placed) :]
    for one, text in zip(shown, placed, strict=True):
        one.set_rotation(0.0)
        extent = one.get_window_extent(renderer)
        half = np.array([extent.width, extent.height]) / mm / 2
        above = half[1] * np.array([np.sin(text.turn), -np.cos(text.turn)])
        boxes.append((text.x + above[0], text.y + above[1], *half, text.turn))
    ends = [text.leader[1] for text in placed if text.leader is not None]
    words = [one.get_text() for one in shown]
    return Drawn(words, np.array(boxes), np.array(ends, np.float64).reshape(-1, 2), 3.0)


def plan_page(result: Result, paper: Paper = "a4", scale: int | None = None) -> PlanPage:
    """The last sheet of a plan to scale, without a picture."""
    extent = find_surveyed_extent(result)
    plan = lay_plan(extent, paper, scale)
    content = PlanContent(
        result=result, plan=plan, overview=lay_plan(extent, paper), pictures=lambda *_: None,
        notes=("The photos are grey.",), digest="0123" * 16,
    )  # fmt: skip
    return draw_sheet(content, plan, plan.sheets[-1], "overview of 100 sheets 1:5000")


def in_space(texts: ViewTexts, eye: Eye) -> Drawn:
    """Texts in a view of the recording, y downwards; Rerun hangs them below their places."""
    at = eye.project_to_screen(texts.place_m) * [1.0, -1.0] if texts.words else np.empty((0, 2))
    half = LINE_ON_SCREEN / 2
    boxes = [
        (x, y + half, HALF_LETTER_ON_SCREEN * len(text), 0.99 * half, 0.0)
        for (x, y), text in zip(at, texts.words, strict=True)
    ]
    ends = [eye.project_to_screen(line[1:])[0] * [1.0, -1.0] for line in texts.leaders_m]
    return Drawn(
        list(texts.words),
        np.reshape(boxes, (-1, 5)),
        np.reshape(ends, (-1, 2)) + np.array([0.0, 0.01 * half]),
        LINE_ON_SCREEN,
    )


def in_recording(result: Result) -> Iterator[Drawn]:
    """Texts of the views of the recording that name what was surveyed."""
    scene = measure_scene(result)
    yield in_space(survey_labels(result, scene)[0], scene.eye)
    points = result.points
    names = place_in_space(
        scene.top_eye, points.position_world_m, points.label, dots_m=points.position_world_m
    )
    yield in_space(names, scene.top_eye)
    width, height = result.camera.width_px, result.camera.height_px
    for rows in project_picks(result).rows:
        labels = [result.picks.label[row] for row in rows]
        at = result.picks.pixel_px[rows]
        placed = place_on_photo(result, list(zip(at, labels, strict=True)), at)
        kept = np.isfinite(placed.boxes[:, 0])
        boxes, far = placed.boxes[kept].copy(), np.isfinite(placed.leaders[:, 0, 0])
        boxes[:, 2] = [
            HALF_LETTER * width * len(label)
            for label, shown in zip(labels, kept, strict=True)
            if shown
        ]
        hung = placed.boxes[far, :2] - [0.0, 0.99] * placed.boxes[far, 2:4]
        yield Drawn(labels, boxes, hung, LINE_HEIGHT * height)


def check_texts(drawn: Drawn) -> None:
    """No text covers another, and each line to a text ends at one."""
    boxes, ends = drawn.boxes, drawn.line_ends
    assert not np.triu(overlaps(boxes, boxes), 1).any(), drawn.texts
    if len(ends):
        slack = 0.5 * drawn.height  # above and below letters
        grown = boxes + np.array([0.0, 0.0, 0.3 * drawn.height, slack, 0.0])
        tips = np.column_stack([ends, np.full((len(ends), 2), 1e-6), np.zeros(len(ends))])
        assert overlaps(tips, grown).any(axis=1).all(), drawn.texts

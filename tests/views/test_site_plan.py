"""plan.pdf, measured in its own units: pikepdf reads what a printer is told to draw."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pikepdf
import pytest
import synthetic_survey
from drawn_texts import plan_page
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.transforms import Bbox
from numbers_told import agree
from PIL import Image

from uavgram.io.results.results_json import write_results
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster, Paper
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips, reference_strips
from uavgram.stages.products.plan_sheets import find_surveyed_extent, lay_plan
from uavgram.views.site_plan import PlanContent, PlanFiles, SheetPicture, plan_pages
from uavgram.views.style import INK
from uavgram.views.survey.drawing import BLACK
from uavgram.views.survey.figure import MM_OF_POINT, draw_figure
from uavgram.views.survey.top_view import clip_line

TINY_MM = 0.1


@dataclass(frozen=True)
class Page:
    """What is on a page: its size [mm], strokes by colour [mm], and where points are marked."""

    size_mm: tuple[float, float]
    strokes: dict[str, list[Floats]]
    marks_mm: Floats


def content(result: Result, paper: Paper = "a4", scale: int | None = None) -> PlanContent:
    extent = find_surveyed_extent(result)
    return PlanContent(
        result=result,
        plan=lay_plan(extent, paper, scale),
        overview=lay_plan(extent, paper),
        pictures=lambda _plan, _sheet: None,
        notes=("The photos are grey.",),
        digest="0123" * 16,
    )


class Painted(NamedTuple):
    """Parts of a path [mm], its colours, and whether it is stroked, or filled too, and round."""

    parts: list[Floats]
    stroke: str
    fill: str
    is_filled: bool
    is_round: bool


def painted_on(page: pikepdf.Page) -> Iterator[Painted]:
    path: list[list[tuple[float, float]]] = []
    colours, stack, turn, is_round = {"RG": "", "rg": ""}, [], pikepdf.Matrix(), False
    for instruction in pikepdf.parse_content_stream(page):
        operands, name = instruction.operands, str(instruction.operator)
        if name == "q":
            stack.append((colours.copy(), turn))
        elif name == "Q":
            colours, turn = stack.pop()
        elif name == "cm":
            turn = pikepdf.Matrix(*map(float, operands)) @ turn
        elif name in ("RG", "G", "rg", "g"):
            colours["RG" if name.isupper() else "rg"] = colour_of(operands)
        elif name in ("m", "l", "c"):
            point = turn.transform((float(operands[-2]), float(operands[-1])))
            path += [[]] if name == "m" else []
            path[-1].append(point)
            is_round = name == "c"
        elif name == "h":
            path[-1].append(path[-1][0])
        elif name in ("S", "s", "n", "f", "B", "b"):
            parts = [MM_OF_POINT * np.array(part) for part in path]
            if name not in ("n", "f"):
                yield Painted(parts, colours["RG"], colours["rg"], name in ("B", "b"), is_round)
            path = []


def drawn_on(page: pikepdf.Page) -> tuple[dict[str, list[Floats]], Floats]:
    """Strokes by colour, and middles of filled circles in the colour of points [mm]."""
    found: dict[str, list[Floats]] = {}
    marks: list[Floats] = []
    for one in painted_on(page):
        if not one.is_filled:
            found.setdefault(one.stroke, []).extend(one.parts)
        elif one.is_round and one.fill == INK["point"]:
            marks += [(part.min(axis=0) + part.max(axis=0)) / 2 for part in one.parts]
    return found, np.array(marks).reshape(-1, 2)


def colour_of(operands: Iterable[object]) -> str:
    parts = [round(255 * float(str(part))) for part in operands]
    return "#" + "".join(f"{part:02x}" for part in (parts * 3)[:3])


def pages_of(pdf: bytes) -> list[Page]:
    with pikepdf.open(io.BytesIO(pdf)) as file:
        return [
            Page(
                size_mm=(
                    MM_OF_POINT * float(page.mediabox[2]),
                    MM_OF_POINT * float(page.mediabox[3]),
                ),
                strokes=drawn[0],
                marks_mm=drawn[1],
            )
            for page in file.pages
            if (drawn := drawn_on(page))
        ]


@pytest.fixture(scope="module")
def result() -> Result:
    return synthetic_survey.build()


@pytest.fixture(scope="module")
def made(result: Result) -> PlanFiles:
    return plan_pages(content(result))


def lengths(drawn: list[Floats]) -> list[float]:
    return sorted(float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in drawn)


def test_lines_on_paper_are_as_long_as_the_survey_says(made: PlanFiles, result: Result) -> None:
    (page,) = pages_of(made.pdf)
    scale = content(result).plan.scale
    strips = list(measured_strips(result).values())
    known = [
        strip for i, strip in reference_strips(result).items() if result.lines.status[i] == "used"
    ]
    for wanted, ink in ((strips, INK["measured"]), (known, INK["used"])):
        level = [strip[:, :2] * 1000.0 / scale for strip in wanted]
        drawn = np.array(lengths([line for line in page.strokes[ink] if in_frame(line, result)]))
        for length in lengths(level):
            assert np.abs(drawn - length).min() < TINY_MM


def in_frame(line: Floats, result: Result) -> bool:
    """Not one of the legend's samples."""
    left, bottom, across, up = content(result).plan.frame_mm
    low, high = np.array([left, bottom]), np.array([left + across, bottom + up])
    return bool((line >= low - 0.01).all() and (line <= high + 0.01).all())


def test_a_plan_of_one_sheet_has_one_page_of_its_paper(made: PlanFiles) -> None:
    (page,) = pages_of(made.pdf)

    assert sorted(page.size_mm) == pytest.approx((210.0, 297.0), abs=0.01)


def joined(pages: list[Page]) -> Floats:
    """Marks of points on sheets that were cut and joined as the plan says."""
    marks = []
    corner, row_start = np.zeros(2), np.zeros(2)
    for page in pages:
        inked = page.strokes[BLACK]
        low, high = next(
            (line.min(axis=0), line.max(axis=0))
            for line in inked
            if len(line) > 4 and np.ptp(line, axis=0).min() > 99
        )
        cuts = [line for line in inked if len(line) == 2]
        right = [cut[0, 0] for cut in cuts if abs(np.ptp(cut[:, 1]) - (high - low)[1]) < 0.01]
        below = [cut[0, 1] for cut in cuts if abs(np.ptp(cut[:, 0]) - (high - low)[0]) < 0.01]
        inside = ((low <= page.marks_mm) & (page.marks_mm <= high)).all(axis=1)
        marks.append(page.marks_mm[inside] - low + corner)
        if right:  # the cut edge lies on the left edge of the next frame
            corner = corner + np.array([right[0] - low[0], 0.0])
        elif below:  # and on the upper edge of the frames below
            corner = row_start = row_start + np.array([0.0, below[0] - high[1]])
    return np.concatenate(marks)


@pytest.mark.parametrize(("paper", "scale", "share"), [("a4", 100, 0.4), ("letter", 200, 1.0)])
def test_lengths_on_joined_sheets_are_those_of_the_survey(
    result: Result, paper: Paper, scale: int, share: float
) -> None:
    low, high = find_surveyed_extent(result)
    middle, half = (low + high) / 2, share * (high - low) / 2
    wanted = content(result, paper, scale)
    wanted = replace(wanted, plan=lay_plan((middle - half, middle + half), paper, scale))
    pages = pages_of(plan_pages(wanted).pdf)[1:]
    marks = joined(pages)
    size = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}[paper]
    place = result.points.position_world_m[:, :2]
    place = place[(np.abs(place - middle) < half).all(axis=1)]
    true_mm = np.linalg.norm(place[:, None] - place, axis=-1) * 1000.0 / scale
    # one of the points is the first mark: it is that by which the others find theirs
    shifts = marks[0] - result.points.position_world_m[:, :2] * 1000.0 / scale
    moved = place * 1000.0 / scale + shifts[:, None]
    far = np.linalg.norm(moved[:, :, None] - marks, axis=-1)
    drawn = marks[far[far.min(axis=2).sum(axis=1).argmin()].argmin(axis=1)]

    assert len(pages) > 3
    assert all(sorted(page.size_mm) == pytest.approx(size, abs=0.01) for page in pages)
    assert len(place) > 5
    assert np.linalg.norm(drawn[:, None] - drawn, axis=-1) == pytest.approx(true_mm, abs=TINY_MM)


def test_equal_input_gives_equal_bytes(made: PlanFiles, result: Result) -> None:
    again = plan_pages(content(result))

    assert (again.pdf, again.png) == (made.pdf, made.png)


def test_a_picture_lies_where_its_raster_says(result: Result) -> None:
    wanted = content(result)
    sheet = wanted.plan.sheets[0]
    red = np.zeros((10, 20, 4), np.uint8)
    red[..., 0] = red[..., 3] = 255
    raster = GroundRaster(
        west_m=sheet.west_m + 2.0, north_m=sheet.north_m - 3.0, pixel_m=0.5, width=20, height=10,
        crs=None,
    )  # fmt: skip
    drawn = plan_pages(replace(wanted, pictures=lambda *_: SheetPicture(red, raster)))
    shown = np.asarray(Image.open(io.BytesIO(drawn.png)).convert("RGB")).astype(int)
    rows, columns = np.nonzero((shown - [255, 0, 0] == 0).all(axis=2))
    mm = 25.4 / 200
    west, north = wanted.plan.on_paper(sheet, np.array([raster.west_m, raster.north_m]))

    assert columns.min() * mm == pytest.approx(west, abs=2 * mm)
    assert shown.shape[0] * mm - rows.min() * mm == pytest.approx(north, abs=2 * mm)
    assert np.ptp(columns) * mm == pytest.approx(10_000 / wanted.plan.scale, abs=2 * mm)
    on_map = (drawn.map_rgba[..., :3].astype(int) == [255, 0, 0]).all(axis=2)
    share = np.flatnonzero(on_map.any(axis=0)).min() / on_map.shape[1]
    (first, _), (last, _), _ = drawn.map_corners_m
    assert first + share * (last - first) == pytest.approx(raster.west_m, abs=0.15)
    with pikepdf.open(io.BytesIO(drawn.pdf)) as file:
        (stored,) = file.pages[0].get_images().values()

        assert file.check_pdf_syntax() == []
        assert stored.Filter == "/DCTDecode"
        shown_as: Any = pikepdf.PdfImage(stored)  # type: ignore[arg-type]
        found = np.asarray(shown_as.as_pil_image()).astype(int)
    assert found.shape == (10, 20, 3)
    assert np.abs(found - [255, 0, 0]).max() < 8


@pytest.mark.parametrize(("paper", "scale"), [("a4", None), ("letter", 200), ("letter", 1000)])
def test_texts_beside_the_frame_are_clear_of_each_other_and_of_north(
    result: Result, paper: Paper, scale: int | None
) -> None:
    page = plan_page(result, paper, scale)
    drawing, figure = page.drawing, draw_figure(page.drawing)
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    px = figure.dpi / 25.4
    north = [one for one in drawing.signs_over if one.name == "north"]
    drawn = figure.axes[0].texts[: len(drawing.written)]
    boxes = [one.get_window_extent(renderer) for one in drawn]
    for one in north:
        (left, top), (right, bottom) = one.lines[0].min(axis=0), one.lines[0].max(axis=0)
        low, high = drawing.height - bottom, drawing.height - top
        boxes.append(Bbox(px * np.array([[left, low], [right, high]])))

    assert north
    for box in boxes:
        assert box.x0 > 5 * px
        assert box.x1 < (drawing.width - 5) * px
    pairs = [(a, b) for k, a in enumerate(boxes) for b in boxes[:k] if a.overlaps(b)]
    assert pairs == []


def texts_of(result: Result) -> list[str]:
    """All that stands on a plan of one sheet."""
    drawing = plan_page(result).drawing
    return [one.text for one in (*drawing.written, *drawing.texts)]


def test_dimensions_are_those_of_the_results(result: Result, tmp_path: Path) -> None:
    write_results(result, tmp_path / "results.json")
    file = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    told = {
        name: value for name, colon, value in (t.partition(": ") for t in texts_of(result)) if colon
    }
    measured = {one["name"]: one for one in file["measurements"]}
    pace = {name: 3.6 if one["unit"] == "m/s" else 1.0 for name, one in measured.items()}
    seen = [name for name in measured if name in told]
    for name in seen:
        one = measured[name]
        agree([told[name]], pace[name] * one["value"], pace[name] * one["sigma"])
    lines = {one["name"]: one for one in file["lines"]}
    known = [name for name in lines if name in told]
    for name in known:
        agree([told[name]], lines[name]["length_m"])

    assert len(seen) > 3
    assert known


def test_a_plan_in_feet_says_nothing_in_metres(result: Result) -> None:
    made = result.provenance
    options = (*made.options, ("units.length", "ft"), ("units.speed", "mph"))
    texts = texts_of(replace(result, provenance=replace(made, options=options)))
    metric = re.compile(r"\d (mm|cm|m|m²|km/h)\b")

    assert [text for text in texts if metric.search(text)] == []
    assert any(metric.search(text) for text in texts_of(result))
    (bar,) = [text for text in texts if text.endswith("in on paper)")]
    (scale,) = [text for text in texts if "1 in is" in text]
    long, _, inches = bar.partition(" ft (")
    per_inch = float(scale.partition("1 in is ")[2].split()[0])
    assert float(inches.split()[0]) * per_inch == pytest.approx(float(long), rel=5e-3)


def test_a_line_is_cut_at_the_frame() -> None:
    frame = np.zeros(2), np.array([10.0, 5.0])
    part = clip_line(np.array([-5.0, 2.0]), np.array([15.0, 2.0]), *frame)

    assert part is not None
    assert np.array(part) == pytest.approx(np.array([[0.0, 2.0], [10.0, 2.0]]))
    assert clip_line(np.array([-5.0, 6.0]), np.array([15.0, 6.0]), *frame) is None

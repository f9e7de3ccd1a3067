"""plan.pdf, measured in its own units: pikepdf reads what a printer is told to draw."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace

import numpy as np
import pikepdf
import pytest
import synthetic_survey
from PIL import Image

from uavgram.model.arrays import Floats
from uavgram.model.maps.plan import Paper
from uavgram.model.maps.raster import GroundRaster
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips, reference_strips
from uavgram.stages.products.plan_sheets import lay_plan, surveyed_extent
from uavgram.views.plan.pages import GroundPicture, PlanContent, PlanFiles, plan_pages
from uavgram.views.plan.sheet import MM_OF_POINT
from uavgram.views.plan.surveyed import clipped
from uavgram.views.survey.top_view import INK

TINY_MM = 0.1


@dataclass(frozen=True)
class Page:
    """What is on a page: its size [mm], and strokes by colour [mm]."""

    size_mm: tuple[float, float]
    strokes: dict[str, list[Floats]]


def content(result: Result, paper: Paper = "a4", scale: int | None = None) -> PlanContent:
    extent = surveyed_extent(result)
    return PlanContent(
        result=result,
        plan=lay_plan(extent, paper, scale),
        overview=lay_plan(extent, paper),
        pictures=lambda _plan, _sheet: None,
        notes=("The photos are grey.",),
        digest="0123" * 16,
    )


def strokes_of(page: pikepdf.Page) -> dict[str, list[Floats]]:
    found: dict[str, list[Floats]] = {}
    path: list[tuple[float, float]] = []
    colour, stack, turn = "", [], pikepdf.Matrix()
    for instruction in pikepdf.parse_content_stream(page):
        operands, name = instruction.operands, str(instruction.operator)
        if name == "q":
            stack.append((colour, turn))
        elif name == "Q":
            colour, turn = stack.pop()
        elif name == "cm":
            turn = pikepdf.Matrix(*map(float, operands)) @ turn
        elif name in ("RG", "G"):
            parts = [round(255 * float(part)) for part in operands] * (3 if name == "G" else 1)
            colour = "#" + "".join(f"{part:02x}" for part in parts)
        elif name in ("m", "l"):
            point = turn.transform((float(operands[0]), float(operands[1])))
            path = [point] if name == "m" else [*path, point]
        elif name in ("S", "s", "n", "f", "B", "W"):
            if name == "S":
                found.setdefault(colour, []).append(MM_OF_POINT * np.array(path))
            path = [] if name != "W" else path
    return found


def pages_of(pdf: bytes) -> list[Page]:
    with pikepdf.open(io.BytesIO(pdf)) as file:
        return [
            Page(
                size_mm=(
                    MM_OF_POINT * float(page.mediabox[2]),
                    MM_OF_POINT * float(page.mediabox[3]),
                ),
                strokes=strokes_of(page),
            )
            for page in file.pages
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
    strips = [strip for some in measured_strips(result).values() for strip in some]
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


def test_sheets_of_a_larger_scale_follow_an_overview(result: Result) -> None:
    wanted = content(result, "letter", 250)
    pages = pages_of(plan_pages(wanted).pdf)
    frame = wanted.plan.frame_mm
    seen = 0

    assert len(pages) == 1 + len(wanted.plan.sheets) == 5
    for page, sheet in zip(pages[1:], wanted.plan.sheets, strict=True):
        assert sorted(page.size_mm) == pytest.approx((215.9, 279.4), abs=0.01)
        drawn = [line for line in page.strokes[INK["measured"]] if len(line) == 2]
        for strips in measured_strips(result).values():
            for strip in strips:
                level = wanted.plan.on_paper(sheet, strip)
                low, high = np.array(frame[:2]), np.array(frame[:2]) + frame[2:]
                if len(strip) == 2 and ((low < level) & (level < high)).all():
                    assert min(np.abs(line - level).max() for line in drawn) < TINY_MM
                    seen += 1
    assert seen


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
    drawn = plan_pages(replace(wanted, pictures=lambda *_: GroundPicture(red, raster)))
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


def test_a_line_is_cut_at_the_frame() -> None:
    frame = (0.0, 0.0, 10.0, 5.0)
    part = clipped(np.array([-5.0, 2.0]), np.array([15.0, 2.0]), frame)

    assert part is not None
    assert np.array(part) == pytest.approx(np.array([[0.0, 2.0], [10.0, 2.0]]))
    assert clipped(np.array([-5.0, 6.0]), np.array([15.0, 6.0]), frame) is None

"""Pages of a plan: plan.pdf with every sheet to scale, plan.png with all on one sheet."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import Name, PdfFile, PdfPages
from matplotlib.figure import Figure
from PIL import Image

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster, Plan, PlanSheet
from uavgram.model.result.result import Result
from uavgram.views.site_plan.legend import INCH_MM, PlanPage, draw_legend
from uavgram.views.survey.drawing import BLACK, PAPER, Drawing, Look
from uavgram.views.survey.figure import draw_figure
from uavgram.views.survey.sheet import draw_frame
from uavgram.views.survey.text_placement import TextRequest
from uavgram.views.survey.top_view import draw_survey, survey_texts
from uavgram.views.units import units_of

EDGE, FARTHEST = 1.3, 12.0
"""Width of the frame's line; largest distance of texts from their objects, in their heights."""

GRID_STEP = 230.0
"""Largest distance of the grid's lines, in units of the letters: 50 mm."""

QUALITY = 88
"""Quality for libjpeg at which no difference is visible on paper."""


class JpegPages(PdfPages):
    """`PdfPages` that stores colour pictures as JPEG, in a tenth of the space.

    Matplotlib has no option for it (its issue 25130), so two of its methods are replaced. If they
    are renamed one day, the pictures are stored without loss again.
    """

    def _ensure_file(self) -> Any:  # noqa: ANN401
        if self._file is None:
            make: Any = _JpegFile  # Matplotlib's own class has no types
            self._file = make(self._filename, metadata=self._metadata)
        return self._file


class _JpegFile(PdfFile):
    def _writeImg(self, data: Pixels, id: int, smask: Any = None) -> None:  # noqa: A002, ANN401, N802
        """Store (H, W, 3) RGB without opacity as JPEG, all else as Matplotlib does."""
        height, width, bands = data.shape
        if bands != 3 or smask is not None:
            super()._writeImg(data, id, smask)  # type: ignore[no-untyped-call]
            return
        file: Any = self
        name: Any = Name
        stored = io.BytesIO()
        Image.fromarray(data).save(stored, format="jpeg", quality=QUALITY)
        with rc_context({"pdf.compression": 0}):  # JPEG is compressed already
            file.beginStream(
                id,
                file.reserveObject("length of image stream"),
                {
                    "Type": name("XObject"),
                    "Subtype": name("Image"),
                    "Width": width,
                    "Height": height,
                    "ColorSpace": name("DeviceRGB"),
                    "BitsPerComponent": 8,
                    "Filter": name("DCTDecode"),
                },
            )
            file.currentstream.write(stored.getvalue())
            file.endStream()


PNG_DPI = 200
_FONTS: Any = {"pdf.fonttype": 42, "path.simplify": False, "font.family": "DejaVu Sans"}
"""Font settings: whole fonts, so that texts can be searched; no vertex of a line is left out."""


@dataclass(frozen=True, eq=False)
class GroundPicture:
    """Photo mosaic of the ground of a sheet: (H, W, 4) RGB and opacity, and its place."""

    rgba: Pixels
    raster: GroundRaster


Pictures = Callable[[Plan, PlanSheet], GroundPicture | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanContent:
    """Content of a plan.

    Attributes
    ----------
    result
        The survey.
    plan
        The plan as requested.
    overview
        The whole survey on one sheet; the same as `plan` if that has one sheet.
    pictures
        Function that makes the mosaic of a sheet; it may return None.
    notes
        Sentences on the picture.
    digest
        SHA-256 of results.json.
    """

    result: Result
    plan: Plan
    overview: Plan
    pictures: Pictures
    notes: tuple[str, ...]
    digest: str


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanFiles:
    """Files of a plan.

    Attributes
    ----------
    pdf, png
        The content of plan.pdf and of plan.png; equal input gives equal bytes.
    map_rgba
        (H, W, 4) pixels within the frame of plan.png.
    map_corners_m
        (3, 2) its outer corners in local metres: first row's first and last, last row's first.
    """

    pdf: bytes
    png: bytes
    map_rgba: Pixels
    map_corners_m: Floats


def plan_pages(content: PlanContent) -> PlanFiles:
    """Draw all sheets.

    Parameters
    ----------
    content
        The content to draw.
    """
    made = datetime.fromisoformat(content.result.provenance.created_utc)
    pdf = io.BytesIO()
    metadata = {"Title": f"{content.result.name}: plan", "CreationDate": made, "ModDate": made}
    with rc_context(_FONTS), JpegPages(pdf, metadata=metadata) as pages:
        png, rgba, corners = b"", np.zeros((1, 1, 4), np.uint8), np.zeros((3, 2))
        for number, page in enumerate(_sheets(content)):
            figure = draw_figure(page.drawing)
            figure.savefig(pages, format="pdf")
            if number == 0:
                png, rgba, corners = _pictures(page, figure)
    return PlanFiles(pdf=pdf.getvalue(), png=png, map_rgba=rgba, map_corners_m=corners)


def _pictures(page: PlanPage, figure: Figure) -> tuple[bytes, Pixels, Floats]:
    """Convert a sheet to PNG; also return the pixels within its frame and their world corners."""
    FigureCanvasAgg(figure)
    stored = io.BytesIO()
    figure.savefig(stored, format="png", dpi=PNG_DPI, metadata={"Software": "uavgram"})
    drawn = np.asarray(Image.open(stored).convert("RGBA"))
    px_of_mm = PNG_DPI / 25.4
    first = np.ceil(page.drawing.low * px_of_mm).astype(int)
    last = np.floor(page.drawing.high * px_of_mm).astype(int)
    inside = np.ascontiguousarray(drawn[first[1] : last[1], first[0] : last[0]])
    corners = np.array([first, [last[0], first[1]], [first[0], last[1]]]) / px_of_mm
    return stored.getvalue(), inside, page.in_world(corners)


def _sheets(content: PlanContent) -> Iterator[PlanPage]:
    """Yield the overview, then each sheet of a plan that has several."""
    plan, overview = content.plan, content.overview
    count = len(plan.sheets)
    if count == 1:
        yield draw_sheet(content, overview, overview.sheets[0], "one sheet")
        return
    title = f"overview of {count} sheets 1:{plan.scale}"
    yield draw_sheet(content, overview, overview.sheets[0], title, plan)
    for one in plan.sheets:
        yield draw_sheet(content, plan, one, f"sheet {one.number} of {count}")


def draw_sheet(
    content: PlanContent, plan: Plan, one: PlanSheet, title: str, outlined: Plan | None = None
) -> PlanPage:
    """Draw one sheet with its legend.

    Parameters
    ----------
    content
        The content to draw.
    plan, one
        The sheet.
    title
        Its title, below the name.
    outlined
        Plan of several sheets whose outlines are drawn on this one.
    """
    result, page = content.result, PlanPage(plan, one)
    drawing, units = page.drawing, units_of(result)
    picture = content.pictures(plan, one)
    if picture is not None:
        _show(page, picture)
    longest_m = float(drawing.high[0] - drawing.low[0]) / page.sheet.scale / 4
    draw_frame(
        drawing, page.sheet, longest_m, units, is_north_known=result.world.gauge == "world",
        on_picture=True, bar_note=partial(_on_paper, is_metric=units.length == "m"),
        most_step=GRID_STEP,
    )  # fmt: skip
    draw_survey(drawing, page.sheet, result, None, on_picture=True)
    marks = _outline_sheets(page, outlined) if outlined else _seams(page)
    drawing.lines("edge", [drawing.border], Look(BLACK, EDGE), closed=True)
    texts = survey_texts(drawing, page.sheet, result, None, is_full=True)
    drawing.place([*marks, *texts], reach=FARTHEST, least=1.0)
    notes = content.notes
    if drawing.missing:
        notes += (
            f"Texts for which there was no room: {drawing.missing}. A larger scale (--plan-scale) "
            "has more of them, and the report has all.",
        )
    foot = (
        f"uavgram {result.provenance.version}, {result.provenance.created_utc}; "
        f"results.json SHA-256 {content.digest}"
    )
    draw_legend(page, result, title, notes, foot)
    return page


def _on_paper(length_mm: float, *, is_metric: bool) -> str:
    """Describe the length of the scale bar, with which the printed scale can be checked."""
    words = f"{length_mm:.1f} mm" if is_metric else f"{length_mm / INCH_MM:.2f} in"
    return f" ({words} on paper)"


def _show(page: PlanPage, picture: GroundPicture) -> None:
    """Put the picture under the drawing; areas without photos are white."""
    raster = picture.raster
    opacity = picture.rgba[..., 3:].astype(np.uint16)
    rgb = (picture.rgba[..., :3] * opacity + 255 * (255 - opacity)) // 255
    size = np.array([raster.width, raster.height]) * raster.pixel_m * page.sheet.scale
    corner = page.sheet(np.array([raster.west_m, raster.north_m]))
    page.drawing.image(corner, size, rgb.astype(np.uint8))


def _seams(page: PlanPage) -> list[TextRequest]:
    """Draw the cut lines, right and below; return the names of the next sheets in shared strips."""
    plan, one, drawing, strip = page.plan, page.one, page.drawing, page.plan.overlap_mm
    (left, top), (right, bottom) = drawing.low, drawing.high
    names = []
    for other in plan.sheets:
        beside = other.column - one.column, other.row - one.row
        if beside == (1, 0):
            _cut(drawing, np.array([[right - strip, top], [right - strip, bottom]]))
        elif beside == (0, 1):
            _cut(drawing, np.array([[left, bottom - strip], [right, bottom - strip]]))
        middle = {
            (1, 0): (right - strip / 2, (top + bottom) / 2),
            (-1, 0): (left + strip / 2, (top + bottom) / 2),
            (0, 1): ((left + right) / 2, bottom - strip / 2),
            (0, -1): ((left + right) / 2, top + strip / 2),
        }.get(beside)
        if middle is not None:
            turn = -math.pi / 2 if beside[0] else 0.0
            spot = np.array([middle])
            name = f"sheet {other.number}"
            names.append(TextRequest(name, "sheet", spot, where="at", turn=turn, rank=-1))
    return names


def _cut(drawing: Drawing, line: Floats) -> None:
    """Draw a line to cut along, with marks outside the frame; texts keep clear of it."""
    drawing.reserve(np.array([*line.mean(axis=0), *np.maximum(np.ptp(line, axis=0) / 2, 0.3), 0]))
    drawing.lines("cuts", [line], Look(PAPER, 3.0), Look(BLACK, 1.0, dashes="6 3"))
    way = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    marks = [
        end + out * way * np.array([[0.3], [1.5]]) for end, out in ((line[0], -1), (line[1], 1))
    ]
    drawing.lines("marks", marks, Look(BLACK, 1.0))


def _outline_sheets(page: PlanPage, tiled: Plan) -> list[TextRequest]:
    """Outline the sheets of the tiled plan on an overview; return their numbers."""
    numbers, drawing = [], page.drawing
    for one in tiled.sheets:
        corners = np.array([[one.west_m, one.north_m], [one.east_m, one.south_m]])
        (left, top), (right, bottom) = page.sheet(corners)
        ring = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
        looks = Look(PAPER, 3.0), Look(BLACK, 1.0)
        drawing.lines("sheets", [ring], *looks, closed=True, clip=drawing.border)
        spot = np.clip(ring[:1], drawing.low, drawing.high) + 4.0
        numbers.append(TextRequest(str(one.number), "number", spot, where="at", rank=-1))
    return numbers

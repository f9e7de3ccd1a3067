"""Pages of a plan: plan.pdf with every sheet to scale, plan.png with all on one sheet."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import Name, PdfFile, PdfPages
from matplotlib.patches import Rectangle
from PIL import Image

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster, Plan, PlanSheet
from uavgram.model.result.result import Result
from uavgram.views.site_plan.drawing import draw_grid, draw_survey
from uavgram.views.site_plan.legend import draw_legend, outline_sheets
from uavgram.views.site_plan.sheet import INK, PAPER, QUIET, THIN_PT, Sheet

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
        sheets = _sheets(content)
        first = next(sheets)
        first.figure.savefig(pages, format="pdf")
        png, rgba, corners = _pictures(first)
        for page in sheets:
            page.figure.savefig(pages, format="pdf")
    return PlanFiles(pdf=pdf.getvalue(), png=png, map_rgba=rgba, map_corners_m=corners)


def _pictures(page: Sheet) -> tuple[bytes, Pixels, Floats]:
    """Convert a sheet to PNG; also return the pixels within its frame and their world corners."""
    FigureCanvasAgg(page.figure)
    stored = io.BytesIO()
    page.figure.savefig(stored, format="png", dpi=PNG_DPI, metadata={"Software": "uavgram"})
    drawn = np.asarray(Image.open(stored).convert("RGBA"))
    px_of_mm = PNG_DPI / 25.4
    left, bottom, across, up = page.plan.frame_mm
    low = np.ceil(np.array([left, bottom]) * px_of_mm).astype(int)
    high = np.floor(np.array([left + across, bottom + up]) * px_of_mm).astype(int)
    height = len(drawn)
    inside = np.ascontiguousarray(drawn[height - high[1] : height - low[1], low[0] : high[0]])
    corners = np.array([[low[0], high[1]], [high[0], high[1]], [low[0], low[1]]]) / px_of_mm
    # the canvas has whole pixels, the paper need not have
    corners[:, 1] += page.plan.paper_mm[1] - height / px_of_mm
    return stored.getvalue(), inside, page.in_world(corners)


def _sheets(content: PlanContent) -> Iterator[Sheet]:
    """Yield the overview, then each sheet of a plan that has several."""
    plan, overview = content.plan, content.overview
    is_tiled = len(plan.sheets) > 1
    first = _draw(content, overview, overview.sheets[0])
    title = "one sheet"
    if is_tiled:
        outline_sheets(first, plan)
        title = f"overview of {len(plan.sheets)} sheets 1:{plan.scale}"
    yield _finish(content, first, title)
    if is_tiled:
        for one in plan.sheets:
            sheet = _draw(content, plan, one)
            _seams(sheet)
            yield _finish(content, sheet, f"sheet {one.number} of {len(plan.sheets)}")


def _draw(content: PlanContent, plan: Plan, one: PlanSheet) -> Sheet:
    sheet = Sheet(plan, one)
    picture = content.pictures(plan, one)
    if picture is not None:
        _show(sheet, picture)
    return sheet


def _finish(content: PlanContent, sheet: Sheet, title: str) -> Sheet:
    result = content.result
    draw_survey(sheet, result)
    draw_grid(sheet, result)
    left, bottom, across, up = sheet.plan.frame_mm
    edge = Rectangle((left, bottom), across, up, fill=False, edgecolor=INK, linewidth=0.8, zorder=9)
    sheet.axes.add_patch(edge)
    notes = content.notes
    if sheet.left_out:
        notes += (
            f"Texts for which there was no room: {sheet.left_out}. A larger scale (--plan-scale) "
            "has more of them, and the report has all.",
        )
    foot = (
        f"uavgram {result.provenance.version}, {result.provenance.created_utc}; "
        f"results.json SHA-256 {content.digest}"
    )
    draw_legend(sheet, result, title, notes, foot)
    return sheet


def _show(sheet: Sheet, picture: GroundPicture) -> None:
    """Put the picture under the drawing; areas without photos are white."""
    raster = picture.raster
    opacity = picture.rgba[..., 3:].astype(np.uint16)
    rgb = (picture.rgba[..., :3] * opacity + 255 * (255 - opacity)) // 255
    size = np.array([raster.width, -raster.height]) * raster.pixel_m
    corners = np.array([raster.west_m, raster.north_m]) + np.array([[0.0, 0.0], size])
    (left, top), (right, bottom) = sheet.on_paper(corners)
    image = sheet.axes.imshow(
        rgb.astype(np.uint8), extent=(left, right, bottom, top), aspect="auto",
        interpolation="none", zorder=1,
    )  # fmt: skip
    image.set_clip_path(sheet.frame)


def _seams(sheet: Sheet) -> None:
    """Draw the cut lines, right and below, and the number of the next sheet in shared strips."""
    plan, one = sheet.plan, sheet.sheet
    left, bottom, across, up = plan.frame_mm
    right, top, strip = left + across, bottom + up, plan.overlap_mm
    for other in plan.sheets:
        beside = other.column - one.column, other.row - one.row
        if beside == (1, 0):
            _cut(sheet, np.array([[right - strip, bottom], [right - strip, top]]))
        elif beside == (0, 1):
            _cut(sheet, np.array([[left, bottom + strip], [right, bottom + strip]]))
        middle = {
            (1, 0): (right - strip / 2, bottom + up / 2),
            (-1, 0): (left + strip / 2, bottom + up / 2),
            (0, 1): (left + across / 2, bottom + strip / 2),
            (0, -1): (left + across / 2, top - strip / 2),
        }.get(beside)
        if middle is not None:
            turn = math.pi / 2 if beside[0] else 0.0
            sheet.name(f"sheet {other.number}", QUIET, 7.0, np.array([middle]), "at", turn=turn)


def _cut(sheet: Sheet, drawn: Floats) -> None:
    """Draw a line to cut along, with marks outside the frame; texts keep clear of it."""
    sheet.reserve(drawn.mean(axis=0), np.maximum(np.ptp(drawn, axis=0) / 2, 0.3))
    sheet.line(drawn, PAPER, 6 * THIN_PT)
    sheet.line(drawn, INK, 2 * THIN_PT, (6.0, 3.0))
    way = (drawn[1] - drawn[0]) / np.linalg.norm(drawn[1] - drawn[0])
    for end, outwards in ((drawn[0], -way), (drawn[1], way)):
        mark = end + outwards * np.array([[0.3], [1.5]])
        sheet.axes.plot(*mark.T, color=INK, linewidth=2 * THIN_PT)

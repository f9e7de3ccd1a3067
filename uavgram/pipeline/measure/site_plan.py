"""Write plan.pdf, plan.png and plan.tif: the survey to scale, on the ground as in the photos."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np

from uavgram.geometry.ground.top_view import View
from uavgram.imaging.photos.preview import apply_tone, choose_tone
from uavgram.imaging.top_view.brightness import PhotoCache, estimate_exposure_gains
from uavgram.io.exports.geotiff import write_turned_picture
from uavgram.io.outputs import replace_bytes
from uavgram.io.results.results_json import dump_results
from uavgram.model.maps import PLAN_PDF, GroundRaster, Plan, PlanPaper, PlanSheet
from uavgram.model.result.result import Result
from uavgram.pipeline.ground_picture import render_picture, select_photos
from uavgram.pipeline.measure.exports import transform_to_map
from uavgram.stages.products.plan_sheets import (
    FOOT_STEPS,
    METRIC_STEPS,
    find_surveyed_extent,
    lay_plan,
)
from uavgram.stages.products.top_view import choose_view, photo_pixels_m
from uavgram.views.site_plan import PlanContent, SheetPicture, plan_pages
from uavgram.views.units import units_of

PLAN_PNG, PLAN_MAP = "plan.png", "plan.tif"
PICTURE_DPI = 200


def write_plan(result: Result, wish: PlanPaper, folder: Path) -> None:
    """Write plan.pdf, plan.png and plan.tif.

    Parameters
    ----------
    result
        Result of a run.
    wish
        Paper and scale.
    folder
        Output folder.

    Raises
    ------
    GeometryError
        There is nothing to draw, or it takes too many sheets.
    InputError
        A photo cannot be read.
    OutputError
        A file cannot be written.
    """
    extent = find_surveyed_extent(result)
    steps = METRIC_STEPS if units_of(result).length == "m" else FOOT_STEPS
    plan = lay_plan(extent, wish.paper, wish.scale, steps)
    overview = plan if len(plan.sheets) == 1 else lay_plan(extent, wish.paper, None, steps)
    ground = _Ground(choose_view(result), overview)
    content = PlanContent(
        result=result,
        plan=plan,
        overview=overview,
        pictures=ground.picture,
        notes=ground.notes(),
        digest=hashlib.sha256(dump_results(result).encode()).hexdigest(),
    )
    made = plan_pages(content)
    replace_bytes(folder / PLAN_PDF, made.pdf)
    replace_bytes(folder / PLAN_PNG, made.png)
    corners, crs = transform_to_map(result, made.map_corners_m)
    tags = {"surface": "the adjusted ground plane: objects above it lean away from the photo"}
    write_turned_picture(made.map_rgba, corners, crs, tags, folder / PLAN_MAP)


class _Ground:
    """Pictures of the ground of all sheets, with equal brightness."""

    def __init__(self, view: View, overview: Plan) -> None:
        self._view = view
        raster = _raster(view, overview, overview.sheets[0])
        coarse = raster.coarser(max(max(raster.width, raster.height) // 512, 1))
        self._gains = estimate_exposure_gains(view, coarse, select_photos(view, coarse))
        picture = render_picture(view, coarse, select_photos(view, coarse, self._gains))
        bright = picture[picture[..., 3] > 0]
        self._tone = choose_tone(np.ascontiguousarray(bright[:, None, 2::-1]))
        self._photos: dict[int, PhotoCache] = {}

    def picture(self, plan: Plan, sheet: PlanSheet) -> SheetPicture:
        """Return the picture of one sheet."""
        raster = _raster(self._view, plan, sheet)
        if plan.scale not in self._photos:
            self._photos = {plan.scale: select_photos(self._view, raster, self._gains)}
        rgba = render_picture(self._view, raster, self._photos[plan.scale])
        rgb = np.ascontiguousarray(rgba[..., :3])
        return SheetPicture(np.dstack([apply_tone(rgb, self._tone), rgba[..., 3]]), raster)

    def notes(self) -> tuple[str, ...]:
        """Describe the changes to the photos."""
        note = "The photos' brightness is evened out, to be seen; their files stay as they are."
        return (note,)


def _raster(view: View, plan: Plan, sheet: PlanSheet) -> GroundRaster:
    """Return the ground raster of a sheet in local metres, no finer than the photos."""
    finest = float(np.nanmin(photo_pixels_m(view), initial=np.inf))
    pixel = plan.scale * 0.0254 / PICTURE_DPI
    pixel = max(pixel, finest) if math.isfinite(finest) else pixel
    return GroundRaster(
        west_m=sheet.west_m,
        north_m=sheet.north_m,
        pixel_m=pixel,
        width=math.ceil((sheet.east_m - sheet.west_m) / pixel),
        height=math.ceil((sheet.north_m - sheet.south_m) / pixel),
        crs=None,
    )

"""Make a metric top view of a project's photos."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.sightings import compute_motion
from uavgram.geometry.ground.top_view import FrameCovariance, View, compute_place_sigma
from uavgram.imaging.photos.preview import Pixels, Tone, apply_tone, choose_tone
from uavgram.io.exports.geotiff import (
    WINDOW_PX,
    read_reduced,
    write_colour_geotiff,
    write_float_geotiff,
)
from uavgram.io.files import check_folder_of_project
from uavgram.io.outputs import stage_output
from uavgram.model.arrays import Floats
from uavgram.model.maps import GroundRaster
from uavgram.model.message import Message
from uavgram.pipeline.ground_picture import warp_windows
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.messages import order_messages
from uavgram.stages.products.top_view import boxes, choose_view, lay_raster
from uavgram.views.formatting import BRIGHTENED
from uavgram.views.units import convert_sentence, units_of

PICTURE, SHEET, SIGMA = "rectified.tif", "rectified.png", "rectified_sigma.tif"
SHEET_PX = 3000
"""Longer side of the picture to print."""

SIGMA_STEP_PX = 16
"""Pixels of the top view for one pixel of the sigmas, which change slowly."""


@dataclass(frozen=True, kw_only=True)
class TopViewOutput:
    """Written top view.

    Attributes
    ----------
    covered
        Share of the raster that any photo shows.
    sigma_m
        Standard deviation of places in it: the median, and the 95 % quantile.
    """

    folder: Path
    raster: GroundRaster
    frames: tuple[str, ...]
    covered: float
    sigma_m: tuple[float, float]
    messages: tuple[Message, ...]


@limit_blas_threads
def rectify(
    project: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    frame: str | None = None,
    pixel_m: float | None = None,
    progress: Progress = silent,
) -> TopViewOutput:
    """Write rectified.tif, rectified.png and rectified_sigma.tif.

    Parameters
    ----------
    project
        The project file.
    output
        Folder; by default ``rectified`` in the project's output folder.
    frame
        One photo; by default the mosaic of all that have an adjusted pose.
    pixel_m
        Edge of a pixel on the ground; by default that of the photos.
    progress
        Shows long loops.

    Raises
    ------
    UavgramError
        A problem that the user can solve. Earlier files are untouched.
    """
    from uavgram.views.survey.figure import draw_map_sheet  # noqa: PLC0415 - loads matplotlib

    inputs = read_inputs(Path(project))
    computed = compute(inputs, curved=False)
    view = choose_view(computed.result, frame)
    raster = lay_raster(view, pixel_m)
    folder = Path(inputs.project.output) / "rectified" if output is None else Path(output)
    if output is None:
        check_folder_of_project(folder, Path(project).absolute().parent)
    tags = _tags(view)
    with stage_output(folder, inputs.files, inputs.photos.path) as staging:
        count = -(-raster.width // WINDOW_PX) * -(-raster.height // WINDOW_PX)
        windows = progress(warp_windows(view, raster), "rectifying", count)
        write_colour_geotiff(raster, windows, tags, staging / PICTURE)
        coarse = raster.coarser(SIGMA_STEP_PX)
        known = _frame_covariance(computed.refined.adjustment, view, inputs.project.picks_sigma_px)
        sigma = _sigma(view, coarse, boxes(view, coarse), known)
        write_float_geotiff(coarse, {"sigma_m": sigma}, tags | _SIGMA_TAGS, staging / SIGMA)
        picture = read_reduced(staging / PICTURE, SHEET_PX)
        pixel = raster.pixel_m * raster.width / picture.shape[1]
        shown, tone = _render_for_display(picture)
        caption = _caption(view, raster) + ("" if tone.is_identity else f", {BRIGHTENED}")
        sheet = draw_map_sheet(shown, pixel, caption, inputs.project.units)
        (staging / SHEET).write_bytes(sheet)
    return TopViewOutput(
        folder=folder.absolute(),
        raster=raster,
        frames=view.frame_id,
        covered=float((picture[..., 3] > 0).mean()),
        sigma_m=_quantiles(sigma),
        messages=order_messages(
            *computed.result.messages, *_other_planes(view), *_report_brightening(tone)
        ),
    )


def _quantiles(sigma_m: Floats) -> tuple[float, float]:
    median, large = np.nanquantile(sigma_m, [0.5, 0.95])
    return float(median), float(large)


_SIGMA_TAGS = {
    "sigma": "semi-major axis of the standard ellipse of a place picked in the picture [m]"
}


def _tags(view: View) -> dict[str, str]:
    world = view.result.world
    return {
        "software": f"uavgram {view.result.provenance.version}",
        "survey": view.result.name,
        "frames": "; ".join(view.frame_id),
        "surface": "the adjusted ground plane: objects above it lean away from the photo",
        "gauge": world.gauge,
    }


def _other_planes(view: View) -> tuple[Message, ...]:
    """Report areas that are on planes of their own."""
    first, *others = view.result.areas
    if not others:
        return ()
    names = ", ".join(repr(area.name) for area in others)
    text = (
        f"The top view is on the plane of the area {first.name!r}: higher objects, as there may be "
        f"in {names}, lean away from the photo, and distances there are those of that plane."
    )
    return (Message("warning", "rectified-on-one-plane", text),)


def _render_for_display(picture: Pixels) -> tuple[Pixels, Tone]:
    """Return RGB and opacity (H, W, 4) for display, and the applied tone."""
    rgb = np.ascontiguousarray(picture[..., :3])
    tone = choose_tone(rgb[picture[..., 3] > 0][:, None, ::-1])
    return np.dstack([apply_tone(rgb, tone), picture[..., 3]]), tone


def _report_brightening(tone: Tone) -> tuple[Message, ...]:
    if tone.is_identity:
        return ()
    text = (
        f"The photos are dark or flat, so {SHEET} is brightened to be seen. {PICTURE} keeps the "
        "photos' own brightness, which is data: stretch its contrast where you look at it, in QGIS "
        "by Layer properties, Symbology, Contrast enhancement."
    )
    return (Message("info", "rectified-brightened", text),)


def _caption(view: View, raster: GroundRaster) -> str:
    where = raster.crs or "local metres, north is arbitrary"
    pixel = convert_sentence(f"{raster.pixel_m:.3g} m", units_of(view.result))
    return f"{view.result.name}: {where}, pixel {pixel}, ground plane"


def _frame_covariance(adjustment: Adjustment, view: View, pick_sigma_px: float) -> FrameCovariance:
    row_of = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    frames = np.array([row_of[name] for name in view.frame_id])
    motion = compute_motion(adjustment.survey, adjustment.state)
    return FrameCovariance(
        covariance=adjustment.sight_covariance(frames),
        motion=motion[frames] if adjustment.problem.layout.readout else None,
        pixel_sigma_px=pick_sigma_px,
        roughness_sigma_m=adjustment.departure_m(0),
    )


def _sigma(view: View, raster: GroundRaster, reach: Floats, known: FrameCovariance) -> Floats:
    """Compute the sigma (H, W) of the place in each pixel; NaN where no photo shows it."""
    world = view.ground(raster, np.arange(float(raster.width)), np.arange(float(raster.height)))
    best = np.full(world.shape[:2], np.inf)
    sigma = np.full(world.shape[:2], np.nan)
    for index in range(len(view.rows)):
        if not np.isfinite(reach[index]).all():
            continue
        first_column, first_row, last_column, last_row = reach[index].astype(int)
        part = np.s_[max(first_row, 0) : last_row + 1, max(first_column, 0) : last_column + 1]
        pixel, off_nadir = view.look(index, world[part])
        shown = view.shows(pixel[..., 0], pixel[..., 1], off_nadir)
        nearer = shown & (off_nadir < best[part])
        best[part] = np.where(nearer, off_nadir, best[part])
        sigma[part][nearer] = compute_place_sigma(view, index, pixel[nearer], known)
    return sigma

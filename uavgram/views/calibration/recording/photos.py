"""One photo at a time: camera, corners, exaggerated residuals, and curves over the photos."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from uavgram.imaging.photos.preview import Preview
from uavgram.model.arrays import Bools
from uavgram.model.board import CalibrationResult
from uavgram.views.calibration.drawing_rules import SQRT2, residual_factor, rows_by_photo
from uavgram.views.calibration.recording.space import CAMERA, DEPTH_OF_CURRENT, SceneExtent
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import BAD, GOOD, MEASURED, OBSERVED, QUIET, REFINED, SEED, Rgb

RESIDUAL, TILT, STATUS = "plots/residual", "plots/tilt", "photo_status"
_STATES: dict[str, Rgb] = {"used": GOOD, "suspect": BAD, "removed": QUIET}


def log_photo_plots(recorder: Recorder, result: CalibrationResult) -> None:
    """Log every curve and the states."""
    photos = result.photos
    noise = np.full(len(photos.file), result.quality.sigma_px)
    for path, values, name, colour in (
        (f"{RESIDUAL}/adjusted", photos.rms_px / SQRT2, "residual [px]", REFINED),
        (f"{RESIDUAL}/left_out", photos.held_out_px, "when left out [px]", SEED),
        (f"{RESIDUAL}/sigma_of_corners", noise, "σ of a corner [px]", OBSERVED),
        (f"{TILT}/tilt", photos.tilt_deg, "tilt [°]", REFINED),
    ):
        recorder.curve(path, values, name, colour)
    recorder.states(STATUS, photos.status, _STATES, {state: state for state in _STATES})


PHOTO = f"{CAMERA}/photo"
OVERLAYS = ("residual_exaggerated", "residual_exaggerated_odd", "corners", "corners_odd", "first")


def log_board_photos(
    recorder: Recorder,
    result: CalibrationResult,
    room: SceneExtent,
    previews: Mapping[str, Preview],
) -> None:
    """Log the moving camera, its photo and all drawings on it.

    Parameters
    ----------
    recorder
        The open recording.
    result
        The calibration.
    room
        Sizes of the scene.
    previews
        Reduced photos by name.
    """
    poses, camera = result.photos.poses, result.calibration
    recorder.poses(CAMERA, poses.center_world_m, poses.world_from_camera)
    depth, size_px = DEPTH_OF_CURRENT * room.frustum_m, (camera.width_px, camera.height_px)
    recorder.camera(PHOTO, camera.parameters, size_px, depth)
    _pictures(recorder, result, previews)
    _overlay(recorder, result)


def _pictures(
    recorder: Recorder, result: CalibrationResult, previews: Mapping[str, Preview]
) -> None:
    """Log the JPEGs unchanged; a scale maps them to original pixels."""
    path, names = f"{PHOTO}/picture", result.photos.file
    recorder.static(path, rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=-10.0))
    scales = np.array([[*previews[name].scale, 1.0] for name in names])
    recorder.each(
        path,
        lambda some: rr.Transform3D.columns(scale=scales[some]),
        lambda some: rr.EncodedImage.columns(blob=[previews[names[i]].jpeg for i in some]),
    )


def _overlay(recorder: Recorder, result: CalibrationResult) -> None:
    corners = result.corners
    rows = list(rows_by_photo(result).values())
    odd: Bools = np.array([status != "used" for status in corners.status], dtype=np.bool_)
    tip = corners.pixel_px + residual_factor(result) * corners.residual_px
    arrows = np.stack([corners.pixel_px, tip], axis=1)
    for name, mask, colour in (
        ("residual_exaggerated", ~odd, SEED),
        ("residual_exaggerated_odd", odd, BAD),
    ):
        strips = [list(arrows[r[mask[r]]]) for r in rows]
        recorder.lines_of_frames(f"{PHOTO}/{name}", strips, colour, 2.0)
    first = corners.corner == 0
    for name, mask, colour, size in (
        ("corners", ~odd, MEASURED, 3.0),
        ("corners_odd", odd, BAD, 5.0),
        ("first", first, OBSERVED, 5.0),
    ):
        places = [corners.pixel_px[r[mask[r]]] for r in rows]
        recorder.dots_of_frames(f"{PHOTO}/{name}", places, colour, size)

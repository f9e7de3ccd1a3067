"""Writer of the review of a calibration, one complete file, and its layout."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb

from uavgram.imaging.photos.preview import Preview
from uavgram.model.arrays import Floats
from uavgram.model.board import CalibrationAccount, CalibrationResult
from uavgram.views.calibration.drawing_rules import SQRT2, mean_residual_factor, residual_factor
from uavgram.views.calibration.recording.documents import (
    CAMERA_PAGE,
    SHEET,
    SUMMARY,
    log_calibration_documents,
)
from uavgram.views.calibration.recording.image_maps import (
    COVERAGE,
    RESIDUALS,
    UNCERTAINTY,
    log_image_maps,
)
from uavgram.views.calibration.recording.photos import (
    OVERLAYS,
    PHOTO,
    RESIDUAL,
    STATUS,
    TILT,
    log_board_photos,
    log_photo_plots,
)
from uavgram.views.calibration.recording.space import (
    AROUND,
    BEFORE,
    SceneExtent,
    log_space,
    measure_extent,
)
from uavgram.views.recording.blueprint import layout, page_views, picture_view, plot, space_view
from uavgram.views.recording.scene import HALF_HEIGHT, HALF_WIDTH
from uavgram.views.recording.stream import open_recording

MARGIN = 0.02
# The photo's own drawings belong to the photo view, not to the space view.
_NOT_IN_SPACE = [f"- /{PHOTO}/{name}/**" for name in OVERLAYS]


def calibration_blueprint(account: CalibrationAccount, room: SceneExtent) -> rrb.Blueprint:
    """Lay out the views: cameras and photo above, maps and pages below."""
    result = account.result
    left = rrb.Vertical(
        rrb.Tabs(_around(room), _before(room), active_tab=0),
        rrb.Horizontal(
            _map(result, COVERAGE, "Coverage: corners; red: none"),
            _map(result, UNCERTAINTY, "Sigma of a direction [px]"),
            _map(
                result,
                RESIDUALS,
                f"Misses of corners (×{mean_residual_factor(result)}): mean blue, odd red",
            ),
        ),
        row_shares=[2.1, 1.0],
    )
    right = rrb.Vertical(
        _photo(result),
        rrb.StateTimelineView(origin=STATUS, name=_states(account)),
        rrb.Horizontal(*_plots(result)),
        page_views((SUMMARY, "Summary"), (SHEET, "Photo"), (CAMERA_PAGE, "Correlations, models")),
        row_shares=[4.6, 0.95, 1.9, 4.4],
    )
    return layout(rrb.Horizontal(left, right, column_shares=[1.35, 1]))


def _states(account: CalibrationAccount) -> str:
    status = account.result.photos.status
    words = [f"{status.count(one)} {one}" for one in ("used", "suspect", "removed")]
    total = len(status) + len(account.left_out)
    return f"{total} photos: {', '.join(words)}, {len(account.left_out)} without use"


def _around(room: SceneExtent) -> rrb.Spatial3DView:
    name = "Cameras around the board (blue: used; white: this photo)"
    contents = [f"+ /{AROUND}/**", *_NOT_IN_SPACE]
    up = np.array([0.0, 0.0, -1.0])
    eye = _eye(room.around_m, np.array([0.35, 0.95, -0.75]), up)
    return space_view(name, contents, *eye, up=up, origin=f"/{AROUND}")


def _before(room: SceneExtent) -> rrb.Spatial3DView:
    up = np.array([0.0, -1.0, 0.0])
    eye = _eye(room.before_m, np.array([0.8, -0.4, -0.6]), up)
    contents = [f"+ /{BEFORE}/**"]
    return space_view("Boards before the camera", contents, *eye, up=up, origin=f"/{BEFORE}")


def _eye(points_m: Floats, way: Floats, up: Floats) -> tuple[Floats, Floats]:
    """Place the eye and its target as near as all (N, 3) points allow."""
    back = way / np.linalg.norm(way)
    # axes of the view: back, right and (by a cross product) up
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    target = (points_m.min(axis=0) + points_m.max(axis=0)) / 2
    offset = points_m - target
    sideways, upward = np.abs(offset @ right), np.abs(offset @ np.cross(back, right))
    # each point needs the distance depth + offset / tangent of half the angle of view
    distance = (offset @ back + np.maximum(sideways / HALF_WIDTH, upward / HALF_HEIGHT)).max()
    return target + distance * back, target


def _map(result: CalibrationResult, origin: str, name: str) -> rrb.Spatial2DView:
    """Show the image with a margin, so that its edges are seen."""
    width, height = result.calibration.width_px, result.calibration.height_px
    edge = MARGIN * width
    return picture_view(f"/{origin}", name, (-edge, width + edge), (-edge, height + edge))


def _photo(result: CalibrationResult) -> rrb.Spatial2DView:
    factor = residual_factor(result)
    name = f"Photo: corners green, their misses ×{factor} orange, odd ones red"
    return _map(result, PHOTO, name)


def _plots(result: CalibrationResult) -> list[rrb.TimeSeriesView]:
    photos = result.photos
    residuals = np.concatenate([photos.rms_px / SQRT2, photos.held_out_px])
    return [
        plot(f"/{RESIDUAL}", "Residual blue, left out orange, σ white [px]", residuals),
        plot(f"/{TILT}", "Tilt [°]", photos.tilt_deg),
    ]


def write_calibration_recording(
    account: CalibrationAccount, previews: Mapping[str, Preview], path: Path
) -> None:
    """Write a Rerun recording with its blueprint inside.

    Parameters
    ----------
    account
        The calibration to show.
    previews
        Reduced photos by name.
    path
        The .rrd file.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    result = account.result
    room = measure_extent(result)
    made = account.provenance
    options = sorted(made.options.items())
    identity = (made.program, made.version, made.inputs, made.board, options)
    times = np.full(len(result.photos.file), np.nan)  # numbered photos: no times
    with open_recording(path, identity, result.calibration.name, times) as recorder:
        log_space(recorder, result, room)
        log_board_photos(recorder, result, room, previews)
        log_image_maps(recorder, result)
        log_photo_plots(recorder, result)
        log_calibration_documents(recorder, account)
        recorder.stream.send_blueprint(calibration_blueprint(account, room))

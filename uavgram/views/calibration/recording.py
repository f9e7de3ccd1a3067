"""Recording of a calibration: text pages, maps of the image, photos, and cameras in space.

The board's frame is OpenCV's: x along a row, y down the columns, z into the board. Points above
the board have a negative z, so the eye's up is -z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from uavgram.geometry.camera.projection import back_project
from uavgram.imaging.photos.preview import Preview
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import CalibrationAccount, CalibrationResult
from uavgram.views.calibration import drawings
from uavgram.views.calibration.verdict import (
    calibration_facts,
    judge_calibration,
    message_table,
    model_table,
    odd_corners,
    parameter_table,
    pixels_text,
)
from uavgram.views.formatting import number
from uavgram.views.recording.blueprint import layout, page_views, picture_view, plot, space_view
from uavgram.views.recording.scene import Eye
from uavgram.views.recording.stream import Recorder, open_recording
from uavgram.views.style import (
    BAD,
    GOOD,
    MEASURED,
    OBSERVED,
    QUIET,
    REFINED,
    SEED,
    Rgb,
)
from uavgram.views.survey.figure import draw_figure
from uavgram.views.survey.outlines import corner_rays, pyramids
from uavgram.views.tables import Cell, Cells, make_table, markdown, plain

SUMMARY, CAMERA_PAGE, SHEET = "documents/summary", "documents/camera", "documents/photo"
MAX_ODD = 20


def log_calibration_documents(recorder: Recorder, account: CalibrationAccount) -> None:
    """Log all pages."""
    result = account.result
    for path, text in (
        (SUMMARY, summary_page(account)),
        (CAMERA_PAGE, camera_page(result)),
    ):
        recorder.page(path, text)
    sheets = [photo_sheet(result, k) for k in range(len(result.photos.file))]
    recorder.sheets(SHEET, sheets)


def summary_page(account: CalibrationAccount) -> str:
    """Write the summary page."""
    verdict = judge_calibration(account)
    mark = "✔" if verdict.level == "good" else "⚠"
    parts = [
        f"# {mark} {plain(verdict.sentence)}",
        plain(verdict.counts),
        markdown(make_table("at a glance | *", calibration_facts(account))),
        "## Parameters",
        markdown(parameter_table(account.result.calibration)),
    ]
    if account.messages:
        parts += ["## Messages", markdown(message_table(account))]
    if account.left_out:
        parts += ["## Left out", markdown(make_table("photo | why", account.left_out))]
    return "\n\n".join(parts)


def camera_page(result: CalibrationResult) -> str:
    """Write the page with correlations and lens models."""
    names, matrix = result.calibration.parameter_names, result.calibration.correlation
    rows = [
        (Cell(name, look="value"), *map(_correlation, values))
        for name, values in zip(names, matrix.tolist(), strict=True)
    ]
    correlations = markdown(make_table(" | ".join(("", *names)), rows))
    return "\n\n".join(
        ["# Correlations", correlations, "# Lens models", markdown(model_table(result))]
    )


def _correlation(value: float) -> Cell:
    return Cell(number(value, 2, signed=True), look="value" * (abs(value) > 0.9))


def photo_sheet(result: CalibrationResult, k: int) -> str:
    """Write the sheet of one photo: how it fits, and its corners that do not fit."""
    photos, file = result.photos, result.photos.file[k]
    distance = float(np.linalg.norm(photos.poses.center_world_m[k]))
    facts: list[Cells] = [
        ("status", Cell(photos.status[k], photos.reason[k], look="value")),
        (
            "corners",
            f"{len(drawings.rows_by_photo(result)[file])} of {len(result.board.corner_board_m)}",
        ),
        ("residual per coordinate", f"{pixels_text(photos.rms_px[k] / drawings.SQRT2)} px"),
        ("when left out", f"{pixels_text(photos.held_out_px[k])} px"),
        ("tilt", f"{photos.tilt_deg[k]:.1f}°"),
        ("distance of the board's first corner", f"{distance:.3f} m"),
    ]
    parts = [f"# {plain(file)}", markdown(make_table(" | ", facts))]
    odd = odd_corners(result, k)
    if odd.rows:
        parts += ["## Corners that do not fit", markdown(odd, MAX_ODD)]
    return "\n\n".join(parts)


COVERAGE, RESIDUALS, UNCERTAINTY = "maps/coverage", "maps/residuals", "maps/uncertainty"
MAP_DPI = 72.0
"""Dots on an inch of the maps, whose units are millimetres: about 1,500 across."""


def log_image_maps(recorder: Recorder, result: CalibrationResult) -> None:
    """Log the three maps of the report as pictures."""
    for path, figure in (
        (COVERAGE, drawings.coverage_map(result)),
        (RESIDUALS, drawings.residual_map(result)),
        (UNCERTAINTY, drawings.uncertainty_map(result)),
    ):
        canvas = FigureCanvasAgg(draw_figure(figure.drawing))
        canvas.figure.set_dpi(MAP_DPI)
        canvas.draw()  # type: ignore[no-untyped-call]
        pixels = np.asarray(canvas.buffer_rgba())  # type: ignore[no-untyped-call]
        recorder.picture(path, Image.fromarray(pixels[..., :3]))


AROUND = "around_the_board"
CAMERA = f"{AROUND}/current_camera"
BEFORE = "before_the_camera"

FRUSTUM_SHARE = 0.14
DEPTH_OF_CURRENT = 2.0
"""Depth of the current camera, relative to that of the others."""

ELLIPSOID_ALPHA = 110
NEAR_BLACK: Rgb = (34, 38, 44)
SOFT_WHITE: Rgb = (228, 230, 233)
STATUS_COLOURS: dict[str, Rgb] = {"used": REFINED, "suspect": BAD, "removed": QUIET}


@dataclass(frozen=True, eq=False)
class SceneExtent:
    """Extent of the scene, from which drawings are scaled.

    Attributes
    ----------
    frustum_m
        Depth at which cameras are cut off.
    around_m, before_m
        (N, 3) points that must be visible: of cameras and board, in the board's frame; of camera
        and boards, in the camera's.
    frusta_m, boards_m
        (M, 10, 3) polylines of the cameras, (M, 5, 3) outlines of the boards, likewise.
    own_frustum_m
        (1, 10, 3) polyline of the camera in its own frame.
    """

    frustum_m: float
    around_m: Floats
    before_m: Floats
    frusta_m: Floats
    boards_m: Floats
    own_frustum_m: Floats


def measure_extent(result: CalibrationResult) -> SceneExtent:
    """Place cameras and boards."""
    poses, rim = result.photos.poses, _rim(result)
    center, turn = poses.center_world_m, poses.world_from_camera
    away = np.linalg.norm(center - result.board.corner_board_m.mean(axis=0), axis=1)
    depth = FRUSTUM_SHARE * float(np.median(away))
    corners = depth * _frame_corners(result)
    # world to camera: R^T (x - c)
    boards = np.einsum("mji,mkj->mki", turn, rim[None] - center[:, None])
    frusta = pyramids(center, turn, corners)
    # the current camera is drawn larger
    large = frusta + (DEPTH_OF_CURRENT - 1) * (frusta - center[:, None])
    return SceneExtent(
        frustum_m=depth,
        around_m=np.concatenate([rim, large.reshape(-1, 3)]),
        before_m=np.concatenate([np.zeros((1, 3)), corners, boards.reshape(-1, 3)]),
        frusta_m=frusta,
        own_frustum_m=pyramids(np.zeros((1, 3)), np.eye(3)[None], corners),
        boards_m=boards,
    )


def log_space(recorder: Recorder, result: CalibrationResult, room: SceneExtent) -> None:
    """Log the board, the cameras, and the boards in the camera's frame.

    Parameters
    ----------
    recorder
        The open recording.
    result
        The calibration.
    room
        Places of cameras and boards.
    """
    _board(recorder, result)
    poses = result.photos.poses
    colours = [STATUS_COLOURS[status] for status in result.photos.status]
    recorder.lines(f"{AROUND}/cameras", room.frusta_m, colours, 1.8)
    variance = np.diagonal(poses.covariance, axis1=1, axis2=2)[:, :3]
    recorder.static(
        f"{AROUND}/camera_3_sigma",
        rr.Ellipsoids3D(
            centers=poses.center_world_m,
            half_sizes=3 * np.sqrt(np.maximum(variance, 0.0)),
            colors=[(*colour, ELLIPSOID_ALPHA) for colour in colours],
            fill_mode="solid",
        ),
    )
    recorder.lines(f"{BEFORE}/boards", room.boards_m, colours, 2.2)
    recorder.lines(f"{BEFORE}/camera", room.own_frustum_m, OBSERVED, 3.0)
    boards = [[board] for board in room.boards_m]
    recorder.lines_of_frames(f"{BEFORE}/this_board", boards, OBSERVED, 5.0)


def _board(recorder: Recorder, result: CalibrationResult) -> None:
    """Log squares and rim of the board, in the board's frame."""
    board = result.board
    columns, rows = board.columns + 1, board.rows + 1
    row, column = np.divmod(np.arange(columns * rows), columns)
    black = (row + column) % 2 == 0
    low = np.stack([column - 1.0, row - 1.0], axis=1) * board.square_m
    offset = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * board.square_m
    place = low[:, None] + offset
    corners = np.concatenate([place, np.zeros((*place.shape[:2], 1))], axis=-1)
    colours = np.where(black[:, None], NEAR_BLACK, SOFT_WHITE).astype(np.uint8)
    recorder.squares(f"{AROUND}/board", corners, colours)
    recorder.lines(f"{AROUND}/board_rim", [_rim(result)], QUIET, 2.0)


def _rim(result: CalibrationResult) -> Floats:
    """Return the (5, 3) closed outline of the print, in the board's frame."""
    board = result.board
    x = np.array([-1.0, board.columns, board.columns, -1.0, -1.0]) * board.square_m
    y = np.array([-1.0, -1.0, board.rows, board.rows, -1.0]) * board.square_m
    return np.stack([x, y, np.zeros(5)], axis=1)


def _frame_corners(result: CalibrationResult) -> Floats:
    """Return the (4, 3) corners of the image frame at depth 1, with distortion."""
    camera = result.calibration
    size_px = np.array([camera.width_px, camera.height_px])
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * size_px - 0.5
    ray = back_project(camera.model, camera.parameters, corner)
    # where the distortion has no inverse, take the ray without distortion
    ray = np.where(np.isfinite(ray), ray, corner_rays(camera.parameters, *size_px.tolist()))
    return np.asarray(
        ray / np.maximum(ray[:, 2:], 0.2 * np.linalg.norm(ray, axis=1, keepdims=True))
    )


RESIDUAL, TILT, STATUS = "plots/residual", "plots/tilt", "photo_status"
_STATES: dict[str, Rgb] = {"used": GOOD, "suspect": BAD, "removed": QUIET}


def log_photo_plots(recorder: Recorder, result: CalibrationResult) -> None:
    """Log every curve and the states."""
    photos = result.photos
    noise = np.full(len(photos.file), result.quality.sigma_px)
    for path, values, name, colour in (
        (f"{RESIDUAL}/adjusted", photos.rms_px / drawings.SQRT2, "residual [px]", REFINED),
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
    rows = list(drawings.rows_by_photo(result).values())
    odd: Bools = np.array([status != "used" for status in corners.status], dtype=np.bool_)
    tip = corners.pixel_px + drawings.residual_factor(result) * corners.residual_px
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
                f"Misses of corners (×{drawings.mean_residual_factor(result)}): mean blue, odd red",
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
    return _view(name, AROUND, room.around_m, (0.35, 0.95, -0.75), (0.0, 0.0, -1.0), _NOT_IN_SPACE)


def _before(room: SceneExtent) -> rrb.Spatial3DView:
    name = "Boards before the camera"
    return _view(name, BEFORE, room.before_m, (0.8, -0.4, -0.6), (0.0, -1.0, 0.0), [])


def _view(
    name: str,
    origin: str,
    points_m: Floats,
    way: tuple[float, ...],
    up: tuple[float, ...],
    more: list[str],
) -> rrb.Spatial3DView:
    """Show all below an origin, with the eye as near as all (N, 3) points allow."""
    eye = Eye.fit(points_m, np.array(way) / np.linalg.norm(way), np.array(up))
    contents = [f"+ /{origin}/**", *more]
    return space_view(name, contents, eye.position_m, eye.target_m, up=up, origin=f"/{origin}")


def _map(result: CalibrationResult, origin: str, name: str) -> rrb.Spatial2DView:
    """Show one of the maps, which have the shape of the photos."""
    camera = result.calibration
    width = MAP_DPI / 25.4 * drawings.WIDTH
    return picture_view(
        f"/{origin}", name, (0.0, width), (0.0, width * camera.height_px / camera.width_px)
    )


def _photo(result: CalibrationResult) -> rrb.Spatial2DView:
    factor = drawings.residual_factor(result)
    name = f"Photo: corners green, their misses ×{factor} orange, odd ones red"
    width, height = result.calibration.width_px, result.calibration.height_px
    edge = MARGIN * width  # so that the edges of the photo are seen
    return picture_view(f"/{PHOTO}", name, (-edge, width + edge), (-edge, height + edge))


def _plots(result: CalibrationResult) -> list[rrb.TimeSeriesView]:
    photos = result.photos
    residuals = np.concatenate([photos.rms_px / drawings.SQRT2, photos.held_out_px])
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
        recorder.stream.send_blueprint(calibration_blueprint(account, room))
        log_space(recorder, result, room)
        log_board_photos(recorder, result, room, previews)
        log_image_maps(recorder, result)
        log_photo_plots(recorder, result)
        log_calibration_documents(recorder, account)

"""calibration.html: one self-contained page on a camera; and cameras as text for a terminal."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from uavgram.estimation.calibration.projection import CameraDifference
from uavgram.geometry.camera.properties import CameraProperties
from uavgram.imaging.photos.preview import shrink_jpeg
from uavgram.model.arrays import Floats
from uavgram.model.board import Board, CalibrationAccount, CalibrationResult, LensEffect
from uavgram.model.camera import Calibration, CameraProvenance
from uavgram.views.calibration import drawings
from uavgram.views.calibration.verdict import (
    calibration_facts,
    judge_calibration,
    message_table,
    model_table,
    odd_corners,
    parameter_table,
    percent,
    pixels_text,
)
from uavgram.views.formatting import chance, number
from uavgram.views.tables import Cell, Row, Table, align_columns, format_table, make_table
from uavgram.views.terminal import message_lines

_MAP_COLUMNS, _MAP_ROWS = 7, 5
NINETY_FIVE = 2.4477  # limit of a two-dimensional normal error, in sigmas


def camera_lines(
    calibration: Calibration,
    facts: CameraProperties,
    provenance: CameraProvenance | None = None,
    focal_mm: float | None = None,
) -> list[str]:
    """List the parameters with sigmas and correlations, and the facts that follow from them.

    Parameters
    ----------
    calibration, facts
        The camera, and the facts derived from it.
    provenance
        Origin of the file, if recorded.
    focal_mm
        Focal length on the sensor, if the sensor is known.
    """
    size = f"{calibration.width_px} x {calibration.height_px} px"
    return [
        f"{calibration.name}: {calibration.model} lens, {size}",
        *([] if provenance is None else provenance_lines(provenance)),
        "",
        format_table(parameter_table(calibration)),
        "",
        "correlations",
        align_columns(
            _correlation_cells(calibration, facts.correlation), right=tuple(range(1, 13))
        ),
        "",
        *fact_lines(facts, focal_mm),
    ]


def provenance_lines(provenance: CameraProvenance) -> list[str]:
    """Describe the origin of a camera file."""
    lines = [
        f"made by {provenance.program} {provenance.version}, {provenance.created_utc}: "
        f"{provenance.source}"
    ]
    if provenance.inputs:
        lines.append(f"from {len(provenance.inputs)} files, the first {provenance.inputs[0].path}")
    if provenance.board:
        lines.append(f"board: {provenance.board}")
    if provenance.variance_factor is not None:
        lines.append(f"variance factor {provenance.variance_factor:.3f}")
    return lines


def _correlation_cells(calibration: Calibration, correlation: Floats) -> list[tuple[str, ...]]:
    """Return the lower triangle of the correlations; the diagonal is omitted."""
    names = calibration.parameter_names
    rows = [
        (name, *(number(value, 2, signed=True) for value in correlation[i, :i].tolist()))
        for i, name in enumerate(names)
    ]
    filled = [row + ("",) * (len(names) - len(row)) for row in rows[1:]]
    return [("", *names[:-1]), *filled]


def fact_lines(facts: CameraProperties, focal_mm: float | None) -> list[str]:
    """Describe the parameters as angles, millimetres and pixels."""
    wide, high, diagonal = (number(math.degrees(angle), 2) for angle in facts.field_of_view_rad)
    on_sensor = "" if focal_mm is None else f", {focal_mm:.3f} mm on its sensor"
    offset = (
        f"({number(x, 2, signed=True)} ± {sigma:.2f})"
        for x, sigma in zip(
            facts.centre_offset_px.tolist(), facts.centre_sigma_px.tolist(), strict=True
        )
    )
    corners = ", ".join(number(d, 1, signed=True) for d in facts.corner_distortion_px.tolist())
    lines = [
        f"field of view      {wide} x {high} degrees, diagonal {diagonal}",
        f"focal length       {facts.equivalent_mm:.1f} mm on 35 mm film{on_sensor}",
        f"principal point    {' '.join(offset)} px from the image's centre",
        f"distortion         {corners} px at the corners (outward is positive)",
    ]
    if facts.fold_rad < math.pi / 2:
        lines.append(
            f"folds back         {math.degrees(facts.fold_rad):.1f} degrees from the optical axis"
            f" ({facts.share_without_rays:.1%} of the image has no rays)"
        )
    else:
        lines.append("folds back         nowhere")
    return lines


def difference_lines(
    first: Calibration, second: Calibration, difference: CameraDifference
) -> list[str]:
    """Describe the difference in projection of two cameras and its significance.

    Parameters
    ----------
    first, second
        The cameras.
    difference
        The second minus the first.
    """
    turn = ", ".join(number(math.degrees(angle), 4) for angle in difference.rotation_rad)
    worst = int(np.argmax(difference.size_px))
    u, v = difference.pixel_px[worst].tolist()
    return [
        f"{second.name} minus {first.name}, projected over the image of the first",
        f"after the turn that fits best: ({turn}) degrees about the camera's x, y, z",
        "",
        f"rms {difference.rms_px:.3f} px, largest {difference.max_px:.3f} px at "
        f"({u:.0f}, {v:.0f}); {difference.share_seen:.1%} of the image is seen by both",
        *_significance(difference),
        "",
        "size of the difference [px] over the image",
        align_columns(_map_cells(first, difference), right=tuple(range(_MAP_COLUMNS + 1))),
    ]


def _significance(difference: CameraDifference) -> list[str]:
    expected = difference.expected_rms_px
    if expected == 0:
        return ["neither file states errors, so the significance of the difference is unknown"]
    far = float(np.mean(difference.z > NINETY_FIVE))
    return [
        f"expected from both files' errors: rms {expected:.3f} px, so the difference is "
        f"{difference.rms_px / expected:.2f} sigmas (rms), {difference.z.max():.2f} at most",
        f"{far:.1%} of the image is outside its own 95 % ellipse (if the files are independent)",
    ]


def _map_cells(first: Calibration, difference: CameraDifference) -> list[tuple[str, ...]]:
    """Average the size of the difference around a raster of pixels (u across, v down)."""
    size = np.array([first.width_px, first.height_px])
    raster = np.array([_MAP_COLUMNS, _MAP_ROWS])
    column, row = np.minimum(
        ((difference.pixel_px + 0.5) / size * raster).astype(int), raster - 1
    ).T
    index = row * _MAP_COLUMNS + column
    count = np.bincount(index, minlength=_MAP_COLUMNS * _MAP_ROWS)
    total = np.bincount(index, difference.size_px, minlength=len(count))
    mean = np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0)
    u, v = ((np.arange(n) + 0.5) * length / n for n, length in zip(raster, size, strict=True))
    rows = [
        (f"{height:.0f}", *(number(value, 2) for value in line))
        for height, line in zip(v, mean.reshape(_MAP_ROWS, _MAP_COLUMNS).tolist(), strict=True)
    ]
    return [("v \\ u", *(f"{across:.0f}" for across in u)), *rows]


MAX_PHOTOS = 8


def calibration_lines(account: CalibrationAccount) -> list[str]:
    """Format the result of `uavgram calibrate`."""
    result = account.result
    camera, verdict = result.calibration, judge_calibration(account)
    facts = calibration_facts(account)
    width = max(len(question) for question, _ in facts)
    return [
        f"{camera.name}: {camera.model} lens, {camera.width_px} x {camera.height_px} px",
        "",
        format_table(parameter_table(camera)),
        "",
        verdict.sentence,
        verdict.counts,
        "",
        *(f"{question:<{width}}  {answer}" for question, answer in facts),
        "",
        *_photo_lines(result),
        "",
        *message_lines(account.messages),
    ]


PHOTO_WORDS = {"used": "used", "suspect": "SUSPECT", "removed": "removed"}
NO_PICTURES: Mapping[str, str] = MappingProxyType({})


def photo_table(result: CalibrationResult, pictures: Mapping[str, str] = NO_PICTURES) -> Table:
    """Return the photos, those that fit worst first.

    Parameters
    ----------
    result
        The calibration.
    pictures
        Addresses of small pictures by file.
    """
    photos, rows, table = result.photos, drawings.rows_by_photo(result), []
    for k in np.argsort(-photos.rms_px, kind="stable").tolist():
        file = photos.file[k]
        status = [result.corners.status[i] for i in rows[file]]
        odd = len(status) - status.count("used")
        cells = (
            Cell(file, picture=pictures.get(file, "")),
            f"{len(status)}" + (f", {odd} odd" if odd else ""),
            pixels_text(photos.rms_px[k] / drawings.SQRT2),
            pixels_text(photos.held_out_px[k]),
            f"{photos.tilt_deg[k]:.0f}°",
            f"{float(np.linalg.norm(photos.poses.center_world_m[k])):.2f} m",
            ": ".join(filter(None, (PHOTO_WORDS[photos.status[k]], photos.reason[k]))),
        )
        table.append(Row(cells, photos.status[k] != "used"))
    return make_table(
        "photo | >corners | >residual [px] | >when left out [px] | >tilt | >distance | status",
        table,
    )


def _photo_lines(result: CalibrationResult) -> list[str]:
    """List the photos that fit worst, the worst first; the report has them all."""
    table = photo_table(result)
    more = len(table.rows) - MAX_PHOTOS
    note = [f"and {more} photos that fit better"] if more > 0 else []
    return [*format_table(table._replace(rows=table.rows[:MAX_PHOTOS])).splitlines(), *note]


PICTURE_WIDTH_PX = 300
MAX_ODD = 60
"""Largest number of corners that do not fit; calibration.json has all."""


def render_calibration_report(account: CalibrationAccount, pictures: Mapping[str, bytes]) -> str:
    """Render the page as text; names written by people are escaped, nothing is loaded."""
    from uavgram.views.pages import page  # noqa: PLC0415 - loads jinja2, which text does not need

    result = account.result
    small = {file: _shrink(picture) for file, picture in pictures.items()}
    shown, outliers = _best_photo(result, small), odd_corners(result)
    return page(
        "calibration.html",
        account=account,
        result=result,
        camera=result.calibration,
        quality=result.quality,
        board=board_words(result.board),
        verdict=judge_calibration(account),
        facts=calibration_facts(account),
        parameters=parameter_table(result.calibration),
        correlations=_correlations(result),
        bow=_bow(result),
        models=model_table(result),
        messages=message_table(account),
        fit=_fit(account),
        custody=_custody(account),
        options=_options(account),
        coverage=drawings.coverage_map(result),
        residuals=drawings.residual_map(result),
        uncertainty=drawings.uncertainty_map(result),
        dial=drawings.tilt_dial(result),
        lengths=_lengths(account.effects),
        views=[(effect, drawings.length_map(result, effect, shown)) for effect in account.effects],
        photos=photo_table(result, small),
        left_out=make_table(
            "photo | why",
            ((Cell(file, picture=small.get(file, "")), why) for file, why in account.left_out),
        ),
        outliers=outliers._replace(rows=outliers.rows[:MAX_ODD]),
        more_outliers=len(outliers.rows) - MAX_ODD,
    )


def board_words(board: Board) -> str:
    """Describe the board in words."""
    side = f"{1000 * board.square_m:g} mm"
    if board.kind == "charuco":
        return (
            f"ChArUco board of {board.columns + 1} x {board.rows + 1} squares of {side}, markers "
            f"{board.dictionary} of {1000 * board.marker_m:g} mm"
        )
    return f"chessboard of {board.columns} x {board.rows} inner corners, squares of {side}"


def _correlations(result: CalibrationResult) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the name, then text and background of each cell of the full matrix."""
    names, matrix = result.calibration.parameter_names, result.calibration.correlation
    return [
        (name, [(number(value, 2, signed=True), _tint(value)) for value in row])
        for name, row in zip(names, matrix.tolist(), strict=True)
    ]


def _tint(value: float) -> str:
    """Return red for positive and blue for negative values, stronger with their size."""
    colour = (214, 84, 70) if value > 0 else (70, 120, 200)
    return f"rgba({colour[0]}, {colour[1]}, {colour[2]}, {0.65 * value * value:.2f})"


def _bow(result: CalibrationResult) -> str:
    if not len(result.bow_m):
        return ""
    sigma = np.sqrt(np.diag(result.bow_covariance_m2))
    return " and ".join(
        f"{1000 * height:+.2f} ± {1000 * error:.2f} mm"
        for height, error in zip(result.bow_m.tolist(), sigma.tolist(), strict=True)
    )


def _lengths(effects: Sequence[LensEffect]) -> Table:
    """Return median and largest effect on lengths: pose from known lengths, from the flight log."""
    rows = []
    for effect in effects:
        tilt = "straight down"
        if effect.tilt_deg:
            tilt = f"{effect.tilt_deg:g}° from straight down"
        if effect.lengths is None:
            rows.append((f"{tilt} (no ground is seen)", *["–"] * 4))
            continue
        values = effect.lengths.pose_fitted, effect.lengths.pose_known
        rows.append(
            (tilt, *(percent(float(size(v))) for v in values for size in (np.median, np.max)))
        )
    return make_table(
        "optical axis | >pose from known lengths: median | >largest | "
        ">pose from the flight log: median | >largest",
        rows,
    )


def _fit(account: CalibrationAccount) -> list[tuple[str, str]]:
    """Describe the quality of the adjustment."""
    quality, common = account.result.quality, account.common_error_px
    corners = f"{number(quality.sigma_px)} px"
    if common:
        corners += (
            f", of which {number(common)} px are common to all beside their own noise (print and "
            "flatness of the board, lens model, motion)"
        )
    photos = "too few photos"
    if quality.photo_factor is not None and quality.photo_probability is not None:
        photos = (
            f"{number(quality.photo_factor, 2)} times the variance that the corners explain "
            f"(chance: {chance(quality.photo_probability)})"
        )
        photos += "; the covariance was enlarged by it" * (quality.photo_probability < 0.01)
    held = "the others do not determine the camera"
    if quality.held_out_px is not None:
        held = f"{number(quality.held_out_px)} px per coordinate"
    return [
        ("corners: sigma per coordinate", corners),
        (
            "variance factor with these sigmas, before the last scaling",
            f"{number(quality.variance_factor, 2)} (chance of one as large: "
            f"{chance(quality.chi2_probability)})",
        ),
        ("photos disagree about the camera", photos),
        ("held-out error: photos predicted by a camera calibrated without them", held),
    ]


def _custody(account: CalibrationAccount) -> Table:
    """Return the photos with their checksums."""
    rows = (
        (Cell(one.path, look="mono"), str(one.size_bytes), Cell(one.sha256, look="mono"))
        for one in account.provenance.inputs
    )
    return make_table("photo | >bytes | SHA-256", rows)


def _options(account: CalibrationAccount) -> list[tuple[str, object]]:
    """Return the options, and the camera by its EXIF."""
    made = account.provenance
    exif = {
        "make": made.make,
        "model": made.camera_model,
        "focal length [mm]": made.focal_mm,
        "focus distance [m]": made.focus_m,
    }
    return [
        ("board", made.board),
        *made.options.items(),
        *((f"EXIF {key}", value) for key, value in exif.items() if value),
    ]


def _best_photo(result: CalibrationResult, pictures: Mapping[str, str]) -> str:
    """Choose the photo with the most corners as background."""
    counts = {file: len(rows) for file, rows in drawings.rows_by_photo(result).items()}
    known = [file for file in result.photos.file if file in pictures]
    return pictures[max(known, key=lambda file: counts[file])] if known else ""


def _shrink(picture: bytes) -> str:
    """Return a small copy of a JPEG as a data URL."""
    small = shrink_jpeg(picture, PICTURE_WIDTH_PX)
    return "data:image/jpeg;base64," + base64.b64encode(small).decode("ascii")

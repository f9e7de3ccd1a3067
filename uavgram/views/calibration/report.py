"""calibration.html: one self-contained page on a camera, for screen and paper."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence

import numpy as np

from uavgram.imaging.photos.preview import shrink_jpeg
from uavgram.model.board import Board, CalibrationAccount, CalibrationResult, LensEffect
from uavgram.views.calibration.drawings import (
    coverage_map,
    length_map,
    residual_map,
    rows_by_photo,
    tilt_dial,
    uncertainty_map,
)
from uavgram.views.calibration.text import photo_table
from uavgram.views.calibration.verdict import (
    calibration_facts,
    judge_calibration,
    message_table,
    model_table,
    odd_corners,
    parameter_table,
    percent,
)
from uavgram.views.formatting import chance, number
from uavgram.views.pages import page
from uavgram.views.tables import Cell, Table, make_table

PICTURE_WIDTH_PX = 300
MAX_ODD = 60
"""Largest number of corners that do not fit; calibration.json has all."""


def render_calibration_report(account: CalibrationAccount, pictures: Mapping[str, bytes]) -> str:
    """Render the page as text; names written by people are escaped, nothing is loaded."""
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
        coverage=coverage_map(result),
        residuals=residual_map(result),
        uncertainty=uncertainty_map(result),
        dial=tilt_dial(result),
        lengths=_lengths(account.effects),
        views=[(effect, length_map(result, effect, shown)) for effect in account.effects],
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
    counts = {file: len(rows) for file, rows in rows_by_photo(result).items()}
    known = [file for file in result.photos.file if file in pictures]
    return pictures[max(known, key=lambda file: counts[file])] if known else ""


def _shrink(picture: bytes) -> str:
    """Return a small copy of a JPEG as a data URL."""
    small = shrink_jpeg(picture, PICTURE_WIDTH_PX)
    return "data:image/jpeg;base64," + base64.b64encode(small).decode("ascii")

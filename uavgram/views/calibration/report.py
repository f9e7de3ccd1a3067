"""calibration.html: one self-contained page on a camera, for screen and paper."""

from __future__ import annotations

import base64
from collections.abc import Mapping

import numpy as np

from uavgram.imaging.photos.preview import shrink_jpeg
from uavgram.model.arrays import Floats
from uavgram.model.board import Board, CalibrationAccount, CalibrationResult, LensEffect, ModelScore
from uavgram.views.calibration.drawings import (
    SQRT2,
    coverage_map,
    length_map,
    residual_map,
    rows_by_photo,
    tilt_dial,
    uncertainty_map,
)
from uavgram.views.calibration.text import parameter_cells
from uavgram.views.calibration.verdict import (
    calibration_facts,
    judge_calibration,
    percent,
    pixels_text,
)
from uavgram.views.formatting import LEVEL_RANK, number
from uavgram.views.pages import page

PICTURE_WIDTH_PX = 300

Row = dict[str, str | bool]

PHOTO_WORDS = {"used": "used", "suspect": "SUSPECT", "removed": "removed"}


def render_calibration_report(account: CalibrationAccount, pictures: Mapping[str, bytes]) -> str:
    """Render the page as text; names written by people are escaped, nothing is loaded."""
    result = account.result
    shown = _best_photo(result, pictures)
    return page(
        "calibration.html",
        account=account,
        result=result,
        camera=result.calibration,
        quality=result.quality,
        board=board_words(result.board),
        verdict=judge_calibration(account),
        facts=calibration_facts(account),
        parameters=parameter_cells(result.calibration)[1:],
        correlations=_correlations(result),
        bow=_bow(result),
        models=_models(result),
        messages=sorted(account.messages, key=lambda message: LEVEL_RANK[message.level]),
        coverage=coverage_map(result),
        residuals=residual_map(result),
        uncertainty=uncertainty_map(result),
        dial=tilt_dial(result),
        lengths=[
            (effect, length_map(result, effect, shown), _length_row(effect))
            for effect in account.effects
        ],
        photos=_photos(result, pictures),
        left_out=[(file, reason, _picture(pictures, file)) for file, reason in account.left_out],
        outliers=_outliers(result),
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


def _models(result: CalibrationResult) -> list[Row]:
    best_aic = min((m.aic for m in result.models if m.aic is not None), default=0.0)
    best_bic = min((m.bic for m in result.models if m.bic is not None), default=0.0)
    return [
        Row(
            coefficients=str(model.coefficients),
            held=_held(model),
            aic="–" if model.aic is None else number(model.aic - best_aic, 1),
            bic="–" if model.bic is None else number(model.bic - best_bic, 1),
            chosen=model.is_chosen,
        )
        for model in result.models
    ]


def _held(model: ModelScore) -> str:
    if model.dropped:
        return f"no choice: {model.dropped}"
    known = model.held_out_px is not None
    return f"{model.held_out_px:.3f} px" if known else "cannot do without one of them"


def _length_row(effect: LensEffect) -> tuple[str, str, str, str]:
    """Return median and largest: pose from known lengths, then from the flight log."""
    if effect.lengths is None:
        return ("–",) * 4
    values: tuple[Floats, Floats] = (effect.lengths.pose_fitted, effect.lengths.pose_known)
    first, second = ((percent(float(np.median(v))), percent(float(v.max()))) for v in values)
    return (*first, *second)


def _photos(result: CalibrationResult, pictures: Mapping[str, bytes]) -> list[Row]:
    photos, rows = result.photos, rows_by_photo(result)
    order = np.argsort(-photos.rms_px, kind="stable")
    table = []
    for k in order.tolist():
        file = photos.file[k]
        status = [result.corners.status[i] for i in rows[file]]
        odd = len(status) - status.count("used")
        distance = float(np.linalg.norm(photos.poses.center_world_m[k]))
        table.append(
            Row(
                file=file,
                picture=_picture(pictures, file),
                corners=f"{len(status)}" + (f", {odd} odd" if odd else ""),
                rms=pixels_text(photos.rms_px[k] / SQRT2),
                held=pixels_text(photos.held_out_px[k]),
                tilt=f"{photos.tilt_deg[k]:.0f}°",
                distance=f"{distance:.2f} m",
                status=PHOTO_WORDS[photos.status[k]],
                reason=photos.reason[k],
                bad=photos.status[k] != "used",
            )
        )
    return table


def _best_photo(result: CalibrationResult, pictures: Mapping[str, bytes]) -> str:
    """Choose the photo with the most corners as background."""
    counts = {file: len(rows) for file, rows in rows_by_photo(result).items()}
    known = [file for file in result.photos.file if file in pictures]
    return _picture(pictures, max(known, key=lambda file: counts[file])) if known else ""


def _picture(pictures: Mapping[str, bytes], file: str) -> str:
    """Return a small copy as a data URL; empty if there is none."""
    if file not in pictures:
        return ""
    small = shrink_jpeg(pictures[file], PICTURE_WIDTH_PX)
    return "data:image/jpeg;base64," + base64.b64encode(small).decode("ascii")


def _outliers(result: CalibrationResult) -> list[tuple[str, str, str, str, str]]:
    """List the corners that fit worse than chance allows, worst first."""
    corners = result.corners
    rows = [i for i, status in enumerate(corners.status) if status != "used"]
    rows = [i for i in rows if result.photos.status[int(corners.photo[i])] != "removed"]
    rows.sort(key=lambda i: -float(corners.w[i]))
    size = np.linalg.norm(corners.residual_px, axis=1)
    return [
        (
            result.photos.file[int(corners.photo[i])],
            str(int(corners.corner[i])),
            f"{corners.pixel_px[i, 0]:.1f}, {corners.pixel_px[i, 1]:.1f}",
            f"{pixels_text(float(size[i]))} px",
            corners.status[i],
        )
        for i in rows
    ]

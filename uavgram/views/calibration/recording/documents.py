"""Text pages in the recording of a calibration: summary, camera, and a sheet for every photo."""

from __future__ import annotations

import numpy as np

from uavgram.model.board import CalibrationAccount, CalibrationResult
from uavgram.views.calibration.drawing_rules import SQRT2, pixels_text, rows_by_photo
from uavgram.views.calibration.text import parameter_cells
from uavgram.views.calibration.verdict import calibration_facts, judge_calibration
from uavgram.views.formatting import LEVEL_RANK, number
from uavgram.views.pages import plain, table
from uavgram.views.recording.stream import Recorder

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
    facts = [(plain(key), f"**{plain(value)}**") for key, value in calibration_facts(account)]
    messages = sorted(account.messages, key=lambda message: LEVEL_RANK[message.level])
    parts = [
        f"# {mark} {plain(verdict.sentence)}",
        plain(verdict.counts),
        table(("at a glance", ""), facts),
        "## Parameters",
        _parameters(account.result),
    ]
    if messages:
        rows = [(f"**{one.level}**", f"{plain(one.text)} `{one.code}`") for one in messages]
        parts += ["## Messages", table(("", ""), rows)]
    if account.left_out:
        rows = [(plain(file), plain(why)) for file, why in account.left_out]
        parts += ["## Left out", table(("photo", "why"), rows)]
    return "\n\n".join(parts)


def _parameters(result: CalibrationResult) -> str:
    rows = [
        (name, f"**{value}**", sigma, share)
        for name, value, sigma, share in parameter_cells(result.calibration)[1:]
    ]
    return table(("parameter", "value", "1 σ", "σ / value"), rows)


def camera_page(result: CalibrationResult) -> str:
    """Write the page with correlations and lens models."""
    names, matrix = result.calibration.parameter_names, result.calibration.correlation
    rows = [
        (f"**{name}**", *(_correlation(value) for value in values))
        for name, values in zip(names, matrix.tolist(), strict=True)
    ]
    models = [
        (
            f"**{model.coefficients}, taken**" if model.is_chosen else str(model.coefficients),
            "not determined"
            if model.dropped
            else pixels_text(np.nan if model.held_out_px is None else model.held_out_px),
            "–" if model.aic is None else number(model.aic, 1),
            "–" if model.bic is None else number(model.bic, 1),
        )
        for model in result.models
    ]
    header = ("distortion coefficients", "error in photos left out [px]", "Akaike", "Bayes")
    return "\n\n".join(
        ["# Correlations", table(("", *names), rows), "# Lens models", table(header, models)]
    )


def _correlation(value: float) -> str:
    text = number(value, 2, signed=True)
    return f"**{text}**" if abs(value) > 0.9 else text


def photo_sheet(result: CalibrationResult, k: int) -> str:
    """Write the sheet of one photo: how it fits, and its corners that do not fit."""
    photos, corners = result.photos, result.corners
    file = photos.file[k]
    rows = rows_by_photo(result)[file]
    distance = float(np.linalg.norm(photos.poses.center_world_m[k]))
    facts = [
        ("status", f"**{photos.status[k]}** {plain(photos.reason[k])}"),
        ("corners", f"{len(rows)} of {len(result.board.corner_board_m)}"),
        ("residual per coordinate", f"{pixels_text(photos.rms_px[k] / SQRT2)} px"),
        ("when left out", f"{pixels_text(photos.held_out_px[k])} px"),
        ("tilt", f"{photos.tilt_deg[k]:.1f}°"),
        ("distance of the board's first corner", f"{distance:.3f} m"),
    ]
    parts = [f"# {plain(file)}", table(("", ""), facts)]
    odd = sorted(
        (int(i) for i in rows if corners.status[int(i)] != "used"), key=lambda i: -corners.w[i]
    )
    if odd:
        size = np.linalg.norm(corners.residual_px, axis=1)
        cells = [
            (str(corners.corner[i]), f"{pixels_text(float(size[i]))} px", corners.status[i])
            for i in odd[:MAX_ODD]
        ]
        parts += ["## Corners that do not fit", table(("corner", "residual", ""), cells)]
    return "\n\n".join(parts)

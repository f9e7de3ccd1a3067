"""`CalibrationAccount` -> calibration.json (schema 1): every number of a calibration.

Units stand in the keys; NaN is null. Residuals are predicted minus found. Poses are those of the
camera in the board's frame (OpenCV's: x along a row, y down the columns, z into the board).
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from uavgram.io.outputs import replace_text
from uavgram.io.results.codec import plain
from uavgram.io.results.results_json import one_record_a_line
from uavgram.model.camera.calibration_account import CalibrationAccount, LensEffect
from uavgram.model.camera.calibration_result import CalibrationResult

SCHEMA = 1

Record = dict[str, Any]


def write_calibration(account: CalibrationAccount, path: str | Path) -> None:
    """Write calibration.json, in one step.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is untouched.
    """
    replace_text(Path(path), calibration_text(account))


def calibration_text(account: CalibrationAccount) -> str:
    """Text of calibration.json; the same account gives the same text."""
    result = account.result
    content = {
        "schema": SCHEMA,
        "provenance": _provenance(account),
        "camera": _camera(result),
        "board": _board(result),
        "options": _options(result),
        "quality": {**asdict(result.quality), "common_error_px": account.common_error_px},
        "models": [asdict(model) for model in result.models],
        "photos": _photos(result),
        "left_out": [{"file": file, "reason": reason} for file, reason in account.left_out],
        "corners": _corners(result),
        "maps": _maps(result),
        "length_uncertainty": [_effect(effect) for effect in account.effects],
        "messages": [message.record() for message in account.messages],
    }
    return one_record_a_line(content)


def _provenance(account: CalibrationAccount) -> Record:
    provenance = account.provenance
    return {
        "program": provenance.program,
        "version": provenance.version,
        "created_utc": provenance.created_utc,
        "source": provenance.source,
        "inputs": {
            one.path: {"sha256": one.sha256, "bytes": one.size_bytes} for one in provenance.inputs
        },
        "options": dict(provenance.options),
        "packages": dict(account.packages),
        "make": provenance.make,
        "camera_model": provenance.camera_model,
        "focal_mm": provenance.focal_mm,
        "focus_m": provenance.focus_m,
    }


def _camera(result: CalibrationResult) -> Record:
    camera = result.calibration
    sigma = np.sqrt(np.diag(camera.covariance))
    return {
        "name": camera.name,
        "model": camera.model,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "names": list(camera.parameter_names),
        "parameters": plain(camera.parameters),
        "sigma": plain(sigma),
        "covariance": plain(camera.covariance),
        "correlation": plain(result.calibration.correlation),
        "covariance_corners": plain(result.covariance_corners),
        "covariance_given_sigma": plain(result.covariance_given_sigma),
    }


def _board(result: CalibrationResult) -> Record:
    board = result.board
    return {
        "kind": board.kind,
        "columns": board.columns,
        "rows": board.rows,
        "square_m": board.square_m,
        "marker_m": board.marker_m,
        "dictionary": board.dictionary,
        "bow_m": plain(result.bow_m),
        "bow_covariance_m2": plain(result.bow_covariance_m2),
    }


def _options(result: CalibrationResult) -> Record:
    options = result.options
    record = {name: value for name, value in vars(options).items() if not name.startswith("_")} | {
        "prior": None
    }
    if options.prior is not None:
        record["prior"] = {
            "source": options.prior.source,
            "parameters": plain(options.prior.parameters),
            "information": plain(options.prior.information),
        }
    return record


def _photos(result: CalibrationResult) -> list[Record]:
    photos = result.photos
    return [
        {
            "file": file,
            "status": photos.status[k],
            "reason": photos.reason[k],
            "corners": int(np.sum(result.corners.photo == k)),
            "rms_px": plain(photos.rms_px[k]),
            "held_out_px": plain(photos.held_out_px[k]),
            "tilt_deg": plain(photos.tilt_deg[k]),
            "center_board_m": plain(photos.poses.center_world_m[k]),
            "board_from_camera": plain(photos.poses.world_from_camera[k]),
            "covariance": plain(photos.poses.covariance[k]),
        }
        for k, file in enumerate(photos.file)
    ]


def _corners(result: CalibrationResult) -> list[Record]:
    corners = result.corners
    return [
        {
            "photo": result.photos.file[photo],
            "corner": corner,
            "pixel_px": pixel,
            "residual_px": residual,
            "sigma_px": sigma,
            "w": w,
            "redundancy": redundancy,
            "status": status,
        }
        for photo, corner, pixel, residual, sigma, w, redundancy, status in zip(
            corners.photo.tolist(),
            corners.corner.tolist(),
            corners.pixel_px.tolist(),
            corners.residual_px.tolist(),
            corners.sigma_px.tolist(),
            corners.w.tolist(),
            corners.redundancy.tolist(),
            corners.status,
            strict=True,
        )
    ]


def _maps(result: CalibrationResult) -> Record:
    maps = result.maps
    return {
        "cell_px": plain(maps.cell_px),
        "corners": maps.corners.tolist(),
        "residual_px": plain(maps.residual_px),
        "residual_probability": plain(maps.residual_probability),
        "uncertainty_px": plain(maps.uncertainty_px),
    }


def _effect(effect: LensEffect) -> Record:
    record: Record = {"tilt_deg": effect.tilt_deg, "lengths": []}
    if effect.lengths is not None:
        lengths = effect.lengths
        record["lengths"] = [
            {
                "ends_px": plain(ends),
                "length_in_heights": plain(length),
                "pose_known": plain(known),
                "pose_fitted": plain(fitted),
            }
            for ends, length, known, fitted in zip(
                lengths.pixel_px,
                lengths.length,
                lengths.pose_known,
                lengths.pose_fitted,
                strict=True,
            )
        ]
    return record

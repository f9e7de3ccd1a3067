"""Writer of calibration.json (schema 1), with every number of a `CalibrationAccount`.

Units are in the keys; NaN is null. Residuals are predicted minus found. Poses are those of the
camera in the board's frame (OpenCV's: x along a row, y down the columns, z into the board).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.io.outputs import replace_text
from uavgram.io.results.codec import Record, Table, encode, join_records, records
from uavgram.io.results.results_json import dump_inputs, format_record_per_line
from uavgram.model.camera.calibration_result import (
    CalibrationAccount,
    CalibrationResult,
    CornerResults,
    LengthUncertainty,
    PhotoResults,
)

SCHEMA = 1

_PHOTOS = Table(PhotoResults, elsewhere=("poses", "unusable"))
_CORNERS = Table(CornerResults)
_LENGTHS = Table(LengthUncertainty)


def write_calibration(account: CalibrationAccount, path: str | Path) -> None:
    """Write calibration.json, in one step.

    Raises
    ------
    OutputError
        The file cannot be written; an earlier one is unchanged.
    """
    replace_text(Path(path), calibration_text(account))


def calibration_text(account: CalibrationAccount) -> str:
    """Return the text of calibration.json; the same account gives the same text."""
    result = account.result
    content = {
        "schema": SCHEMA,
        "provenance": _provenance(account),
        "camera": _camera(result),
        "board": _without(result.board, "corner_board_m")
        | {"bow_m": encode(result.bow_m), "bow_covariance_m2": encode(result.bow_covariance_m2)},
        "options": encode(result.options),
        "quality": encode(result.quality) | {"common_error_px": account.common_error_px},
        "models": encode(result.models),
        "photos": _photos(result),
        "left_out": [{"file": file, "reason": reason} for file, reason in account.left_out],
        "corners": [
            row | {"photo": result.photos.file[row["photo"]]}
            for row in _CORNERS.dump(result.corners)
        ],
        "maps": encode(result.maps),
        "length_uncertainty": [
            {
                "tilt_deg": effect.tilt_deg,
                "lengths": [] if effect.lengths is None else _LENGTHS.dump(effect.lengths),
            }
            for effect in account.effects
        ],
        "messages": [message.record() for message in account.messages],
    }
    return format_record_per_line(content)


def _without(value: object, *keys: str) -> Record:
    """Encode a data class without some fields."""
    return {key: field for key, field in encode(value).items() if key not in keys}


def _provenance(account: CalibrationAccount) -> Record:
    provenance = account.provenance
    return _without(provenance, "board", "variance_factor") | {
        "inputs": dump_inputs(provenance.inputs),
        "options": dict(provenance.options),
        "packages": dict(account.packages),
    }


def _camera(result: CalibrationResult) -> Record:
    camera = result.calibration
    record: Record = encode(camera)
    return record | {
        "names": list(camera.parameter_names),
        "sigma": encode(np.sqrt(np.diag(camera.covariance))),
        "correlation": encode(camera.correlation),
        "covariance_corners": encode(result.covariance_corners),
        "covariance_given_sigma": encode(result.covariance_given_sigma),
    }


def _photos(result: CalibrationResult) -> list[Record]:
    corners = np.bincount(result.corners.photo, minlength=len(result.photos.file)).tolist()
    poses = records(  # their world is the board
        center_board_m=result.photos.poses.center_world_m,
        board_from_camera=result.photos.poses.world_from_camera,
        covariance=result.photos.poses.covariance,
    )
    rows = join_records(_PHOTOS.dump(result.photos), poses)
    return [row | {"corners": count} for row, count in zip(rows, corners, strict=True)]

"""JSON files of other commands: plan.json, calibration.json (schema 1), and a batch's state.

In calibration.json units are in the keys, and NaN is null. Residuals are predicted minus found.
Poses are those of the camera in the board's frame (OpenCV's: x along a row, y down the columns, z
into the board).

The state of a batch has a line of JSON for each measured survey, appended when it ends. A killed
batch leaves at most an incomplete line, which is ignored.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.input_files import read_text
from uavgram.io.files import digest_file
from uavgram.io.json_codec import (
    Record,
    Table,
    encode,
    from_record,
    join_records,
    parse_json,
    records,
)
from uavgram.io.outputs import replace_text
from uavgram.io.results.results_json import dump_inputs, format_record_per_line
from uavgram.model.batch import FileState, SurveyRecord
from uavgram.model.board import (
    CalibrationAccount,
    CalibrationResult,
    CornerResults,
    LengthUncertainty,
    PhotoResults,
)
from uavgram.model.planned import FlightPlanned
from uavgram.model.provenance import InputDigest

SCHEMA = 1
_MARK, _BEGINNING = '"plan_schema"', 200


def write_plan(plan: FlightPlanned, path: str | Path) -> None:
    """Write a plan.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    messages = [message.record() for message in plan.messages]
    record = {"plan_schema": SCHEMA} | encode(plan) | {"messages": messages}
    replace_text(Path(path), format_record_per_line(record))


def is_plan(path: Path) -> bool:
    """Return whether a file begins like those of `write_plan`."""
    try:
        with path.open(encoding="utf-8") as file:
            return _MARK in file.read(_BEGINNING)
    except (OSError, UnicodeDecodeError):
        return False


def read_plan(path: str | Path) -> FlightPlanned:
    """Read a plan.

    Raises
    ------
    InputError
        The file cannot be read, or is not a plan of this program.
    """
    path = Path(path)
    text = read_text(path, "so it is no plan")
    try:
        content = parse_json(path, text)
    except json.JSONDecodeError as fault:
        raise InputError(
            path, f"is not complete JSON ({fault.msg}): plan again", fault.lineno
        ) from fault
    if not isinstance(content, dict) or "plan_schema" not in content:
        raise InputError(path, "is no plan: name the plan.json that `uavgram plan` wrote")
    if content["plan_schema"] != SCHEMA:
        raise InputError(
            path,
            f"is of plan_schema {content['plan_schema']!r}, this program reads {SCHEMA}: "
            "plan again",
        )
    try:
        return from_record(FlightPlanned, content)
    except (KeyError, TypeError, ValueError) as fault:
        raise InputError(path, f"was edited ({fault!r}): plan again") from fault


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


STATE = "batch-state.jsonl"


def read_records(path: Path) -> dict[str, SurveyRecord]:
    """Read the newest record of each project, by its file; empty where there is no state.

    Unreadable lines, such as those of another version, are left out: the survey is measured again.
    """
    try:
        lines = path.read_bytes().splitlines()
    except OSError:
        return {}
    found: dict[str, SurveyRecord] = {}
    for line in lines:
        try:
            record = from_record(SurveyRecord, json.loads(line))
        except (ValueError, TypeError, KeyError, AttributeError):
            continue
        found[record.row.project] = record
    return found


def append_record(path: Path, record: SurveyRecord) -> None:
    """Append a record; it is on disk when this returns.

    Raises
    ------
    OSError
        The disk is full or not writable.
    """
    line = json.dumps(encode(record), ensure_ascii=False).encode() + b"\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab+") as stream:
        if stream.tell():
            stream.seek(-1, os.SEEK_END)
            if stream.read(1) != b"\n":
                line = b"\n" + line  # a killed batch left the last one incomplete
        stream.write(line)
        stream.flush()
        os.fsync(stream.fileno())


def read_file_stat(path: str | Path) -> tuple[int, int]:
    """Return size and modification time [ns]; (-1, -1) for a missing file."""
    try:
        found = Path(path).stat()
    except OSError:
        return -1, -1
    return found.st_size, found.st_mtime_ns


def read_file_state(path: str | Path) -> FileState:
    """Return the current state of a file; a change while it is read is noticed next time.

    Raises
    ------
    InputError
        It cannot be read.
    """
    _, changed = read_file_stat(path)
    digest: InputDigest = digest_file(path)
    return FileState(
        path=str(path), size_bytes=digest.size_bytes, changed_ns=changed, sha256=digest.sha256
    )


def is_unchanged(state: FileState) -> bool:
    """Return whether a file has its earlier content; a new modification time alone is no change."""
    size, changed = read_file_stat(state.path)
    if size != state.size_bytes:
        return False
    return changed == state.changed_ns or digest_file(state.path).sha256 == state.sha256

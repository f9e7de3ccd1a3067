"""Build the JSON objects that commands print for other programs (`--json`).

Units are SI and in the keys' names. Unknown numbers are NaN, and null in print. Keys
of `run` are those of results.json, which holds everything else.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from uavgram.estimation.calibration.projection import CameraDifference
    from uavgram.model.message import Message
    from uavgram.model.result.result import Result
    from uavgram.pipeline.cameras import CameraRead
    from uavgram.pipeline.check import CheckedProject

SCHEMA = 1
_OF_A_RUN = ("schema", "name", "verdict", "measurements", "checks", "messages")


def run_object(result: Result, folder: Path) -> dict[str, Any]:
    """Make an object of a run: its verdict, measurements, checks, messages and files.

    `written_beside` has the new file of each result that was open in another program.

    Parameters
    ----------
    result
        Result of the run.
    folder
        Folder of its files.
    """
    from uavgram.io.outputs import LAST_MOVED, find_latest
    from uavgram.io.results.results_json import dump_results

    whole = json.loads(dump_results(result))
    folder = folder.absolute()
    paths = sorted(path for path in folder.iterdir() if path.is_file())
    beside = {path.name: find_latest(path).name for path in paths if find_latest(path) != path}
    files = {"output": str(folder), "results": str(find_latest(folder / LAST_MOVED))}
    return {key: whole[key] for key in _OF_A_RUN} | files | {"written_beside": beside}


def check_object(checked: CheckedProject, project: Path) -> dict[str, Any]:
    """Make an object of a checked project: its photos and messages."""
    photos, frames, pairing = checked.inputs.photos, checked.posed.frames, checked.posed.pairing
    rows = []
    for i, name in enumerate(frames.frame_id):
        row: dict[str, Any] = {
            "image": name,
            "width_px": int(photos.width_px[i]),
            "height_px": int(photos.height_px[i]),
            "time_utc_s": float(frames.time_utc_s[i]),
            "matched": bool(frames.matched[i]),
            "reason": frames.reason[i],
        }
        if pairing is not None and pairing.event_index[i] >= 0:
            row["event"] = {
                "number": int(pairing.event_index[i]) + 1,
                "status": pairing.status[i],
                "residual_s": float(pairing.residual_s[i]),
            }
        rows.append(row)
    path = str(project.absolute())
    return {"schema": SCHEMA, "project": path, "photos": rows, **_messages(checked.messages)}


def camera_object(read: CameraRead) -> dict[str, Any]:
    """Make an object of a camera: its parameters in order, their covariance, and their meaning."""
    from uavgram.geometry.camera.properties import compute_camera_properties

    camera = read.calibration
    facts = compute_camera_properties(camera)
    return {
        "schema": SCHEMA,
        "path": str(read.path),
        "name": camera.name,
        "model": camera.model,
        "width_px": camera.width_px,
        "height_px": camera.height_px,
        "parameters": dict(zip(camera.parameter_names, camera.parameters.tolist(), strict=True)),
        "covariance": camera.covariance.tolist(),
        "field_of_view_deg": [math.degrees(one) for one in facts.field_of_view_rad],
        "focal_length_35mm_mm": float(facts.equivalent_mm),
        "corner_distortion_px": facts.corner_distortion_px.tolist(),
        **_messages(read.messages),
    }


def difference_object(
    first: CameraRead, second: CameraRead, difference: CameraDifference
) -> dict[str, Any]:
    """Make an object of the differences of a second camera, over the image of the first.

    Parameters
    ----------
    first, second
        The cameras.
    difference
        Difference between their projections.
    """
    return {
        "schema": SCHEMA,
        "path": str(first.path),
        "compared_with": str(second.path),
        "pixel_px": difference.pixel_px.tolist(),
        "difference_px": difference.difference_px.tolist(),
        "covariance_px2": difference.covariance_px2.tolist(),
        "rotation_rad": difference.rotation_rad.tolist(),
        "share_seen": float(difference.share_seen),
        **_messages((*first.messages, *second.messages)),
    }


def _messages(messages: Sequence[Message]) -> dict[str, Any]:
    return {"messages": [message.record() for message in messages]}

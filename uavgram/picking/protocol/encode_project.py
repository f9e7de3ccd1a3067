"""The project as JSON for the page: photos, camera, clock, known points, flight and its plan."""

from __future__ import annotations

import math
from itertools import chain
from pathlib import Path

import numpy as np

from uavgram.errors import UavgramError
from uavgram.geometry.camera.properties import compute_camera_properties
from uavgram.imaging.photos.tiles import level_count
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration, CameraProvenance
from uavgram.model.flight_log import Track
from uavgram.model.message import Message
from uavgram.model.message_catalogue import CAMERA, entry_of
from uavgram.model.naming import PLATE_CORNERS, Units
from uavgram.model.planned import FlightPlanned
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_quantities import number, quantity_words, table_words
from uavgram.picking.protocol.encode_survey import messages_json
from uavgram.picking.protocol.parse import PhotoSize
from uavgram.pipeline.cameras import read_camera
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import PosedFrames
from uavgram.pipeline.pick.live_survey import LiveSurvey
from uavgram.stages.camera import UNKNOWN_CAMERA
from uavgram.synthetic.accident_scene import PAINTED_LABELS, TAPE_FILE, is_sample
from uavgram.views.calibration.report import fact_lines, provenance_lines
from uavgram.views.calibration.verdict import GOOD_FOCAL, focal_share, parameter_table, percent
from uavgram.views.flight_plan import LineRow, PlateRow, line_rows, plate_rows, plate_side
from uavgram.views.units import convert_sentence

CENTRE_SIGMA_SHARE = 0.01
"""Largest sigma of the principal point without a warning, as a share of the image width.

A larger error tilts every single photo.
"""

MAX_VERTICES = 300

BEFORE_AND_AFTER = 0.25
"""Time shown before the first and after the last photo, as a share of the time between them."""

MIN_BEFORE_S = 5.0

NOT_SOUGHT = (
    "The program does not look for them yet: the project file must say what is printed on them "
    "and how large they are, such as "
    "targets: {{family: aruco-4x4-50, side_m: {side:g}, sigma_m: 0.001}}"
)


def photos_json(survey: LiveSurvey, sizes: tuple[PhotoSize, ...]) -> list[m.Photo]:
    """Return the photos in the order of their numbers, with match to the log and seed pose."""
    posed = survey.posed
    frames = None if posed is None else posed.frames
    seeds = _seeds(posed)
    pairs = _pairs(posed)
    digests = survey.inputs.digests[-len(sizes) :]  # photos come last
    return [
        {
            "name": photo.name,
            "digest": digests[k].sha256[:16],
            "width_px": photo.width_px,
            "height_px": photo.height_px,
            "levels": level_count(photo.width_px, photo.height_px),
            "matched": bool(frames is not None and frames.matched[k]),
            "reason": "" if frames is None else frames.reason[k],
            "file_time_s": number(survey.inputs.photos.file_time_s[k]),
            "time_utc_s": None if frames is None else number(frames.time_utc_s[k]),
            "seed": seeds.get(photo.name),
            "event": pairs.get(photo.name),
        }
        for k, photo in enumerate(sizes)
    ]


def control_lines_json(inputs: Inputs) -> list[m.ControlLine]:
    """Return lines of known position, and the labels that were picked on each."""
    lines = inputs.control_lines
    return [
        {"name": name, "points": list(points)}
        for name, points in zip(lines.name, lines.points, strict=True)
    ]


def list_hidden_labels(inputs: Inputs) -> list[str]:
    """Return the labels of tables that the page does not show, and those painted in the sample."""
    names = {*chain(*inputs.known.points, *inputs.control_lines.points)}
    return sorted(names.union(PAINTED_LABELS if is_sample(Path(inputs.project_path)) else ()))


def sample_json(inputs: Inputs) -> m.Sample | None:
    """Return file and text of the sample's tape readings; None for other projects."""
    file = inputs.folder / TAPE_FILE
    if not is_sample(Path(inputs.project_path)) or not file.is_file():
        return None
    return {"file": str(file), "text": file.read_text(encoding="utf-8", errors="replace")}


def _seeds(posed: PosedFrames | None) -> dict[str, m.SeedPose]:
    """Return seed poses by photo: centres (e n u), sigmas [m], total sigma of directions [deg]."""
    if posed is None or posed.telemetry is None:
        return {}
    poses = posed.telemetry.poses
    sigma = np.sqrt(np.einsum("nii->ni", poses.covariance))
    return {
        name: {
            "east_m": number(poses.center_world_m[k, 0], 2),
            "north_m": number(poses.center_world_m[k, 1], 2),
            "up": quantity_words(float(poses.center_world_m[k, 2]), math.nan, "m"),
            "sigma": table_words(float(sigma[k, :3].max()), 2),
            "turn_sigma_deg": number(np.degrees(np.linalg.norm(sigma[k, 3:])), 2),
        }
        for k, name in enumerate(poses.frame_id)
    }


def _pairs(posed: PosedFrames | None) -> dict[str, m.EventFit]:
    """Return the fit of each photo to the camera event it was paired with."""
    if posed is None or posed.pairing is None:
        return {}
    pairing = posed.pairing
    return {
        name: {
            "status": pairing.status[k],
            "residual_s": number(pairing.residual_s[k], 4),
            "why": pairing.reason[k],
        }
        for k, name in enumerate(pairing.frame_id)
    }


def clock_json(survey: LiveSurvey) -> m.Clock | None:
    """Return the camera clock minus UTC as assumed before the adjustment; None without a log."""
    posed = survey.posed
    if posed is None or posed.telemetry is None or survey.inputs.log is None:
        return None
    unused = () if posed.pairing is None else posed.pairing.unused_reason
    return {
        "text": quantity_words(
            float(posed.frames.clock_offset_s), float(posed.frames.clock_offset_sigma_s), "s"
        ),
        "sigma_s": number(posed.frames.clock_offset_sigma_s),
        "log": Path(survey.inputs.log.path).name,
        "events": 0 if posed.pairing is None else len(posed.pairing.event_index) + len(unused),
        "unused": list(unused),
    }


def camera_json(survey: LiveSurvey) -> m.Camera:
    """Return the camera: parameters, sigmas, their source, and remarks."""
    inputs = survey.inputs
    calibration = inputs.calibration
    facts = compute_camera_properties(calibration)
    return {
        "name": calibration.name,
        "model": calibration.model,
        "width_px": calibration.width_px,
        "height_px": calibration.height_px,
        "parameters": [[cell.text for cell in row] for row in parameter_table(calibration).rows],
        "facts": fact_lines(facts, None),
        "source": _source(inputs),
        "file": _file(inputs),
        "messages": messages_json(_about_camera(inputs)),
    }


def _file(inputs: Inputs) -> str:
    camera = inputs.project.camera_file
    return "" if camera is None else Path(camera).name


def _source(inputs: Inputs) -> list[str]:
    """Return the source of the parameters, in sentences."""
    file = inputs.project.camera_file
    if file is None:
        how = f"(`camera: {inputs.project.camera}`)"
        if _is_unknown(inputs):
            return [f"The camera is not known, so an ordinary drone camera is assumed {how}."]
        return [f"Assumed from what the photos say of their camera {how}."]
    provenance: CameraProvenance | None = None
    try:
        provenance = read_camera(file).provenance
    except UavgramError:  # deleted or changed since it was read: nothing more is known
        return ["The file cannot be read any more."]
    if provenance is None:
        return ["The file does not say how it was made."]
    return provenance_lines(provenance)


def _about_camera(inputs: Inputs) -> list[Message]:
    messages = [message for message in inputs.messages if entry_of(message.code).subject == CAMERA]
    return messages if _is_unknown(inputs) else [*messages, *_judged(inputs.calibration)]


def _is_unknown(inputs: Inputs) -> bool:
    """Return whether a message already warns of the poor camera sigmas."""
    return any(message.code == UNKNOWN_CAMERA for message in inputs.messages)


def _judged(calibration: Calibration) -> list[Message]:
    """Return warnings about camera sigmas that limit the lengths."""
    sigma = np.sqrt(calibration.covariance.diagonal())
    if not sigma.any():
        text = (
            "The file states no errors, so the camera counts as known exactly: the ± of all "
            "measurements are too small by the camera's real error. Calibrate it."
        )
        return [Message("warning", "camera-exact", text)]
    messages = []
    share = focal_share(calibration)
    if share > GOOD_FOCAL:
        text = (
            f"The focal length is known to {percent(share)} only: without lengths on the ground "
            "every distance is as uncertain. Calibrate the camera, or tape lengths."
        )
        messages.append(Message("warning", "camera-focal", text))
    if sigma[2:4].max() > CENTRE_SIGMA_SHARE * calibration.width_px:
        text = (
            f"The principal point is known to {sigma[2:4].max():.0f} px only, which is as much as "
            f"a tilt of {np.degrees(sigma[2:4].max() / calibration.parameters[0]):.1f} degrees of "
            "the camera. Calibrate the camera."
        )
        messages.append(Message("warning", "camera-centre", text))
    return messages


def flight_json(survey: LiveSurvey) -> m.Flight | None:
    """Return the track around the photos; None without seed poses.

    ``track`` is [UTC time s, east m, north m], empty where the photos state their own places.
    """
    posed = survey.posed
    if posed is None or posed.telemetry is None:
        return None
    track, vertices = posed.telemetry.track, np.zeros((0, 3))
    if isinstance(track, Track):
        vertices = cut_track(track, posed.frames.time_utc_s)
    return {"track": [(t, e, n) for t, e, n in vertices.round(2).tolist()]}


def cut_track(track: Track, time_utc_s: Floats) -> Floats:
    """Return (n, 3) time, east and north of the track while photos were taken, and some time more.

    Parameters
    ----------
    track
        Track of the flight.
    time_utc_s
        (F,) times of the photos, NaN where not known.
    """
    vertices = np.column_stack([track.position_time_s, track.position_world_m[:, :2]])
    known = time_utc_s[np.isfinite(time_utc_s)]
    if len(known):
        more = max(BEFORE_AND_AFTER * float(np.ptp(known)), MIN_BEFORE_S)
        inside = (vertices[:, 0] >= known.min() - more) & (vertices[:, 0] <= known.max() + more)
        vertices = vertices[inside]
    if len(vertices) <= MAX_VERTICES:
        return vertices
    rows = np.linspace(0, len(vertices) - 1, MAX_VERTICES).round().astype(int)
    return np.asarray(vertices[rows])


def planned_json(planned: FlightPlanned | None, units: Units, *, sought: bool) -> m.Planned:
    """Return the planned lines and plates in their order: names, labels and places in words.

    Lengths are words only: a planned length is no reading of a tape.

    Parameters
    ----------
    planned
        The plan, if there is one.
    units
        Units of the project.
    sought
        Whether the project file describes the plates to search for.
    """
    if planned is None:
        return {"lines": [], "plates": [], "why": ""}
    side = convert_sentence(plate_side(planned), units)
    plates = plate_rows(planned)
    return {
        "lines": [_line(row, units) for row in line_rows(planned)],
        "plates": [_plate(row, side, units) for row in plates],
        "why": NOT_SOUGHT.format(side=planned.plates.side_m) if plates and not sought else "",
    }


def _line(row: LineRow, units: Units) -> m.PlannedLine:
    return {
        "name": row.name,
        "start": row.start,
        "end": row.end,
        "length": convert_sentence(row.length, units),
        "start_place": convert_sentence(row.start_place, units),
        "end_place": convert_sentence(row.end_place, units),
    }


def _plate(row: PlateRow, side: str, units: Units) -> m.PlannedPlate:
    return {
        "name": row.name,
        "side": side,
        "place": convert_sentence(row.place, units),
        "corners": [f"{row.name}-{corner + 1}" for corner in range(PLATE_CORNERS)],
    }

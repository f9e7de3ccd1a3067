"""Truth of a synthetic survey: camera poses, points, pixels, and values of its measurements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.camera_motion import compute_row_share
from uavgram.model.arrays import Bools, Floats, FrozenArrays
from uavgram.model.camera import Calibration
from uavgram.model.observations import MeasurementRequest
from uavgram.synthetic.flight import (
    FlightBiases,
    Motion,
    PhotoRows,
    compute_photo_rows,
    compute_true_poses,
)
from uavgram.synthetic.quantities import compute_true_values
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.scene import Surface


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyTruth(FrozenArrays):
    """True values, in the world whose origin is the log's home.

    Attributes
    ----------
    frame_id, time_utc_s, center_world_m, world_from_camera
        (F,), (F,), (F, 3), (F, 3, 3) of the stored photos, at their middle rows.
    rows
        Of photos that are read row after row; None: all rows at once.
    intrinsics
        (P,) of the true camera.
    boresight_rad
        (3,) rotation vector in the camera frame, true = nominal @ exp(boresight).
    lever_arm_m, position_bias_m, heading_bias_rad, clock_offset_s
        As in `SharedResult`: biases are log minus truth; camera clock minus UTC.
    surface
        The ground.
    label, point_world_m
        (K,), (K, 3).
    line_length_m
        (L,) in the order of the survey's lines.
    measurement_name, measurement_value, measurement_unit
        (M,) in SI units and degrees; a coordinate has two rows, ``NAME east`` and ``NAME north``.
    """

    frame_id: Annotated[tuple[str, ...], "f"]
    time_utc_s: Annotated[Floats, "f"]
    center_world_m: Annotated[Floats, "f", 3]
    world_from_camera: Annotated[Floats, "f", 3, 3]
    rows: PhotoRows | None
    intrinsics: Annotated[Floats, "p"]
    boresight_rad: Annotated[Floats, 3]
    lever_arm_m: Annotated[Floats, 3]
    position_bias_m: Annotated[Floats, 3]
    heading_bias_rad: float
    clock_offset_s: float
    surface: Surface
    label: Annotated[tuple[str, ...], "k"]
    point_world_m: Annotated[Floats, "k", 3]
    line_length_m: Annotated[Floats, "l"]
    measurement_name: Annotated[tuple[str, ...], "m"]
    measurement_value: Annotated[Floats, "m"]
    measurement_unit: tuple[str, ...]


MAX_ROUNDS = 3


def compute_truth(
    scenario: Scenario,
    requests: tuple[MeasurementRequest, ...],
    flown: tuple[Motion, FlightBiases],
    ground: tuple[Surface, Floats],
    intrinsics: Floats,
    stored: Bools,
) -> SurveyTruth:
    """Return the true values of a survey.

    Parameters
    ----------
    scenario
        Scenario from which it is made.
    requests
        Requested measurements, with true friction.
    flown
        The true flight, and the constant errors of its log.
    ground
        The surface, and the points (K, 3) on it.
    intrinsics
        (P,) of the true camera.
    stored
        (E,) mask of exposures that became photos.
    """
    (motion, biases), (surface, points) = flown, ground
    exposed = motion.exposure_time_s[stored]
    center, rotation = compute_true_poses(motion, biases, exposed)
    row = {label: i for i, label in enumerate(scenario.labels)}
    # ends of the taped lengths, as rows of the points
    ends = np.array([[row[line.start], row[line.end]] for line in scenario.lines], dtype=int)
    ends = ends.reshape(-1, 2)
    names, values, units = compute_true_values(requests, row, points)
    return SurveyTruth(
        frame_id=tuple(f"IMG_{i + 1:04d}.jpg" for i in range(len(center))),
        time_utc_s=scenario.flight.start_utc_s + exposed,
        center_world_m=center,
        world_from_camera=rotation,
        rows=compute_photo_rows(motion, biases, exposed, 1e-3 * scenario.errors.readout_ms),
        intrinsics=intrinsics,
        boresight_rad=biases.boresight_rad,
        lever_arm_m=biases.lever_arm_m,
        position_bias_m=biases.position_m,
        heading_bias_rad=biases.heading_rad,
        clock_offset_s=scenario.errors.camera_clock_offset_s,
        surface=surface,
        label=tuple(row),
        point_world_m=points,
        line_length_m=np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1),
        measurement_name=names,
        measurement_value=values,
        measurement_unit=units,
    )


def project_rolling_shutter(
    calibration: Calibration, truth: SurveyTruth, places_m: Floats
) -> Floats:
    """Project points (F, K, 3) of each photo with a rolling shutter, (F, K, 2) px.

    The time of a row moves a pixel by far less than one row per row, so a few fixed-point
    iterations converge.

    Parameters
    ----------
    calibration
        Calibration with lens model and size.
    truth
        Of the survey.
    places_m
        In the world.
    """
    offset = places_m - truth.center_world_m[:, None]
    in_camera = np.einsum("fij,fki->fkj", truth.world_from_camera, offset)
    pixel = project(calibration.model, truth.intrinsics, in_camera)
    if truth.rows is None:
        return pixel
    height = calibration.height_px
    frame = np.broadcast_to(np.arange(len(offset))[:, None], offset.shape[:2])
    # fixed-point iteration: pixel -> row -> pose at its time -> pixel
    for _ in range(MAX_ROUNDS):
        row = np.clip(np.nan_to_num(pixel[..., 1]), 0.0, height - 1.0)
        center, rotation = truth.rows.at(frame, compute_row_share(row, height))
        seen = np.einsum("fkij,fki->fkj", rotation, places_m - center)
        pixel = project(calibration.model, truth.intrinsics, seen)
    return pixel

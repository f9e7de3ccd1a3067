"""A simulated survey: what its files would say, and the truth behind them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import Bools, Floats, FrozenArrays
from uavgram.model.camera.calibration import Calibration
from uavgram.model.scenario.photo_rows import PhotoRows
from uavgram.model.scenario.scenario import Scenario
from uavgram.model.scenario.surface import Surface
from uavgram.model.survey.observations import KnownLines, KnownPoints, MeasurementRequest, Picks


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedLog(FrozenArrays):
    """What the autopilot recorded, with its errors.

    Attributes
    ----------
    boot_utc_s
        UTC of boot, seconds since the Unix epoch; all times below are seconds since boot.
    home_geodetic
        (3,) latitude, longitude [deg], height above mean sea level [m].
    undulation_m
        Geoid above ellipsoid.
    position_time_s, position_geodetic, velocity_ned_m_s
        (N,), (N, 3) as home, (N, 3).
    attitude_time_s, attitude_rpy_rad
        (M,), (M, 3) roll, pitch, yaw, body FRD to NED.
    gimbal_time_s, gimbal_rpy_rad
        (L,), (L, 3) roll and pitch from the earth, yaw from the vehicle's heading.
    gps_time_s, gps_geodetic, gps_accuracy_m
        (G,), (G, 3), (G, 2) horizontal and vertical, as the receiver states it.
    event_time_s, event_geodetic, event_rpy_rad
        (E,), (E, 3), (E, 3) exposures; attitude of the vehicle.
    """

    boot_utc_s: float
    home_geodetic: Annotated[Floats, 3]
    undulation_m: float
    position_time_s: Annotated[Floats, "n"]
    position_geodetic: Annotated[Floats, "n", 3]
    velocity_ned_m_s: Annotated[Floats, "n", 3]
    attitude_time_s: Annotated[Floats, "m"]
    attitude_rpy_rad: Annotated[Floats, "m", 3]
    gimbal_time_s: Annotated[Floats, "k"]
    gimbal_rpy_rad: Annotated[Floats, "k", 3]
    gps_time_s: Annotated[Floats, "g"]
    gps_geodetic: Annotated[Floats, "g", 3]
    gps_accuracy_m: Annotated[Floats, "g", 2]
    event_time_s: Annotated[Floats, "e"]
    event_geodetic: Annotated[Floats, "e", 3]
    event_rpy_rad: Annotated[Floats, "e", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyTruth(FrozenArrays):
    """What really was, in the world whose origin is the log's home.

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


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedSurvey(FrozenArrays):
    """Everything that the survey's files will say, and the truth.

    Attributes
    ----------
    scenario
        What it was made of.
    calibration
        The camera as calibrated, not the true one.
    frame_id, file_time_utc_s
        (F,) of the stored photos: names, and the camera clock's reading without its zone.
    event_has_photo
        (E,) whether the log's exposure became a photo.
    log, picks, lines, checks, measurements, control
        Content of the files of those names.
    truth
        What really was.
    """

    scenario: Scenario
    calibration: Calibration
    frame_id: Annotated[tuple[str, ...], "n"]
    file_time_utc_s: Annotated[Floats, "n"]
    event_has_photo: Annotated[Bools, "e"]
    log: SimulatedLog
    picks: Picks
    lines: KnownLines
    checks: KnownPoints
    control: KnownPoints
    measurements: tuple[MeasurementRequest, ...]
    truth: SurveyTruth

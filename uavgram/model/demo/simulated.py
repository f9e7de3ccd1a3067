"""A simulated survey: what its files would say, and the truth behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools, Floats, freeze, freeze_as
from uavgram.model.camera.calibration import Calibration
from uavgram.model.demo.scenario import DemoScenario
from uavgram.model.survey.observations import KnownLines, KnownPoints, MeasurementRequest, Picks


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedLog:
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
    home_geodetic: Floats
    undulation_m: float
    position_time_s: Floats
    position_geodetic: Floats
    velocity_ned_m_s: Floats
    attitude_time_s: Floats
    attitude_rpy_rad: Floats
    gimbal_time_s: Floats
    gimbal_rpy_rad: Floats
    gps_time_s: Floats
    gps_geodetic: Floats
    gps_accuracy_m: Floats
    event_time_s: Floats
    event_geodetic: Floats
    event_rpy_rad: Floats

    def __post_init__(self) -> None:
        n, m = len(self.position_time_s), len(self.attitude_time_s)
        k, g, e = len(self.gimbal_time_s), len(self.gps_time_s), len(self.event_time_s)
        freeze(
            self,
            home_geodetic=(3,),
            position_time_s=(n,),
            position_geodetic=(n, 3),
            velocity_ned_m_s=(n, 3),
            attitude_time_s=(m,),
            attitude_rpy_rad=(m, 3),
            gimbal_time_s=(k,),
            gimbal_rpy_rad=(k, 3),
            gps_time_s=(g,),
            gps_geodetic=(g, 3),
            gps_accuracy_m=(g, 2),
            event_time_s=(e,),
            event_geodetic=(e, 3),
            event_rpy_rad=(e, 3),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SurveyTruth:
    """What really was, in the world whose origin is the log's home.

    Attributes
    ----------
    frame_id, time_utc_s, center_world_m, world_from_camera
        (F,), (F,), (F, 3), (F, 3, 3) of the stored photos.
    intrinsics
        (9,) of the true camera.
    boresight_rad
        (3,) rotation vector in the camera frame, true = nominal @ exp(boresight).
    lever_arm_m, position_bias_m, heading_bias_rad, clock_offset_s
        As in `SharedResult`: biases are log minus truth; camera clock minus UTC.
    plane_height_m, plane_slope, plane_pivot_m
        z = height + slope . ((e, n) - pivot); (2,) and (2,).
    label, point_world_m
        (K,), (K, 3).
    line_length_m
        (L,) in the order of the survey's lines.
    measurement_name, measurement_value, measurement_unit
        (M,) in SI units and degrees; a coordinate has two rows, ``NAME east`` and ``NAME north``.
    """

    frame_id: tuple[str, ...]
    time_utc_s: Floats
    center_world_m: Floats
    world_from_camera: Floats
    intrinsics: Floats
    boresight_rad: Floats
    lever_arm_m: Floats
    position_bias_m: Floats
    heading_bias_rad: float
    clock_offset_s: float
    plane_height_m: float
    plane_slope: Floats
    plane_pivot_m: Floats
    label: tuple[str, ...]
    point_world_m: Floats
    line_length_m: Floats
    measurement_name: tuple[str, ...]
    measurement_value: Floats
    measurement_unit: tuple[str, ...]

    def __post_init__(self) -> None:
        f, k, m = len(self.frame_id), len(self.label), len(self.measurement_name)
        freeze(
            self,
            time_utc_s=(f,),
            center_world_m=(f, 3),
            world_from_camera=(f, 3, 3),
            intrinsics=(9,),
            boresight_rad=(3,),
            lever_arm_m=(3,),
            position_bias_m=(3,),
            plane_slope=(2,),
            plane_pivot_m=(2,),
            point_world_m=(k, 3),
            line_length_m=(None,),
            measurement_value=(m,),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedSurvey:
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
    log, picks, lines, checks, measurements
        Content of the files of those names.
    truth
        What really was.
    """

    scenario: DemoScenario
    calibration: Calibration
    frame_id: tuple[str, ...]
    file_time_utc_s: Floats
    event_has_photo: Bools
    log: SimulatedLog
    picks: Picks
    lines: KnownLines
    checks: KnownPoints
    measurements: tuple[MeasurementRequest, ...]
    truth: SurveyTruth

    def __post_init__(self) -> None:
        freeze(self, file_time_utc_s=(len(self.frame_id),))
        freeze_as(self, np.bool_, event_has_photo=(None,))

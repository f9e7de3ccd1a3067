"""Where a PX4 log says that the vehicle was and how it was turned, and how well.

Field meanings: PX4-Autopilot msg/*.msg; names of fields changed over the years, both are read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np

from uavgram.io.logs.quality import gimbal as gimbal_forms
from uavgram.io.logs.quality.samples import (
    Found,
    Place,
    attitude_samples,
    median_undulation_m,
    position_samples,
    reception_samples,
    turn_rate_samples,
    unit_quaternions,
    velocity_samples,
)
from uavgram.io.logs.quality.sigmas import merged_sigmas, positions_known
from uavgram.io.logs.ulog.topics import Topic, UlogTables
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight.log import (
    AttitudeSamples,
    EstimatorSigmas,
    GimbalSamples,
    PositionSamples,
    ReceptionSamples,
)
from uavgram.model.flight.second_opinions import TurnRateSamples, VelocitySamples

Rates = TypeVar("Rates", VelocitySamples, TurnRateSamples)

# PX4 src/lib/geo/geo.h, CONSTANTS_RADIUS_OF_EARTH
_EARTH_RADIUS_M = 6371000.0


def positions(tables: UlogTables) -> Found[PositionSamples]:
    """vehicle_global_position; else vehicle_local_position with its origin; else the receiver's."""
    topic = tables.topic("vehicle_global_position")
    if topic is not None:
        place = topic.column("lat"), topic.column("lon"), topic.column("alt")
        valid = _flag(topic, "lat_lon_valid") & _flag(topic, "alt_valid")
        samples, notes = position_samples(topic.name, topic.time_s, place, None, valid)
        if samples is not None:
            return samples, notes
    topic = tables.topic("vehicle_local_position")
    if topic is not None:
        samples, notes = position_samples(
            topic.name, topic.time_s, _from_local(topic), None, _is_global(topic)
        )
        if samples is not None:
            return samples, notes
    topic = receiver(tables)
    if topic is None:
        return None, ()
    samples, notes = position_samples(
        topic.name, topic.time_s, receiver_position(topic), None, has_fix(topic)
    )
    remark = "positions are the receiver's own (no estimator's): they lag by its delay"
    return samples, notes if samples is None else (*notes, remark)


def velocities(tables: UlogTables) -> VelocitySamples | None:
    """vehicle_local_position; in old firmware also vehicle_global_position."""
    return _first_stated(
        tables,
        {
            "vehicle_local_position": ("vx", "vy", "vz"),
            "vehicle_global_position": ("vel_n", "vel_e", "vel_d"),
        },
        velocity_samples,
    )


def turn_rates(tables: UlogTables) -> TurnRateSamples | None:
    """vehicle_angular_velocity; in old firmware vehicle_attitude."""
    return _first_stated(
        tables,
        {
            "vehicle_angular_velocity": ("xyz[0]", "xyz[1]", "xyz[2]"),
            "vehicle_attitude": ("rollspeed", "pitchspeed", "yawspeed"),
        },
        turn_rate_samples,
    )


def _first_stated(
    tables: UlogTables,
    fields: Mapping[str, tuple[str, str, str]],
    make: Callable[[str, Floats, tuple[Floats, Floats, Floats]], Rates | None],
) -> Rates | None:
    """Samples of the first of some topics that has any.

    Parameters
    ----------
    tables
        Of the log.
    fields
        Name of each topic, and of its three columns.
    make
        Name, times and columns of a topic to its samples; None where none is possible.
    """
    for name, (first, second, third) in fields.items():
        topic = tables.topic(name)
        if topic is not None:
            columns = topic.column(first), topic.column(second), topic.column(third)
            found = make(name, topic.time_s, columns)
            if found is not None:
                return found
    return None


def receiver_positions(tables: UlogTables) -> PositionSamples | None:
    """The receiver's own places, to hold against the estimator's."""
    topic = receiver(tables)
    if topic is None:
        return None
    place = receiver_position(topic)
    return position_samples(topic.name, topic.time_s, place, None, has_fix(topic))[0]


def _flag(topic: Topic, name: str) -> Bools:
    """(N,) a field's truth; true where the firmware has no such field."""
    stated = topic.column(name)
    return np.isnan(stated) | (stated > 0)


def _is_global(topic: Topic) -> Bools:
    """(N,) whether the local frame is tied to the earth."""
    tied = (topic.column("xy_global") > 0) & (topic.column("z_global") > 0)
    finite = np.isfinite(topic.column("ref_lat")) & np.isfinite(topic.column("ref_lon"))
    return np.asarray(tied & finite)


def _from_local(topic: Topic) -> Place:
    """Latitude, longitude [deg] and altitude [m], each (N,), of local north, east, down.

    PX4's own projection, as it made the local frame with it: azimuthal equidistant on a sphere
    (PX4 src/lib/geo/geo.cpp, MapProjection::reproject).
    """
    latitude_0, longitude_0 = (
        np.radians(topic.column("ref_lat")),
        np.radians(topic.column("ref_lon")),
    )
    north, east = topic.column("x") / _EARTH_RADIUS_M, topic.column("y") / _EARTH_RADIUS_M
    angle = np.hypot(north, east)
    ratio = np.sinc(angle / np.pi)  # sin(angle) / angle, 1 at the origin
    latitude = np.arcsin(
        np.clip(np.cos(angle) * np.sin(latitude_0) + north * ratio * np.cos(latitude_0), -1.0, 1.0)
    )
    longitude = longitude_0 + np.arctan2(
        east * ratio, np.cos(latitude_0) * np.cos(angle) - north * np.sin(latitude_0) * ratio
    )
    height = topic.column("ref_alt") - topic.column("z")
    return np.degrees(latitude), np.degrees(longitude), height


def receiver(tables: UlogTables) -> Topic | None:
    """The GPS topic that has a 3-D fix; vehicle_gps_position before sensor_gps."""
    for name in ("vehicle_gps_position", "sensor_gps"):
        for topic in tables.instances(name):
            if has_fix(topic).any():
                return topic
    return None


def has_fix(topic: Topic) -> Bools:
    """(N,) whether the receiver has a 3-D fix."""
    return np.asarray(topic.column("fix_type") >= 3)


def receiver_position(topic: Topic) -> Place:
    """Latitude, longitude [deg], altitude above sea level [m], each (N,).

    Since 2023 in degrees and metres, before as integers of 1e-7 degrees and millimetres.
    """
    if "latitude_deg" in topic.fields:
        names = ("latitude_deg", "longitude_deg", "altitude_msl_m")
        latitude, longitude, height = (topic.column(name) for name in names)
        return latitude, longitude, height
    return topic.column("lat") / 1e7, topic.column("lon") / 1e7, topic.column("alt") / 1e3


def undulation_m(tables: UlogTables) -> float:
    """Geoid above ellipsoid: median of the receiver's two altitudes; NaN without."""
    topic = receiver(tables)
    if topic is None:
        return float("nan")
    ellipsoid = topic.column("altitude_ellipsoid_m")
    if "alt_ellipsoid" in topic.fields:
        ellipsoid = topic.column("alt_ellipsoid") / 1e3
    stated = has_fix(topic) & (ellipsoid != 0)
    return median_undulation_m(ellipsoid[stated], receiver_position(topic)[2][stated])


def attitudes(tables: UlogTables) -> Found[AttitudeSamples]:
    """vehicle_attitude: FRD to NED, w first."""
    topic = tables.topic("vehicle_attitude")
    if topic is None:
        return None, ()
    xyzw = topic.array("q", 4)[:, [1, 2, 3, 0]]
    return attitude_samples(topic.name, topic.time_s, unit_quaternions(xyzw))


def gimbal(tables: UlogTables) -> Found[GimbalSamples]:
    """gimbal_device_attitude_status; else mount_orientation (yaw from the vehicle's nose)."""
    notes: tuple[str, ...] = ()
    topic = tables.topic("gimbal_device_attitude_status")
    if topic is not None:
        samples, notes = gimbal_forms.from_device_status(
            topic.time_s, topic.array("q", 4), _integers(topic.column("device_flags")), topic.name
        )
        if samples is not None:
            return samples, notes
    topic = tables.topic("mount_orientation")
    if topic is None:
        return None, notes
    angles_deg = np.degrees(topic.array("attitude_euler_angle", 3))
    samples, remarks = gimbal_forms.from_angles(topic.time_s, angles_deg, topic.name)
    return samples, (*notes, *remarks)


def _integers(values: Floats) -> Ints:
    return np.where(np.isfinite(values), values, 0.0).astype(np.int64)


def sigmas(tables: UlogTables) -> EstimatorSigmas | None:
    """Standard deviations of the estimator (eph, epv) and of the receiver, the larger of the two.

    The test ratios of estimator_status are no standard deviations.
    """
    gps = receiver(tables)
    topics = (tables.topic("vehicle_global_position", "vehicle_local_position"), gps)
    parts = [
        positions_known(t.name, t.time_s, t.column("eph"), t.column("epv"))
        for t in topics
        if t is not None
    ]
    fix = None if gps is None else (gps.time_s, gps.column("fix_type"))
    return merged_sigmas(parts, fix)


def reception(tables: UlogTables) -> ReceptionSamples | None:
    """What the receiver hears."""
    gps = receiver(tables)
    if gps is None:
        return None
    heard = gps.column("satellites_used"), gps.column("hdop")
    return reception_samples(gps.name, gps.time_s, *heard)

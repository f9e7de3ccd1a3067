"""Where a DataFlash log says that the vehicle was and how it was turned, and how well.

Field meanings: ArduPilot libraries/AP_AHRS/AP_AHRS_Logging.cpp, AP_NavEKF3_Logging.cpp,
AP_Mount_Backend.cpp, AP_GPS.cpp (LogStructure.h of each).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.io.logs.dataflash.formats import Columns
from uavgram.io.logs.dataflash.tables import Tables
from uavgram.io.logs.quality.rows import are_body_angles, as_numbers
from uavgram.io.logs.quality.samples import (
    Found,
    Place,
    attitude_samples,
    position_samples,
    reception_samples,
    turn_rate_samples,
    unit_quaternions,
    velocity_samples,
)
from uavgram.io.logs.quality.sigmas import Stated, merged_sigmas, positions_known
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import (
    AttitudeSamples,
    EstimatorSigmas,
    PositionSamples,
    ReceptionSamples,
)
from uavgram.model.flight.second_opinions import TurnRateSamples, VelocitySamples


def boot_time_s(columns: Columns) -> Floats:
    """(N,) seconds since boot: TimeUS, before ArduPilot 3.3 T (of GPS) or TimeMS."""
    for name, unit_s in (("TimeUS", 1e-6), ("T", 1e-3), ("TimeMS", 1e-3)):
        if name in columns:
            return as_numbers(columns[name]) * unit_s
    rows = len(next(iter(columns.values()))) if columns else 0
    return np.full(rows, np.nan)


def numbers(columns: Columns, *names: str) -> Floats:
    """(N,) the first of these fields that exists, as float64; NaN where none does."""
    for name in names:
        if name in columns:
            return as_numbers(columns[name])
    return np.full(len(boot_time_s(columns)), np.nan)


def rows_where(columns: Columns, keep: NDArray[Any]) -> Columns:
    """The same columns, fewer rows."""
    return {name: values[keep] for name, values in columns.items()}


def primary_core(tables: Tables) -> int:
    """The estimator core that flew most of the time (XKF4.PI)."""
    for name in ("XKF4", "NKF4"):
        columns = tables.columns(name)
        if "PI" in columns:
            cores = numbers(columns, "PI")
            cores = cores[(cores >= 0) & (cores < 8)].astype(np.int64)
            if len(cores):
                return int(np.bincount(cores).argmax())
    return 0


def of_core(tables: Tables, names: tuple[str, ...], core: int) -> tuple[str, Columns]:
    """The first of these message types that the log has, rows of one core only.

    Parameters
    ----------
    tables
        Of one boot.
    names
        Message types, the preferred one first.
    core
        Number of the estimator's core; a type without such a number is taken whole.
    """
    for name in names:
        columns = tables.columns(name)
        if columns and "C" in columns:
            columns = rows_where(columns, np.asarray(columns["C"]) == core)
        if len(boot_time_s(columns)):
            return name, columns
    return "", {}


def positions(tables: Tables, core: int) -> Found[PositionSamples]:
    """POS; else the estimator's offsets from its origin; else the receiver's positions."""
    if tables.count("POS"):
        return _positions_of(tables.columns("POS"), "POS")
    name, columns = of_core(tables, ("XKF1", "NKF1", "EKF1"), core)
    origins = tables.columns("ORGN")
    if name and origins:
        placed = _placed(columns, origins)
        samples, notes = _positions_of(placed, f"{name}+ORGN")
        if samples is not None:
            return samples, notes
    gps, _ = receiver(tables)
    if not gps:
        return None, ()
    samples, notes = _positions_of(gps, "GPS")
    return samples, (
        *notes,
        "positions are the receiver's own (no POS, no XKF1 with ORGN): they lag by its delay",
    )


def receiver(tables: Tables) -> tuple[Columns, Columns]:
    """Rows with a 3-D fix of the receiver that was in use, and its accuracies.

    Returns
    -------
    gps, gpa
        Columns of GPS (before 3.6 also GPS2) and of GPA (GPA2); empty where the log has none.
    """
    for name, accuracies in (("GPS", "GPA"), ("GPS2", "GPA2")):
        columns = tables.columns(name)
        if not columns or "Lat" not in columns:
            continue
        columns = rows_where(columns, numbers(columns, "Status") >= 3)
        instance = _instance_in_use(columns)
        columns = _of_instance(columns, instance)
        if len(boot_time_s(columns)):
            return columns, _of_instance(tables.columns(accuracies), instance)
    return {}, {}


def _instance_in_use(columns: Columns) -> float:
    """Receiver that flew most of the time (U), else the one with most fixes, else the first."""
    instance = numbers(columns, "I")
    instance = np.where(np.isfinite(instance), instance, 0.0)
    used = numbers(columns, "U") > 0
    seen, count = np.unique(instance[used] if used.any() else instance, return_counts=True)
    return float(seen[count.argmax()]) if len(seen) else 0.0


def _of_instance(columns: Columns, instance: float) -> Columns:
    if "I" not in columns:
        return columns
    stated = numbers(columns, "I")
    return rows_where(columns, np.where(np.isfinite(stated), stated, 0.0) == instance)


def _positions_of(columns: Columns, source: str) -> Found[PositionSamples]:
    above_home = numbers(columns, "RelHomeAlt", "RelAlt")
    return position_samples(source, boot_time_s(columns), place_of(columns), above_home)


def place_of(columns: Columns) -> Place:
    """Latitudes, longitudes and heights of messages that state them."""
    return numbers(columns, "Lat"), numbers(columns, "Lng"), numbers(columns, "Alt")


def _placed(columns: Columns, origins: Columns) -> Columns:
    """Offsets from the estimator's origin as latitude, longitude and altitude.

    With ArduPilot's own scale, as it made the offsets with it (libraries/AP_Common/Location.cpp,
    LATLON_TO_M = 0.011131884502145034 m per 1e-7 degrees).
    """
    is_origin = numbers(origins, "Type") == 0
    origins = rows_where(origins, is_origin)
    since = boot_time_s(origins)
    if not len(since):
        return {}
    time = boot_time_s(columns)
    row = np.clip(np.searchsorted(since, time, side="right") - 1, 0, None)
    latitude_0 = numbers(origins, "Lat")[row]
    meters_per_deg = 0.011131884502145034 * 1e7
    latitude = latitude_0 + numbers(columns, "PN") / meters_per_deg
    scale = np.cos(np.radians((latitude_0 + latitude) / 2))
    return {
        "TimeUS": time * 1e6,
        "Lat": latitude,
        "Lng": numbers(origins, "Lng")[row] + numbers(columns, "PE") / (meters_per_deg * scale),
        "Alt": numbers(origins, "Alt")[row] - numbers(columns, "PD"),
    }


def attitudes(tables: Tables, core: int) -> Found[AttitudeSamples]:
    """ATT, else the estimator's quaternions."""
    columns = tables.columns("ATT")
    samples, notes = _by_angles(columns, "ATT") if columns else (None, ())
    if samples is not None:
        return samples, notes
    samples, more = _quaternions(tables, core)
    return samples, (*notes, *more)


def _by_angles(columns: Columns, source: str) -> Found[AttitudeSamples]:
    angles_deg = np.stack([numbers(columns, n) for n in ("Roll", "Pitch", "Yaw")], axis=1)
    sane = are_body_angles(angles_deg)[:, None]
    roll, pitch, yaw = np.radians(np.where(sane, angles_deg, 0.0)).T
    xyzw = xyzw_from_matrix(matrix_from_ypr(yaw, pitch, roll))
    return attitude_samples(source, boot_time_s(columns), np.where(sane, xyzw, np.nan))


def _quaternions(tables: Tables, core: int) -> Found[AttitudeSamples]:
    name, columns = of_core(tables, ("XKQ", "XKQ1", "NKQ", "NKQ1"), core)
    if not name:
        return None, ()
    # ArduPilot stores w x y z
    xyzw = np.stack([numbers(columns, n) for n in ("Q2", "Q3", "Q4", "Q1")], axis=1)
    return attitude_samples(name, boot_time_s(columns), unit_quaternions(xyzw))


def second_opinions(
    tables: Tables, core: int, gps: Columns
) -> tuple[PositionSamples | None, AttitudeSamples | None]:
    """The receiver's own positions, and the estimator's attitudes, to hold against POS and ATT.

    Parameters
    ----------
    tables, core
        Of one boot; the estimator's core that flew.
    gps
        The receiver's rows, the first of `receiver`.
    """
    place = _positions_of(gps, "GPS")[0] if gps else None
    name, columns = of_core(tables, ("XKF1", "NKF1"), core)
    if not name:
        return place, _quaternions(tables, core)[0]
    return place, _by_angles(columns, name)[0]


def velocities(tables: Tables, core: int) -> VelocitySamples | None:
    """The estimator's, which no jump of its positions moves."""
    name, columns = of_core(tables, ("XKF1", "NKF1", "EKF1"), core)
    if not name:
        return None
    north, east, down = (numbers(columns, k) for k in ("VN", "VE", "VD"))
    return velocity_samples(name, boot_time_s(columns), (north, east, down))


def turn_rates(tables: Tables) -> TurnRateSamples | None:
    """RATE's, in degrees a second: those that the vehicle has, not those that it should."""
    columns = tables.columns("RATE")
    if not columns:
        return None
    roll, pitch, yaw = (np.radians(numbers(columns, k)) for k in ("R", "P", "Y"))
    return turn_rate_samples("RATE", boot_time_s(columns), (roll, pitch, yaw))


def sigmas(tables: Tables, core: int, heard: tuple[Columns, Columns]) -> EstimatorSigmas | None:
    """The estimator's variances and the receiver's accuracies, the larger of the two.

    XKV1's V07, V08, V09 are position variances [m²]; XKF4's errRP is the standard deviation of
    tilt [rad] (its SP, SH... are test ratios and no standard deviations); GPA has the receiver's
    own. The estimator alone is over-confident wherever the receiver's error is correlated.

    Parameters
    ----------
    tables, core
        Of one boot; the estimator's core that flew.
    heard
        As of `receiver`.
    """
    parts: list[Stated] = []
    name, columns = of_core(tables, ("XKV1", "NKV1"), core)
    if name:
        v = [numbers(columns, f"V{i:02d}") for i in (7, 8, 9)]
        horizontal, vertical = (np.sqrt(np.abs(x)) for x in ((v[0] + v[1]) / 2, v[2]))
        parts.append(positions_known(name, boot_time_s(columns), horizontal, vertical))
    gps, columns = heard
    fix = (boot_time_s(gps), numbers(gps, "Status")) if gps else None
    if columns:
        stated = numbers(columns, "HAcc"), numbers(columns, "VAcc")
        parts.append(positions_known("GPA", boot_time_s(columns), *stated))
    name, columns = of_core(tables, ("XKF4", "NKF4"), core)
    if name:
        parts.append((name, boot_time_s(columns), {"tilt": numbers(columns, "errRP")}))
    return merged_sigmas(parts, fix)


def reception(gps: Columns) -> ReceptionSamples | None:
    """What the receiver in use hears while it has a 3-D fix."""
    if not gps:
        return None
    return reception_samples("GPS", boot_time_s(gps), numbers(gps, "NSats"), numbers(gps, "HDop"))

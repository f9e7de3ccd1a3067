"""Samples of a log from its plausible rows: finite, possible, in order, explained by neighbours.

A vehicle is heavy: its position and attitude follow from neighbouring rows. A row that no line
through its neighbours explains, from neither side, has damaged bytes; a lasting step (a new fix, a
gimbal moved to another angle) is permitted because of the rows after it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.motion.interpolation import compute_running_median, make_running_windows
from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.io.logs.messages import Found, StatedValues
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.flight_log import (
    AttitudeSamples,
    Boot,
    CameraEvents,
    ClockSamples,
    EstimatorSigmas,
    GimbalSamples,
    HomeSamples,
    PositionSamples,
    ReceptionSamples,
    TurnRateSamples,
    VelocitySamples,
)
from uavgram.model.naming import format_digits, join_names

LONGEST_BOOT_S = 30 * 86400.0
_BESIDE = 7  # rows of a neighbourhood, centred on a row
_DENSE_ROWS, _LONE_ROWS, _LONE_GAP_S = 20, 3, 1800.0
# faster than aircraft that take photos of the ground, including gusts and estimator steps
_FASTEST_M_S, _FASTEST_CLIMB_M_S, _STEP_M = 200.0, 50.0, 30.0
_METERS_PER_DEG = 111e3
_NO_DEG = 0.5e-7  # smaller is zero in the last digit stored by autopilots
# Logs count microseconds; the resolution of UTC as a double is a quarter of one.
_SAME_INSTANT_S = 0.5e-6
RESTART_S = 1.0  # a clock that steps back by more was restarted (or the byte is damaged)


def is_spike(time_s: Floats) -> Bools:
    """Return a (N,) mask of times off their neighbours: damaged bytes, without a checksum.

    In an increasing sequence every value equals the median of its neighbourhood, independent of
    gaps; only values out of order differ. Values that are not finite are spikes too.
    """
    finite = np.isfinite(time_s)
    spike = ~finite
    time = time_s[finite]
    if len(time) >= 3 and (time[1:] < time[:-1]).any():
        spike[finite] = np.abs(time - compute_running_median(time, _BESIDE)) > RESTART_S
    return spike


def find_plausible_rows(time_s: Floats, believable: Bools, *, dense: bool = False) -> Ints:
    """Return the rows to keep: plausible, of a possible time, no spike; sorted, without repeats.

    Parameters
    ----------
    time_s
        (N,) seconds since boot.
    believable
        (N,) whether the row's values are plausible.
    dense
        The table has many rows a second: single ones half an hour from all others are damaged.

    Returns
    -------
    (K,) indices, strictly increasing in `time_s`.
    """
    time = np.asarray(time_s, dtype=np.float64)
    possible = np.isfinite(time) & (time >= 0) & (time < LONGEST_BOOT_S)
    rows = np.flatnonzero(possible & believable)
    rows = rows[~is_spike(time[rows])]
    rows = rows[np.argsort(time[rows], kind="stable")]
    if dense:
        rows = _remove_lone_ends(time, rows)
    first_of_instant = np.diff(time[rows], prepend=-np.inf) > _SAME_INSTANT_S
    return rows[first_of_instant].astype(np.int64)


def describe_left_out(
    source: str, time_s: Floats, rows: Ints, stated: Bools | None = None
) -> tuple[str, ...]:
    """Return remarks on unused rows with a time of their own, and on rows out of order.

    Firmware writes some rows twice, such as the gimbal's at an exposure.

    Parameters
    ----------
    source
        The message's name.
    time_s
        (N,) since boot, in the order of the file.
    rows
        (K,) the used rows.
    stated
        (N,) rows with values, the used ones among them; None for all.
    """
    stated = np.ones(len(time_s), dtype=bool) if stated is None else stated
    used = np.isin(time_s, time_s[rows])
    unused = stated & ~used
    notes = _out_of_order(source, time_s[stated & used])
    is_timed = np.isfinite(time_s)
    for dropped, why in (
        (unused & ~is_timed, "have no time"),
        (unused & is_timed, "make no sense"),
    ):
        if dropped.any():
            count = f"{int(dropped.sum())} of {int(stated.sum())} {source} rows"
            notes = (f"{count} {why} and were dropped", *notes)
    return notes


def _out_of_order(source: str, time_s: Floats) -> tuple[str, ...]:
    """Return a remark if times (N,) of used rows, in the order of the file, decrease."""
    back = np.flatnonzero(np.diff(time_s) < 0)
    if not len(back):
        return ()
    return (
        f"{len(back)} {source} rows are out of the order of time (the first at "
        f"{time_s[back[0] + 1]:.2f} s since boot): damaged, or exchanged on the way",
    )


def _remove_lone_ends(time_s: Floats, rows: Ints) -> Ints:
    """Remove single rows of a dense table far before its first or after its last.

    `is_spike` cannot find a damaged time at an end, which is in order.
    """
    if len(rows) < _DENSE_ROWS:
        return rows
    apart = np.diff(time_s[rows])
    far = np.flatnonzero(apart > _LONE_GAP_S)
    first = int(far[far < _LONE_ROWS].max(initial=-1)) + 1
    last = int(far[far >= len(apart) - _LONE_ROWS].min(initial=len(rows) - 1)) + 1
    return rows[first:last]


def find_restarts(time_s: Floats) -> Ints:
    """Return the (K,) rows at which the boot clock has restarted, ignoring spikes."""
    rows = np.flatnonzero(~is_spike(time_s))
    falls = np.flatnonzero(np.diff(time_s[rows]) < -RESTART_S)
    return rows[falls + 1].astype(np.int64)


def is_place(latitude_deg: NDArray[np.floating], longitude_deg: NDArray[np.floating]) -> Bools:
    """Return (N,) whether latitude and longitude are on earth; 0, 0 means that there is no fix."""
    finite = np.isfinite(latitude_deg) & np.isfinite(longitude_deg)
    some = (np.abs(latitude_deg) > _NO_DEG) | (np.abs(longitude_deg) > _NO_DEG)
    return np.asarray(finite & some & (np.abs(latitude_deg) <= 90) & (np.abs(longitude_deg) <= 180))


def is_height(height_m: NDArray[np.floating]) -> Bools:
    """Return (N,) whether a height is possible for an aircraft."""
    return np.asarray(np.isfinite(height_m) & (np.abs(height_m) < 20000))


def is_near_track(
    time_s: Floats,
    latitude_deg: NDArray[np.floating],
    longitude_deg: NDArray[np.floating],
    height_m: NDArray[np.floating],
) -> Bools:
    """Return a (N,) mask of valid positions that agree with their neighbours in time.

    The limit is the distance from the median of seven neighbours that the fastest aircraft flies
    meanwhile; other rows have damaged bytes. A lasting step (a fix found, an origin set) is no
    damage.

    Parameters
    ----------
    time_s
        (N,) since boot.
    latitude_deg, longitude_deg
        (N,) WGS 84.
    height_m
        (N,) above any one datum.
    """
    fits = is_place(latitude_deg, longitude_deg) & is_height(height_m) & np.isfinite(time_s)
    rows = np.flatnonzero(fits)
    rows = rows[~is_spike(time_s[rows])]
    if len(rows) < 2:
        return fits
    time, middle = time_s[rows], float(np.median(latitude_deg[rows]))
    longitude = longitude_deg[rows]
    # also across the date line
    east = (longitude - longitude[len(rows) // 2] + 180) % 360 - 180
    reach = np.abs(time - _shift_values(time, 3)) + np.abs(time - _shift_values(time, -3))
    reach = np.minimum(reach, 10.0)
    allowed = _STEP_M + _FASTEST_M_S * reach
    off_n = _off_its_median(latitude_deg[rows]) * _METERS_PER_DEG
    off_e = _off_its_median(east) * _METERS_PER_DEG * np.cos(np.radians(middle))
    off_u = _off_its_median(height_m[rows])
    if len(rows) == 2:  # the median cannot decide between two rows: both are rejected
        off_n = np.full(2, np.abs(np.diff(latitude_deg[rows])) * _METERS_PER_DEG)
        off_e = np.full(2, np.abs(np.diff(east)) * _METERS_PER_DEG * np.cos(np.radians(middle)))
        off_u = np.full(2, np.abs(np.diff(height_m[rows])))
    near = (off_n < allowed) & (off_e < allowed)
    near &= off_u < _STEP_M + _FASTEST_CLIMB_M_S * reach
    fits[rows[~near]] = False
    return fits


def _shift_values(values: Floats, by: int) -> Floats:
    """Return the (N,) values `by` rows before each; the end's own value beyond it."""
    at = np.clip(np.arange(len(values)) - by, 0, len(values) - 1)
    return np.asarray(values[at])


def _off_its_median(values: NDArray[np.floating]) -> Floats:
    """Return (N,) distances from the median of seven neighbours, or of the seven end rows."""
    found = compute_running_median(values, _BESIDE)
    found[:3], found[-3:] = np.median(values[:7]), np.median(values[-7:])
    return np.asarray(np.abs(values - found))


def are_body_angles(rpy_deg: Floats) -> Bools:
    """Return (N,) whether rows of roll, pitch, yaw (N, 3) [deg] are a vehicle's attitude."""
    rounded_up = 0.1
    limits = np.array([180.0, 90.0, 360.0]) + rounded_up
    return np.asarray((np.abs(rpy_deg) <= limits).all(axis=1))


def are_angles(rpy_deg: Floats) -> Bools:
    """Return (N,) whether rows of roll, pitch, yaw (N, 3) [deg] are possible angles; NaN is not.

    Firmware writes 360.0 and rounds up, and a gimbal may report 270 for -90.
    """
    small = np.abs(rpy_deg) <= 361  # NaN compares False
    return np.asarray(small.all(axis=1))


_FEWEST_ROWS = 5
_NAMED = 4  # number of rows in one remark


@dataclass(frozen=True)
class _Agility:
    """Permitted deviation of a row from its neighbours: a minimum, and the usual acceleration.

    In undamaged logs of ArduPilot and PX4, rows deviate by 1.3 m (0.6 s apart) and by 2 degrees
    (0.1 s apart) at most in steady flight, and by more in turbulence, which shows in the
    neighbouring rows.
    """

    floor: float
    acceleration: float


_PLACE = _Agility(floor=1.0, acceleration=10.0)  # m, m/s²
# of quaternions, whose distance is half the small angle between them
_TURN = _Agility(floor=np.radians(3.0) / 2, acceleration=np.radians(100.0) / 2)
_CROWDED = 0.2  # of the usual step between rows
_UNREST = 6.0  # times the median of the fifteen neighbouring rows


def remove_damaged_rows(boot: Boot) -> tuple[Boot, tuple[str, ...]]:
    """Remove positions, attitudes and gimbal rows off their neighbours; return remarks too."""
    notes: list[str] = []
    positions, attitudes, gimbal = boot.positions, boot.attitudes, boot.gimbal
    if positions is not None:
        off_m = _off(positions.time_boot_s, _place_m(positions), _PLACE)
        notes += _remark(positions.source, positions.time_boot_s, off_m, "m")
        positions = select_rows(positions, off_m == 0)
    if attitudes is not None:
        time_s = attitudes.time_boot_s
        slack = _uneven_turn(time_s, boot.turn_rates) / 2  # of quaternions: half the angle
        off = _off(time_s, _continuous(attitudes.ned_from_body_xyzw), _TURN, slack)
        notes += _remark(attitudes.source, attitudes.time_boot_s, _degrees(off), "degrees")
        attitudes = select_rows(attitudes, off == 0)
    if gimbal is not None:
        matrix = matrix_from_ypr(gimbal.yaw_rad, gimbal.pitch_rad, gimbal.roll_rad)
        off = _off(gimbal.time_boot_s, _continuous(xyzw_from_matrix(matrix)), _TURN)
        notes += _remark(gimbal.source, gimbal.time_boot_s, _degrees(off), "degrees")
        gimbal = select_rows(gimbal, off == 0)
    return replace(boot, positions=positions, attitudes=attitudes, gimbal=gimbal), tuple(notes)


def compute_deviation(time_s: Floats, values: Floats) -> Floats:
    """Return the (N,) smallest deviation of each row from predictions by its neighbours.

    Predictions are the interpolation between its neighbours, the lines through the two rows before
    and through the two after, and the nearer neighbour itself.

    Parameters
    ----------
    time_s
        (N,) strictly increasing.
    values
        (N, K) values that are continuous in time.
    """
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
    none = np.array([np.inf])
    lines = [_off_line(time_s, values, *pair) for pair in ((-1, 1), (-2, -1), (1, 2))]
    return np.asarray(np.minimum.reduce([*lines, np.append(none, steps), np.append(steps, none)]))


def _off_line(time_s: Floats, values: Floats, first: int, second: int) -> Floats:
    """Return (N,) distances from the line through two rows at these offsets; infinite without."""
    row = np.arange(len(time_s))
    a, b = row + first, row + second
    there = (a >= 0) & (b < len(row))
    a, b = np.where(there, a, 0), np.where(there, b, 1)
    share = (time_s - time_s[a]) / (time_s[b] - time_s[a])
    apart = values - values[a] - share[:, None] * (values[b] - values[a])
    return np.where(there, np.linalg.norm(apart, axis=1), np.inf)


def _uneven_turn(time_s: Floats, rates: TurnRateSamples | None) -> Floats:
    """Return (N,) angles by which stated rates explain a row's deviation: 0 in a steady turn."""
    if rates is None or len(time_s) < _FEWEST_ROWS:
        return np.zeros(len(time_s))
    columns = [np.interp(time_s, rates.time_boot_s, c) for c in rates.body_rad_s.T]
    span = [np.ptp(make_running_windows(c, 5), axis=1) for c in columns]
    return np.asarray(np.linalg.norm(span, axis=0) * np.gradient(time_s))


def _off(time_s: Floats, values: Floats, usual: _Agility, slack: Floats | float = 0.0) -> Floats:
    """Return (N,) distances from the neighbours where they exceed the limit, else 0.

    Parameters
    ----------
    time_s
        (N,) strictly increasing.
    values
        (N, K) values that are continuous in time.
    usual
        Permitted deviation of a row.
    slack
        (N,) additional permitted deviation, from the log itself.
    """
    if len(time_s) < _FEWEST_ROWS:
        return np.zeros(len(time_s))
    off = compute_deviation(time_s, values)
    step_s = np.diff(time_s)
    widest_s = np.maximum(np.append(step_s[0], step_s), np.append(step_s, step_s[-1]))
    nearest_s = np.minimum(np.append(np.inf, step_s), np.append(step_s, np.inf))
    # two rows at almost the same time: their difference becomes an unlimited speed
    share = np.minimum(nearest_s / (_CROWDED * float(np.median(step_s))), 1.0)
    unrest = compute_running_median(off, 15)
    allowed = (
        usual.floor * share + usual.acceleration * share * widest_s**2 + _UNREST * unrest + slack
    )
    return np.where(off > allowed, off, 0.0)


def _place_m(positions: PositionSamples) -> Floats:
    p = positions
    origin = (float(p.latitude_deg[0]), float(p.longitude_deg[0]), float(p.height_m[0]))
    return enu_from_geodetic(p.latitude_deg, p.longitude_deg, p.height_m, origin)


def _continuous(xyzw: Floats) -> Floats:
    """Choose the signs of (N, 4) quaternions so that each is near the row before."""
    along = np.sum(xyzw[1:] * xyzw[:-1], axis=1)
    sign = np.cumprod(np.append(1.0, np.where(along < 0, -1.0, 1.0)))
    return np.asarray(xyzw * sign[:, None])


def _degrees(chord: Floats) -> Floats:
    """Return the angles between quaternions at these (N,) distances."""
    return np.asarray(np.degrees(4 * np.arcsin(np.clip(chord / 2, 0.0, 1.0))))


def _remark(source: str, time_s: Floats, off: Floats, unit: str) -> list[str]:
    """Return a remark on the rows off their neighbours, with times and deviations."""
    rows = np.flatnonzero(off)
    if not len(rows):
        return []
    named = join_names(
        (f"by {format_digits(off[k], 3)} {unit} at {time_s[k]:.2f} s" for k in rows), _NAMED
    )
    what = "1 row is" if len(rows) == 1 else f"{len(rows)} rows are"
    return [
        f"{what} off the rows before and after ({source}: {named}, since boot): taken for "
        "damaged and left out"
    ]


_LARGEST_UNDULATION_M = 150  # larger than any geoid undulation
_FASTEST_RAD_S = 40.0  # beyond the range of autopilots' gyroscopes
_PLACE_COLUMNS = ("latitude_deg", "longitude_deg", "height_m")
_MOST_SATELLITES, _LARGEST_HDOP = 200.0, 90.0  # logs write 255 and 99.99 or more for none
_LARGEST_SIGMA_M, _LARGEST_SIGMA_RAD = 1000.0, 1.0

RTK_FIXED = 6
"""Type of fix with solved ambiguities: GPS_FIX_TYPE_RTK_FIXED, in ArduPilot and PX4 alike."""

Table = TypeVar("Table")
Samples = TypeVar(
    "Samples", PositionSamples, AttitudeSamples, GimbalSamples, HomeSamples, CameraEvents
)


def select_rows(samples: Samples, keep: Bools) -> Samples:
    """Select rows (N,) of a table."""
    if keep.all():
        return samples
    columns = {field.name: getattr(samples, field.name) for field in fields(samples)}
    kept: dict[str, Any] = {n: c[keep] for n, c in columns.items() if isinstance(c, np.ndarray)}
    return replace(samples, **kept)


def take_rows(
    kind: Callable[..., Table], stated: StatedValues, rows: Ints, **columns: object
) -> Table | None:
    """Return samples of the plausible rows of a message; None if there are none.

    Parameters
    ----------
    kind
        Class of the samples.
    stated, rows
        Values of the message, and its (K,) plausible rows.
    **columns
        Further fields: (N, ...) columns of all rows, or what is common to them.
    """
    if not len(rows):
        return None
    taken = {n: c[rows] if isinstance(c, np.ndarray) else c for n, c in columns.items()}
    return kind(time_boot_s=stated.time_s[rows], source=stated.source, **taken)


def position_samples(stated: StatedValues) -> Found[PositionSamples]:
    """Return valid positions that agree with their neighbours in time, with heights above home.

    Rows without a position are not reported as losses.
    """
    time_s, valid = stated.time_s, stated.valid
    place = [c if valid is None else np.where(valid, c, np.nan) for c in stated.columns[:3]]
    rows = find_plausible_rows(time_s, is_near_track(time_s, *place), dense=True)
    notes = describe_left_out(stated.source, time_s, rows, valid)
    home = stated.columns[3] if len(stated.columns) > 3 else np.full(len(time_s), np.nan)
    named = dict(zip(_PLACE_COLUMNS, place, strict=True))
    home_m = np.where(is_height(home), home, np.nan)
    return take_rows(
        PositionSamples, stated, rows, **named, height_home_m=home_m, datum="msl"
    ), notes


def velocity_samples(stated: StatedValues) -> Found[VelocitySamples]:
    """Return velocities north, east, down that are possible for an aircraft."""
    ned = np.stack(stated.columns, axis=1)
    if stated.valid is not None:
        ned = np.where(stated.valid[:, None], ned, np.nan)
    rows = _below(_FASTEST_M_S, stated.time_s, ned)
    return take_rows(VelocitySamples, stated, rows, ned_m_s=ned), ()


def turn_rate_samples(stated: StatedValues) -> Found[TurnRateSamples]:
    """Return angular rates about forward, right, down that a gyroscope can measure."""
    body = np.stack(stated.columns, axis=1)
    if not body.any():  # firmware without rates sends zeros throughout
        return None, ()
    rows = _below(_FASTEST_RAD_S, stated.time_s, body)
    return take_rows(TurnRateSamples, stated, rows, body_rad_s=body), ()


def _below(largest: float, time_s: Floats, rates: Floats) -> Ints:
    """Return rows in the order of time whose rates (N, 3) are possible; none of a single one."""
    rows = find_plausible_rows(time_s, np.asarray((np.abs(rates) < largest).all(axis=1)))
    return rows if len(rows) > 1 else rows[:0]


def unit_quaternions(xyzw: Floats) -> Floats:
    """Normalise (N, 4) quaternions; NaN where their length is not nearly one."""
    length = np.linalg.norm(xyzw, axis=1, keepdims=True)
    near = np.abs(length - 1) < 0.01
    return np.where(near, xyzw / np.where(near, length, 1.0), np.nan)


def quaternions_of_angles(rpy_rad: Floats, sane: Bools) -> Floats:
    """Convert roll, pitch, yaw (N, 3) to (N, 4) quaternions; NaN where these are not angles."""
    roll, pitch, yaw = np.where(sane[:, None], rpy_rad, 0.0).T
    xyzw = xyzw_from_matrix(matrix_from_ypr(yaw, pitch, roll))
    return np.where(sane[:, None], xyzw, np.nan)


def attitude_samples(stated: StatedValues) -> Found[AttitudeSamples]:
    """Return attitudes of the vehicle from quaternions x, y, z, w or roll, pitch, yaw [deg]."""
    columns = np.stack(stated.columns, axis=1)
    if len(stated.columns) == 4:
        xyzw = unit_quaternions(columns)
    else:
        sane = are_body_angles(columns)
        xyzw = quaternions_of_angles(np.radians(np.where(sane[:, None], columns, 0.0)), sane)
    rows = find_plausible_rows(stated.time_s, np.asarray(np.isfinite(xyzw).all(axis=1)), dense=True)
    notes = describe_left_out(stated.source, stated.time_s, rows)
    return take_rows(AttitudeSamples, stated, rows, ned_from_body_xyzw=xyzw), notes


def home_samples(stated: StatedValues) -> Found[HomeSamples]:
    """Return the plausible home positions."""
    latitude, longitude, height = stated.columns
    sane = is_place(latitude, longitude) & is_height(height)
    sane = sane if stated.valid is None else np.asarray(sane & stated.valid)
    rows = find_plausible_rows(stated.time_s, sane)
    named = dict(zip(_PLACE_COLUMNS, stated.columns, strict=True))
    return take_rows(HomeSamples, stated, rows, **named, datum="msl"), ()


def reception_samples(stated: StatedValues) -> Found[ReceptionSamples]:
    """Return numbers of satellites and their geometry, where either is stated."""
    satellites, hdop = stated.columns
    satellites = np.where((satellites > 0) & (satellites < _MOST_SATELLITES), satellites, np.nan)
    hdop = np.where((hdop > 0) & (hdop < _LARGEST_HDOP), hdop, np.nan)
    rows = find_plausible_rows(stated.time_s, np.isfinite(satellites) | np.isfinite(hdop))
    return take_rows(ReceptionSamples, stated, rows, satellites=satellites, hdop=hdop), ()


def clock_samples(stated: StatedValues) -> ClockSamples | None:
    """Return a clock, if any row states a UTC."""
    (utc_s,) = stated.columns
    rows = find_plausible_rows(stated.time_s, utc_s > 0)  # NaN compares False
    return take_rows(ClockSamples, stated, rows, utc_s=utc_s)


def median_undulation_m(ellipsoid_m: Floats, sea_level_m: Floats) -> float:
    """Return geoid above ellipsoid from heights (N,) above both; NaN where none is plausible."""
    difference = ellipsoid_m - sea_level_m
    believable = difference[np.abs(difference) < _LARGEST_UNDULATION_M]
    return float(np.median(believable)) if len(believable) else float("nan")


def merge_sigmas(
    positions: list[StatedValues], tilts: list[StatedValues], fix: StatedValues | None = None
) -> EstimatorSigmas | None:
    """Merge the accuracies stated by messages, at the times of the first that states any.

    Parameters
    ----------
    positions
        Horizontal and vertical standard deviations [m]; where two messages state the same, the
        larger one is used.
    tilts
        Those of roll and pitch [rad].
    fix
        The receiver's type of fix, in MAVLink's numbers.
    """
    base: Floats | None = None
    used: list[str] = []
    merged: dict[str, Floats] = {}
    parts = [
        (stated, key, column, _LARGEST_SIGMA_M)
        for stated in positions
        for key, column in zip(("horizontal", "vertical"), stated.columns, strict=True)
    ]
    parts += [(stated, "tilt", stated.columns[0], _LARGEST_SIGMA_RAD) for stated in tilts]
    # interpolate each at the times of the first; of two for the same quantity take the larger
    for stated, key, values, limit in parts:
        rows = find_plausible_rows(stated.time_s, (values > 0) & (values < limit))
        if not len(rows):
            continue
        time_s = stated.time_s[rows]
        base = time_s if base is None else base
        here = np.interp(base, time_s, values[rows])
        merged[key] = np.fmax(merged[key], here) if key in merged else here
        used.append(stated.source)
    if base is None:
        return None
    silent = np.full(len(base), np.nan)
    return EstimatorSigmas(
        time_boot_s=base,
        horizontal_m=merged.get("horizontal", silent),
        vertical_m=merged.get("vertical", silent),
        tilt_rad=merged.get("tilt", silent),
        yaw_rad=silent,
        is_fixed=_is_fixed(base, fix),
        source="+".join(dict.fromkeys(used)),
    )


def _is_fixed(at_s: Floats, fix: StatedValues | None) -> Bools:
    """Return (N,) whether the receiver's solutions before and after are fixed RTK ones."""
    if fix is None or not len(fix.time_s):
        return np.zeros(len(at_s), dtype=np.bool_)
    fixed = (fix.columns[0] == RTK_FIXED).astype(float)
    return np.asarray(np.interp(at_s, fix.time_s, fixed) == 1.0)

"""Rows of a flight that lie off the rows before and after them: one damaged value, not a movement.

A vehicle is heavy: where it is and how it is turned follow from the rows about. A row that no
line through its neighbours explains, from neither side, has damaged bytes; a step that stays (a
new fix, a gimbal sent to another angle) is allowed by the rows after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.geometry.earth.geodesy import enu_from_geodetic
from uavgram.geometry.motion.rotation import matrix_from_ypr, xyzw_from_matrix
from uavgram.geometry.motion.running import running_median, windows
from uavgram.io.logs.quality.samples import rows_of
from uavgram.model.arrays import Floats
from uavgram.model.flight.log import Boot, PositionSamples
from uavgram.model.flight.second_opinions import TurnRateSamples
from uavgram.model.naming import listed

_FEWEST_ROWS = 5
_NAMED = 4  # rows in one remark


@dataclass(frozen=True)
class _Agility:
    """What a row may lie off its neighbours: a floor, and the acceleration that is still usual.

    Undamaged logs of ArduPilot and PX4 lie off by 1.3 m (0.6 s apart) and by 2 degrees (0.1 s
    apart) at most in steady flight, more in turbulence, which the rows about a row show.
    """

    floor: float
    acceleration: float


_PLACE = _Agility(floor=1.0, acceleration=10.0)  # m, m/s²
# Of quaternions, whose distance is half of the small angle between them.
_TURN = _Agility(floor=np.radians(3.0) / 2, acceleration=np.radians(100.0) / 2)
_CROWDED = 0.2  # of the usual step between rows
_UNREST = 6.0  # times the median of the fifteen rows about it


def without_damaged_rows(boot: Boot) -> tuple[Boot, tuple[str, ...]]:
    """The boot less positions, attitudes and gimbal rows off their neighbours; and which."""
    notes: list[str] = []
    positions, attitudes, gimbal = boot.positions, boot.attitudes, boot.gimbal
    if positions is not None:
        off_m = _off(positions.time_boot_s, _place_m(positions), _PLACE)
        notes += _remark(positions.source, positions.time_boot_s, off_m, "m")
        positions = rows_of(positions, off_m == 0)
    if attitudes is not None:
        time_s = attitudes.time_boot_s
        slack = _uneven_turn(time_s, boot.turn_rates) / 2  # of quaternions: half the angle
        off = _off(time_s, _continuous(attitudes.ned_from_body_xyzw), _TURN, slack)
        notes += _remark(attitudes.source, attitudes.time_boot_s, _degrees(off), "degrees")
        attitudes = rows_of(attitudes, off == 0)
    if gimbal is not None:
        matrix = matrix_from_ypr(gimbal.yaw_rad, gimbal.pitch_rad, gimbal.roll_rad)
        off = _off(gimbal.time_boot_s, _continuous(xyzw_from_matrix(matrix)), _TURN)
        notes += _remark(gimbal.source, gimbal.time_boot_s, _degrees(off), "degrees")
        gimbal = rows_of(gimbal, off == 0)
    return replace(boot, positions=positions, attitudes=attitudes, gimbal=gimbal), tuple(notes)


def off_neighbours(time_s: Floats, values: Floats) -> Floats:
    """(N,) by how much each row lies off what its neighbours say, the kindest of them.

    That is the row between its neighbours, the line through the two rows before, the line through
    the two after, or the nearer neighbour itself.

    Parameters
    ----------
    time_s
        (N,) strictly increasing.
    values
        (N, K) what is continuous in time.
    """
    steps = np.linalg.norm(np.diff(values, axis=0), axis=1)
    none = np.array([np.inf])
    lines = [_off_line(time_s, values, *pair) for pair in ((-1, 1), (-2, -1), (1, 2))]
    return np.asarray(np.minimum.reduce([*lines, np.append(none, steps), np.append(steps, none)]))


def _off_line(time_s: Floats, values: Floats, first: int, second: int) -> Floats:
    """(N,) distance from the line through the rows so many after each; infinite without them."""
    row = np.arange(len(time_s))
    a, b = row + first, row + second
    there = (a >= 0) & (b < len(row))
    a, b = np.where(there, a, 0), np.where(there, b, 1)
    share = (time_s - time_s[a]) / (time_s[b] - time_s[a])
    apart = values - values[a] - share[:, None] * (values[b] - values[a])
    return np.where(there, np.linalg.norm(apart, axis=1), np.inf)


def _uneven_turn(time_s: Floats, rates: TurnRateSamples | None) -> Floats:
    """(N,) angles by which stated rates let a row lie off its neighbours: 0 in a steady turn."""
    if rates is None or len(time_s) < _FEWEST_ROWS:
        return np.zeros(len(time_s))
    columns = [np.interp(time_s, rates.time_boot_s, c) for c in rates.body_rad_s.T]
    span = [np.ptp(windows(c, 5), axis=1) for c in columns]
    return np.asarray(np.linalg.norm(span, axis=0) * np.gradient(time_s))


def _off(time_s: Floats, values: Floats, usual: _Agility, slack: Floats | float = 0.0) -> Floats:
    """(N,) distance from the neighbours where it is too much, else 0.

    Parameters
    ----------
    time_s
        (N,) strictly increasing.
    values
        (N, K) what is continuous in time.
    usual
        How far a row may lie off.
    slack
        (N,) how much farther, as the log itself tells.
    """
    if len(time_s) < _FEWEST_ROWS:
        return np.zeros(len(time_s))
    off = off_neighbours(time_s, values)
    step_s = np.diff(time_s)
    widest_s = np.maximum(np.append(step_s[0], step_s), np.append(step_s, step_s[-1]))
    nearest_s = np.minimum(np.append(np.inf, step_s), np.append(step_s, np.inf))
    # Two rows at almost one instant: what they differ by becomes a speed without bounds.
    share = np.minimum(nearest_s / (_CROWDED * float(np.median(step_s))), 1.0)
    unrest = running_median(off, 15)
    allowed = (
        usual.floor * share + usual.acceleration * share * widest_s**2 + _UNREST * unrest + slack
    )
    return np.where(off > allowed, off, 0.0)


def _place_m(positions: PositionSamples) -> Floats:
    p = positions
    origin = (float(p.latitude_deg[0]), float(p.longitude_deg[0]), float(p.height_m[0]))
    return enu_from_geodetic(p.latitude_deg, p.longitude_deg, p.height_m, origin)


def _continuous(xyzw: Floats) -> Floats:
    """(N, 4) quaternions, of each the one of its two signs that is nearer to the row before."""
    along = np.sum(xyzw[1:] * xyzw[:-1], axis=1)
    sign = np.cumprod(np.append(1.0, np.where(along < 0, -1.0, 1.0)))
    return np.asarray(xyzw * sign[:, None])


def _degrees(chord: Floats) -> Floats:
    """Angles between quaternions (N,) so far apart."""
    return np.asarray(np.degrees(4 * np.arcsin(np.clip(chord / 2, 0.0, 1.0))))


def _remark(source: str, time_s: Floats, off: Floats, unit: str) -> list[str]:
    """Which rows lie off, when and by how much."""
    rows = np.flatnonzero(off)
    if not len(rows):
        return []
    named = listed((f"by {off[k]:.3g} {unit} at {time_s[k]:.2f} s" for k in rows), _NAMED)
    what = "1 row lies" if len(rows) == 1 else f"{len(rows)} rows lie"
    return [
        f"{what} off the rows before and after ({source}: {named}, since boot): taken for "
        "damaged and left out"
    ]

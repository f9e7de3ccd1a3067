"""Rolling shutter: camera motion during the readout, and readjustment where it was wrong.

Without a log, the motion is estimated from places and times of the photos. It is wrong where the
adjusted clock moves the exposures to another moment of the flight, or where the readout time
absorbed errors of another kind.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.known_points import find_candidate_poses
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.observed import (
    GLOBAL_SHUTTER,
    MIN_SHIFT_PX,
    add_readout,
    estimate_edge_shift_px,
)
from uavgram.model.arrays import Floats
from uavgram.model.camera import UNKNOWN_READOUT, Readout
from uavgram.model.flight_log import Track
from uavgram.model.message import Message
from uavgram.model.survey import RollingShutter, Survey
from uavgram.stages.refine.readjustment import readjust

USUAL_M_S = 7.0
"""Speed of a drone that takes photos of the ground [m/s]."""

SPEED_SIGMA = 0.65
"""Sigma of that speed, as a share of it: from photos while it hovers to 15 m/s."""

RATE_RAD_S = 0.1
"""Sigma of the angular rate, six degrees a second; motion other than towards the next photo has the
same effect."""

MAX_DISTANCE_RATIO = 2.0
"""Ratio of two adjacent distances between photos, above which the longer one is not part of a line
of photos."""

MIN_COSINE = 0.8
"""Least cosine of the change of direction within a line: then a long distance is of the same
line."""

TIMED_SIGMA = 0.05
"""Sigma of the speed from the photos' times, as a share of it: the error common to all of them, as
a drone flies unevenly between two photos."""

TIMED_RATE_RAD_S = 0.05
"""Sigma of the angular rate, three degrees a second, where times give each photo's speed. The
remaining error of the speed, some 0.7 m/s at 40 m, is a third of that."""

MAX_TIME_ERROR = 0.2
"""Largest error of the time between photos, as a share of it: beyond it, a photo's own speed is
worth less than the mean of all."""

SLOWEST_M_S, FASTEST_M_S = 0.3, 40.0
"""Range of plausible speeds [m/s]: others come from times that are not those of the exposures
(copied files, a clock that was set), or from hovering, where there is no effect."""

MIN_FIT_RATIO = 1.5
"""Least factor by which squares of ties decrease with a rolling shutter, relative to as many
unknowns without effect. For flights of 8 photos with 350 to 590 sightings it was 0.95 to 1.0
without one, and 2.7 to 12 with 10 ms."""


class _Velocities(NamedTuple):
    """Velocities (F, 3) of the cameras [m/s], and their uncertainty.

    `sigma` is that of the common speed, as a share; `rate_sigma_rad_s` that of each angular rate.
    """

    velocity: Floats
    sigma: float
    rate_sigma_rad_s: float


def add_motion_by_photos(survey: Survey) -> Survey:
    """Add the motion of the cameras as far as the photos determine it.

    The motion is along the way from the photo before to the photo after: in the time between them,
    where that is known, otherwise all at one usual speed. The common error of that speed is the
    same unknown as a readout time. Ties determine the rotation during each photo. A survey without
    ties gets no motion, nor does one whose rows are read at once.
    """
    readout = survey.calibration.readout or UNKNOWN_READOUT
    if isinstance(survey.track, Track) or readout == GLOBAL_SHUTTER or not survey.ties.points:
        return survey
    center, rotation = _first_poses(survey)
    flown = _velocities_by_times(survey, center) or _velocities_at_usual_speed(center)
    if flown is None:
        return survey
    velocity = flown.velocity
    if survey.gauge == "plane":
        velocity = np.einsum("fji,fj->fi", np.nan_to_num(rotation), velocity)
    sigma_s = float(np.hypot(flown.sigma * readout.value_s, readout.sigma_s))
    return replace(
        survey,
        rolling=RollingShutter(
            readout=Readout(value_s=readout.value_s, sigma_s=sigma_s),
            motion=np.hstack([velocity, np.zeros_like(velocity)]),
            rate_sigma_rad_s=flown.rate_sigma_rad_s,
            by_photos=True,
        ),
    )


def is_shutter_unknown(survey: Survey) -> bool:
    """Return whether a rolling shutter is neither stated nor visible by a log."""
    rolling = survey.rolling
    return rolling is not None and rolling.by_photos and not rolling.readout.value_s


def is_shutter_needed(plain: Adjustment, rolling: Adjustment) -> bool:
    """Return whether ties fit much better with rotations during the readout.

    The medians are compared, since wrong ties are still among them, and the effect of so many
    unknowns is subtracted.

    Parameters
    ----------
    plain, rolling
        Adjustments of the same ties without a shutter, and with one.
    """
    before, after = (
        float(np.median(np.sum(one.minimum.blocks["ties"].residual ** 2, axis=1)))
        for one in (plain, rolling)
    )
    unknowns = rolling.problem.layout.size - plain.problem.layout.size
    by_chance = 1.0 - unknowns / max(plain.degrees_of_freedom, 1)
    return before * by_chance > MIN_FIT_RATIO * after


def _first_poses(survey: Survey) -> tuple[Floats, Floats]:
    """Return centres (F, 3) and rotations (F, 3, 3), of frames in order; NaN where unknown."""
    if survey.seeds is not None:
        return survey.seeds.center_world_m, survey.seeds.world_from_camera
    frame = {name: k for k, name in enumerate(survey.frame_id)}
    center = np.full((len(frame), 3), np.nan)
    rotation = np.full((len(frame), 3, 3), np.nan)
    for one in find_candidate_poses(survey):
        k = frame[one.frame_id]
        center[k], rotation[k] = one.center_world_m[0], one.world_from_camera[0]
    return center, rotation


def _velocities_at_usual_speed(center: Floats) -> _Velocities | None:
    """Compute velocities along the way from photo to photo, without times."""
    order = np.flatnonzero(np.isfinite(center[:, 0]))
    if len(order) < 2:
        return None
    ahead = _velocities_ahead(np.diff(center[order], axis=0), np.ones(len(order) - 1))
    size = np.linalg.norm(ahead, axis=1)
    if not np.any(size > 0):
        return None
    velocity = np.zeros_like(center)
    usual = np.median(size[size > 0])
    velocity[order] = ahead * (USUAL_M_S / np.maximum(usual, size))[:, None]
    return _Velocities(velocity, SPEED_SIGMA, RATE_RAD_S)


def _velocities_by_times(survey: Survey, center: Floats) -> _Velocities | None:
    """Compute velocities from photo to photo by their times; None where they are implausible.

    With times to whole seconds, each photo's own speed is uncertain: then all have the mean one.
    """
    placed = np.flatnonzero(np.isfinite(center[:, 0]))
    time, sigma = survey.time_s[placed], survey.time_sigma_s[placed]
    if len(placed) < 2 or not np.isfinite(time + sigma).all():
        return None
    by_time = np.argsort(time, kind="stable")
    order = placed[by_time]
    way, apart = np.diff(center[order], axis=0), np.diff(time[by_time])
    if not np.median(apart) > 0:
        return None
    # Relative error of the time between photos: with a large one, all get the mean speed.
    doubt = float(np.sqrt(2.0) * np.median(sigma) / np.median(apart))
    if doubt > MAX_TIME_ERROR:
        moved = np.linalg.norm(way, axis=1)
        near = moved <= MAX_DISTANCE_RATIO * np.median(moved)
        mean = moved[near].sum() / apart[near].sum() if apart[near].sum() > 0 else np.nan
        ahead = _velocities_ahead(way, np.ones(len(way)))
        size = np.linalg.norm(ahead, axis=1, keepdims=True)
        ahead = mean * ahead / np.where(size > 0, size, 1.0)
    else:
        ahead = _velocities_ahead(way, np.maximum(apart, MAX_TIME_ERROR * np.median(apart)))
    # Implausible speeds: times that are not those of the exposures, or hovering.
    usual = float(np.median(np.linalg.norm(ahead, axis=1)))
    if not SLOWEST_M_S <= usual <= FASTEST_M_S:
        return None
    velocity = np.zeros_like(center)
    velocity[order] = ahead
    share = float(np.hypot(TIMED_SIGMA, doubt / np.sqrt(len(order))))
    return _Velocities(velocity, share, TIMED_RATE_RAD_S)


def _velocities_ahead(way: Floats, apart: Floats) -> Floats:
    """Compute the velocity (n + 1, 3) of each of n + 1 photos from the ways (n, 3) between them.

    The velocity is that of the parabola through the photo and both its neighbours; along the line
    of photos only, where the way to one of them is not part of it.

    Parameters
    ----------
    way
        (n, 3) from each photo to the next.
    apart
        (n,) duration of each.
    """
    ends = [0, *range(len(way))], [*range(len(way)), -1]
    ways, (earlier, later) = [way[k] for k in ends], [apart[k, None] for k in ends]
    long, short = (np.linalg.norm(each, axis=1) for each in ways)
    before, after = ways[0] / earlier, ways[1] / later
    # Derivative of the parabola at the photo in the middle.
    both = (before * later + after * earlier) / (earlier + later)
    turned = np.sum(ways[0] * ways[1], axis=1) < MIN_COSINE * long * short
    both = np.where((turned & (long > MAX_DISTANCE_RATIO * short))[:, None], after, both)
    return np.asarray(
        np.where((turned & (short > MAX_DISTANCE_RATIO * long))[:, None], before, both)
    )


MAX_READOUT_SIGMAS = 5.0
"""Largest deviation of the readout time in prior sigmas: 150 ms without prior knowledge."""


def correct_readout(
    survey: Survey, refined: Refined
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Update the camera's motion at the exposures to the adjusted clock, and readjust.

    The motion while a photo is read is looked up at the clock beforehand, which may be wrong by
    tenths of a second: by then a copter in the wind turns another way. An impossible readout time
    is left out, and reported.

    Parameters
    ----------
    survey
        The original survey.
    refined
        Its adjustment.
    """
    adjustment = refined.adjustment
    own, state = adjustment.survey, adjustment.state
    if own.rolling is None or own.rolling.by_photos:
        return survey, refined, ()
    known, found_s = own.rolling.readout, float(state.readout[0])
    if abs(found_s - known.value_s) > MAX_READOUT_SIGMAS * known.sigma_s:
        without = replace(own, rolling=None)
        absurd = (_implausible_message(known, found_s),)
        return replace(survey, rolling=None), _readjust_with_motion(refined, without), absurd
    try:
        moved = add_readout(own, state.telemetry)
        whole = add_readout(survey, state.telemetry)
    except ValueError:  # the adjusted clock is at the very end of the log
        return survey, refined, ()
    if moved.rolling is None:
        return survey, refined, ()
    longest_s = abs(found_s) + known.sigma_s
    if (
        estimate_edge_shift_px(own, longest_s * (moved.rolling.motion - own.rolling.motion))
        < MIN_SHIFT_PX
    ):
        return survey, refined, ()
    return whole, _readjust_with_motion(refined, moved), ()


def _implausible_message(known: Readout, found_s: float) -> Message:
    text = (
        "The picks fit only a camera that exposes a photo row by row in "
        f"{1e3 * abs(found_s):.0f} ms, which is impossible (known are {1e3 * known.value_s:.0f} ± "
        f"{1e3 * known.sigma_s:.0f} ms). So something else does not fit, and this effect was left "
        "out. Read the warnings first; points off the ground can cause this."
    )
    return Message("info", "readout-left-out", text)


def _readjust_with_motion(refined: Refined, survey: Survey) -> Refined:
    """Readjust the same observations with another motion, or none, from the current estimate."""
    try:
        return replace(refined, adjustment=readjust(refined.adjustment, survey))
    except (SingularError, ValueError):  # by rounding only, or the other motion is impossible here
        return refined

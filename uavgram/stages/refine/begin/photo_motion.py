"""How cameras moved while their photos were read, where no log says it: by places and times."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.rolling import NONE
from uavgram.model.arrays import Floats
from uavgram.model.camera.tags import UNKNOWN_READOUT, Readout
from uavgram.model.flight.log import Track
from uavgram.model.survey.survey import RollingShutter, Survey

USUAL_M_S = 7.0
"""Speed of a drone that takes photos of the ground."""

SPEED_SIGMA = 0.65
"""Of that speed, as a share: from photos while it hovers to 15 m/s."""

RATE_RAD_S = 0.1
"""Sigma of how fast it turns then, six degrees a second: also what it moves otherwise than to the
next photo looks like that."""

JUMP = 2.0
"""Times as long as the other: a way to the next photo that is no part of a line of photos."""

STRAIGHT = 0.8
"""Cosine from which on the way goes on as before: then a long one is of the same line."""

TIMED_SIGMA = 0.05
"""Of the speed that the photos' times give, as a share: what all of them have in common, as a drone
flies on between two photos in another way than evenly."""

TIMED_RATE_RAD_S = 0.05
"""As `RATE_RAD_S`, where times tell each photo's speed: three degrees a second. What is left of the
speed, some 0.7 m/s at 40 m, is a third of that."""

VAGUE = 0.2
"""Share of the time between photos by which it may be wrong: beyond it, a photo's own speed is
worth less than the mean of all."""

SLOWEST_M_S, FASTEST_M_S = 0.3, 40.0
"""Of a drone on its way: other speeds come of times that are not those of the exposures (copied
files, a clock that was set), or of hovering, where nothing is to be found."""

SHUTTER = 1.5
"""Times by which squares of ties fall, beside those of as many unknowns that say nothing, where a
shutter is felt. Of flights of 8 photos with 350 to 590 sightings it was 0.95 to 1.0 without one,
and 2.7 to 12 with 10 ms."""


class _Flown(NamedTuple):
    """Velocities (F, 3) of the cameras [m/s], and what is not known of them.

    `sigma` is that of the speed of all, as a share, `rate_sigma_rad_s` how fast each one may turn.
    """

    velocity: Floats
    sigma: float
    rate_sigma_rad_s: float


def with_motion_by_photos(survey: Survey) -> Survey:
    """The survey with the motion of its cameras as far as its photos tell it.

    Along the way from the photo before to the photo after: in the time between them, where that is
    known, else all at one usual speed. How wrong that speed is in common is the same unknown as a
    readout time. Which way the camera turned meanwhile, ties tell for each photo. A survey without
    ties has none of it, nor has one whose rows are read at once.
    """
    readout = survey.calibration.readout or UNKNOWN_READOUT
    if isinstance(survey.track, Track) or readout == NONE or not survey.ties.points:
        return survey
    center, rotation = _first_poses(survey)
    flown = _by_times(survey, center) or _at_usual_speed(center)
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


def is_in_question(survey: Survey) -> bool:
    """Whether nobody says that rows are read one after the other, and no log would show it."""
    rolling = survey.rolling
    return rolling is not None and rolling.by_photos and not rolling.readout.value_s


def ask_for_shutter(plain: Adjustment, rolling: Adjustment) -> bool:
    """Whether ties fit much better where each photo may have turned while it was read.

    By the median, as wrong ones are still among them, and beyond what so many unknowns explain.

    Parameters
    ----------
    plain, rolling
        The same ties without a shutter, and with one.
    """
    before, after = (
        float(np.median(np.sum(one.minimum.blocks["ties"].residual ** 2, axis=1)))
        for one in (plain, rolling)
    )
    unknowns = rolling.problem.layout.size - plain.problem.layout.size
    by_chance = 1.0 - unknowns / max(plain.degrees_of_freedom, 1)
    return before * by_chance > SHUTTER * after


def _first_poses(survey: Survey) -> tuple[Floats, Floats]:
    """Centres (F, 3) and rotations (F, 3, 3), of frames in order; NaN where nothing is known."""
    if survey.seeds is not None:
        return survey.seeds.center_world_m, survey.seeds.world_from_camera
    frame = {name: k for k, name in enumerate(survey.frame_id)}
    center = np.full((len(frame), 3), np.nan)
    rotation = np.full((len(frame), 3, 3), np.nan)
    for one in survey.candidate_poses:
        k = frame[one.frame_id]
        center[k], rotation[k] = one.center_world_m[0], one.world_from_camera[0]
    return center, rotation


def _at_usual_speed(center: Floats) -> _Flown | None:
    """Along the way from photo to photo, where nobody says when they were taken."""
    order = np.flatnonzero(np.isfinite(center[:, 0]))
    if len(order) < 2:
        return None
    ahead = _ahead(np.diff(center[order], axis=0), np.ones(len(order) - 1))
    size = np.linalg.norm(ahead, axis=1)
    if not np.any(size > 0):
        return None
    velocity = np.zeros_like(center)
    usual = np.median(size[size > 0])
    velocity[order] = ahead * (USUAL_M_S / np.maximum(usual, size))[:, None]
    return _Flown(velocity, SPEED_SIGMA, RATE_RAD_S)


def _by_times(survey: Survey, center: Floats) -> _Flown | None:
    """Along the way from photo to photo, in the time between them; None where it makes no sense.

    Of times to whole seconds, each photo's own speed says little: then all have the mean one.
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
    doubt = float(np.sqrt(2.0) * np.median(sigma) / np.median(apart))
    if doubt > VAGUE:
        moved = np.linalg.norm(way, axis=1)
        near = moved <= JUMP * np.median(moved)
        mean = moved[near].sum() / apart[near].sum() if apart[near].sum() > 0 else np.nan
        ahead = _ahead(way, np.ones(len(way)))
        size = np.linalg.norm(ahead, axis=1, keepdims=True)
        ahead = mean * ahead / np.where(size > 0, size, 1.0)
    else:
        ahead = _ahead(way, np.maximum(apart, VAGUE * np.median(apart)))
    usual = float(np.median(np.linalg.norm(ahead, axis=1)))
    if not SLOWEST_M_S <= usual <= FASTEST_M_S:
        return None
    velocity = np.zeros_like(center)
    velocity[order] = ahead
    share = float(np.hypot(TIMED_SIGMA, doubt / np.sqrt(len(order))))
    return _Flown(velocity, share, TIMED_RATE_RAD_S)


def _ahead(way: Floats, apart: Floats) -> Floats:
    """(n + 1, 3) how fast each of n + 1 photos moves, by the ways (n, 3) between them.

    That of the parabola through the photo and both its neighbours; along a line of photos alone,
    where the way to one of them is none of it.

    Parameters
    ----------
    way
        (n, 3) from each photo to the next.
    apart
        (n,) the time that this took.
    """
    ends = [0, *range(len(way))], [*range(len(way)), -1]
    ways, (earlier, later) = [way[k] for k in ends], [apart[k, None] for k in ends]
    long, short = (np.linalg.norm(each, axis=1) for each in ways)
    before, after = ways[0] / earlier, ways[1] / later
    both = (before * later + after * earlier) / (earlier + later)
    turned = np.sum(ways[0] * ways[1], axis=1) < STRAIGHT * long * short
    both = np.where((turned & (long > JUMP * short))[:, None], after, both)
    return np.asarray(np.where((turned & (short > JUMP * long))[:, None], before, both))

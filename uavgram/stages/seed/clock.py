"""Another clock of the camera than stated, by the scatter of points in several photos."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.camera_motion import (
    HEADING_BIAS,
    LEVER_ARM,
    SHARED_SIZE,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import Track
from uavgram.model.frames import PhotoExposures, Poses, TelemetryPrior
from uavgram.model.survey import Survey

MAX_CLOCK_S, STEP_S = 60.0, 0.5
"""Largest correction of the clock in the search, and its step [s]."""

CLOCK_SIGMAS = 3.0
"""Correction of the clock, in its stated sigmas, up to which the adjustment finds it anyway."""

MAX_ALIKE_RATIO, MAX_HOVER_S = 2.0, 10.0
"""Ratio of the scatter to the least one up to which an instant fits alike; and the largest time
between both [s]."""

MAX_POSES = 10_000
"""Number of poses that are predicted at once."""


class OtherClock(NamedTuple):
    """Survey by another clock.

    Attributes
    ----------
    survey
        The survey with seeds by that clock, and a prior about it.
    scatter_m
        Scatter of points in several photos [m].
    shift_s
        Correction of the stated clock [s].
    """

    survey: Survey
    scatter_m: float
    shift_s: float


def find_other_clock(
    survey: Survey, compute_scatter_m: Callable[[Poses], float]
) -> OtherClock | None:
    """Find the other clock with the least scatter of points in several photos.

    Parameters
    ----------
    survey
        Survey with the track of a log; without it, the clock does not matter.
    compute_scatter_m
        Function that computes the scatter [m].

    Returns
    -------
    OtherClock or None
        None where the log has no other instants, or shows the points in the sky at all of them.
    """
    prior, track, seeds = survey.telemetry, survey.track, survey.seeds
    if prior is None or seeds is None or track is None or isinstance(track, PhotoExposures):
        return None
    tried = np.arange(-MAX_CLOCK_S, MAX_CLOCK_S + STEP_S / 2.0, STEP_S)
    tried = tried[np.abs(tried) > CLOCK_SIGMAS * prior.clock_sigma_s]
    first_s, last_s = _find_span(track)
    inside = (tried >= prior.time_s.max() - last_s) & (tried <= prior.time_s.min() - first_s)
    tried = tried[inside]
    each = _predict_seeds(survey, prior, track, seeds, tried)
    found = np.array([compute_scatter_m(poses) for poses in each])
    if not np.isfinite(found).any():
        return None
    least_m = float(found.min())
    # While the drone hovers, every instant fits alike: take the middle of those.
    alike = tried[found < MAX_ALIKE_RATIO * least_m]
    alike = alike[np.abs(alike - tried[int(found.argmin())]) <= MAX_HOVER_S]
    shift_s, sigma_s = float(alike.mean()), float(np.ptp(alike) + STEP_S) / np.sqrt(12.0)
    (there,) = _predict_seeds(survey, prior, track, seeds, np.array([shift_s]))
    moved = replace(
        prior,
        time_s=prior.time_s - shift_s,
        middle_s=prior.middle_s - shift_s,
        clock_sigma_s=float(np.hypot(prior.clock_sigma_s, sigma_s)),
    )
    return OtherClock(replace(survey, seeds=there, telemetry=moved), least_m, shift_s)


def _find_span(track: Track) -> tuple[float, float]:
    """Return the first and the last instant at which a track has a pose."""
    every = (track.position_time_s, track.attitude_time_s, track.gimbal_time_s)
    known = [times for times in every if len(times)]
    return max(times[0] for times in known), min(times[-1] for times in known)


def _predict_seeds(
    survey: Survey, prior: TelemetryPrior, track: Track, seeds: Poses, shift_s: Floats
) -> Iterator[Poses]:
    """Predict the seeds by each of some corrections of the clock (n,)."""
    count = len(prior.time_s)
    shared = np.zeros(SHARED_SIZE)
    shared[LEVER_ARM], shared[HEADING_BIAS] = prior.lever_arm_m, prior.heading_bias_rad
    exposures = exposures_by_time(track, survey.frame_id)
    at_once = max(MAX_POSES // max(count, 1), 1)
    for first in range(0, len(shift_s), at_once):
        some_s = shift_s[first : first + at_once, None]
        since_s = np.tile(prior.time_s - prior.middle_s, len(some_s))
        there = exposures((prior.time_s - some_s).ravel())
        center, rotation, _ = predict_pose(there, prior.gimbal_from_camera, shared, since_s)
        for k in range(len(some_s)):
            own = slice(k * count, (k + 1) * count)
            at, turned = seeds.center_world_m.copy(), seeds.world_from_camera.copy()
            at[prior.frame_index], turned[prior.frame_index] = center[own], rotation[own]
            yield replace(seeds, center_world_m=at, world_from_camera=turned)

"""Test the stated clock of the camera by the scatter of points, before the adjustment.

A clock that is off by tens of seconds puts every photo elsewhere on the flight. The adjustment then
begins too far from the truth. But points in several photos are far apart on the ground by the
stated clock, and close together by the right one.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.motion.camera_motion import (
    HEADING_BIAS,
    LEVER_ARM,
    SHARED_SIZE,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.frames import PhotoExposures, Poses
from uavgram.model.survey import Survey
from uavgram.stages.seed.mount import MAX_SCATTER_RATIO, compute_scatter

MAX_CLOCK_S, STEP_S = 60.0, 0.5
"""Largest correction of the clock in the search, and its step [s]."""

CLOCK_SIGMAS = 3.0
"""Correction of the clock, in its stated sigmas, up to which the adjustment finds it anyway."""

MAX_ALIKE_RATIO, MAX_HOVER_S = 2.0, 10.0
"""Ratio of the scatter to the least one up to which an instant fits alike; and the largest time
between both [s]."""


class OtherClock(NamedTuple):
    """Survey by another clock.

    Attributes
    ----------
    survey
        The survey with seeds by that clock, and a prior about it.
    shift_s
        Correction of the stated clock [s].
    """

    survey: Survey
    shift_s: float


def find_other_clock(survey: Survey) -> OtherClock | None:
    """Move a survey to another clock that reduces the scatter of points in several photos by far.

    Parameters
    ----------
    survey
        Survey with the track of a log; without it, the clock does not matter.

    Returns
    -------
    OtherClock or None
        None where the stated clock is in order, or undetermined.
    """
    prior, track, seeds = survey.telemetry, survey.track, survey.seeds
    if prior is None or seeds is None or track is None or isinstance(track, PhotoExposures):
        return None
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)

    def scatter_m(poses: Poses) -> float:
        return compute_scatter(survey, poses, ray, np.eye(3))

    stated_m = scatter_m(seeds)
    exposures = exposures_by_time(track, [survey.frame_id[k] for k in prior.frame_index])
    shared = np.zeros(SHARED_SIZE)
    shared[LEVER_ARM], shared[HEADING_BIAS] = prior.lever_arm_m, prior.heading_bias_rad

    def seeds_at(shift_s: float) -> Poses:
        there = exposures(prior.time_s - shift_s)
        since_s = prior.time_s - prior.middle_s
        center, rotation, _ = predict_pose(there, prior.gimbal_from_camera, shared, since_s)
        at, turned = seeds.center_world_m.copy(), seeds.world_from_camera.copy()
        at[prior.frame_index], turned[prior.frame_index] = center, rotation
        return replace(seeds, center_world_m=at, world_from_camera=turned)

    found: dict[float, float] = {}
    for shift_s in np.arange(-MAX_CLOCK_S, MAX_CLOCK_S + STEP_S / 2.0, STEP_S).tolist():
        if abs(shift_s) > CLOCK_SIGMAS * prior.clock_sigma_s:
            with suppress(ValueError):  # outside the log
                found[shift_s] = scatter_m(seeds_at(shift_s))
    least_m = min(found.values(), default=np.inf)
    if not least_m < MAX_SCATTER_RATIO * stated_m:
        return None
    # While the drone hovers, every instant fits alike: take the middle of those.
    alike = np.array([one for one, size_m in found.items() if size_m < MAX_ALIKE_RATIO * least_m])
    best_s = min(found, key=found.__getitem__)
    alike = alike[np.abs(alike - best_s) <= MAX_HOVER_S]
    shift_s, sigma_s = float(alike.mean()), float(np.ptp(alike) + STEP_S) / np.sqrt(12.0)
    moved = replace(
        prior,
        time_s=prior.time_s - shift_s,
        middle_s=prior.middle_s - shift_s,
        clock_sigma_s=float(np.hypot(prior.clock_sigma_s, sigma_s)),
    )
    return OtherClock(replace(survey, seeds=seeds_at(shift_s), telemetry=moved), shift_s)

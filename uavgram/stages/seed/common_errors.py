"""Find an error common to all poses of a log before the adjustment, and correct it.

A clock that is off by tens of seconds puts every photo elsewhere on the flight, and a wrong mount
turns all of them. The adjustment then begins too far from the truth, and suspects lengths and
labels. But points in several photos are far apart on the ground with the mistake, and close
together without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.model.arrays import Floats
from uavgram.model.frames import Poses
from uavgram.model.message import Message
from uavgram.model.survey import Survey
from uavgram.stages.messages import TAKEN_INTO_ACCOUNT
from uavgram.stages.seed.clock import OtherClock, find_other_clock
from uavgram.stages.seed.directions import OtherDirections, list_other_directions

MIN_SCATTER_SHARE = 0.05
"""Scatter as stated, as a share of the height above the ground, below which nothing is wrong: at
most 0.04 in faultless surveys, at least 0.08 by clocks that are 8 s off."""

MAX_SCATTER_RATIO = 0.2
"""Largest remaining share of the scatter for a common error. Errors of single poses scatter the
points alike without it."""

MAX_ALIKE_RATIO = 1.5
"""Ratio of the scatters of two corrections up to which either may be right."""

HEIGHTS_M = np.geomspace(3.0, 500.0, 80)
"""Heights of the cameras above the ground that may explain the scatter instead [m]: the adjustment
finds a common error of all heights."""

MIN_SHARE_ON_GROUND = 0.9
"""Share of the picks whose rays must meet the ground."""


class CommonError(NamedTuple):
    """Survey without an error common to all of its poses.

    Attributes
    ----------
    survey
        The survey with seeds and a prior by the correction.
    shift_s
        Correction of the clock [s]; zero where another error was found.
    message
        Message on another error than that of the clock, which the adjustment determines; None for
        the clock.
    """

    survey: Survey
    shift_s: float = 0.0
    message: Message | None = None


def find_common_error(survey: Survey) -> CommonError | None:
    """Find the error common to all poses without which points in several photos agree.

    Parameters
    ----------
    survey
        Survey; without telemetry, nothing is common to its poses.

    Returns
    -------
    CommonError or None
        None where the poses are in order, or where several errors explain the scatter as well.
    """
    seeds = survey.seeds
    if seeds is None or survey.telemetry is None or len(np.unique(survey.pick_frame)) < 2:
        return None
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)

    def compute_scatter_m(poses: Poses) -> float:
        return _compute_scatter_m(survey, poses, ray)

    stated_m = compute_scatter_m(seeds)
    height_m = float(np.median(seeds.center_world_m[:, 2] - survey.ground.height_m))
    if stated_m < MIN_SCATTER_SHARE * height_m:
        return None
    found: list[OtherClock | OtherDirections] = [*list_other_directions(survey, compute_scatter_m)]
    clock = find_other_clock(survey, compute_scatter_m)
    found += [] if clock is None else [clock]
    least_m = min(one.scatter_m for one in found)
    if not least_m < MAX_SCATTER_RATIO * min(stated_m, height_m):
        return None
    # Photos that look straight down are turned alike by their mount and by their headings.
    best = next(one for one in found if one.scatter_m <= MAX_ALIKE_RATIO * least_m)
    rivals_m = [_find_heights_scatter_m(survey, compute_scatter_m)]
    rivals_m += [one.scatter_m for one in found if type(one) is not type(best)]
    if min(rivals_m) < MAX_ALIKE_RATIO * best.scatter_m:
        return None
    if isinstance(best, OtherClock):
        return CommonError(best.survey, best.shift_s)
    return CommonError(best.survey, message=_report_directions(best, stated_m))


def _find_heights_scatter_m(survey: Survey, compute_scatter_m: Callable[[Poses], float]) -> float:
    """Return the least scatter [m] with all cameras higher or lower by one amount."""
    seeds = survey.seeds
    assert seeds is not None  # noqa: S101  (the caller asked)
    above_m = float(np.median(seeds.center_world_m[:, 2]) - survey.ground.height_m)
    up = np.array([0.0, 0.0, 1.0])
    higher = (seeds.center_world_m + (each_m - above_m) * up for each_m in HEIGHTS_M.tolist())
    return min(compute_scatter_m(replace(seeds, center_world_m=center_m)) for center_m in higher)


def _report_directions(found: OtherDirections, stated_m: float) -> Message:
    """Report other directions of the camera, which the results take into account."""
    apart = f"{stated_m:.1f} m apart" if np.isfinite(stated_m) else "partly in the sky"
    text = (
        f"{found.finding}: where several photos show one point, their rays meet the ground {apart} "
        f"as stated, and {found.scatter_m:.1f} m apart with {found.turn}. {found.action} "
        f"{TAKEN_INTO_ACCOUNT}"
    )
    return Message("warning", "mount-turned", text)


def _compute_scatter_m(survey: Survey, poses: Poses, ray_camera: Floats) -> float:
    """Return the RMS scatter [m] of points on the ground between photos; infinite in the sky.

    Parameters
    ----------
    survey
        Survey with the picks.
    poses
        Poses of its frames.
    ray_camera
        (P, 3) rays of the picks.
    """
    # Repeated clicks in a photo are one sighting of their point.
    seen = np.stack([survey.pick_frame, survey.pick_label])
    (frame, label), first = np.unique(seen, axis=1, return_index=True)
    ground = intersect_ground(
        poses.center_world_m[frame],
        np.einsum("pij,pj->pi", poses.world_from_camera[frame], ray_camera[first]),
        np.array([survey.ground.height_m, 0.0, 0.0]),
        np.zeros(2),
        survey.height_above_m[label],
    )[:, :2]
    meets = np.isfinite(ground).all(axis=1)
    if meets.mean() < MIN_SHARE_ON_GROUND:
        return np.inf
    meets &= ~survey.is_free[label]
    place, owner = ground[meets], label[meets]
    count = np.bincount(owner)
    shared = count[owner] > 1
    if not shared.any():
        return np.inf
    # Distances from the mean of each point in several photos.
    mean = np.stack([np.bincount(owner, axis) for axis in place.T], axis=1)[owner]
    apart = place - mean / count[owner][:, None]
    return float(np.sqrt(np.mean(np.sum(apart[shared] ** 2, axis=1))))

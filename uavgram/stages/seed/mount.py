"""Test the stated mount of the camera by a common rotation of all photos, before the adjustment.

A camera that is mounted with a wrong orientation (image up at the tail, pitch 0 for -90) rotates
every photo against the log by the same angle, far more than its sigmas allow. The adjustment then
does not converge and suspects lengths and labels. But points in several photos are far apart on the
ground under the wrong mount, and close together under the right one.

Where the drone recorded angles that contradict a stated mount, the stated one is used and reported.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtrc

from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.motion.rotation import log_so3, matrix_from_ypr
from uavgram.model.arrays import Floats
from uavgram.model.frames import Poses
from uavgram.model.message import Message
from uavgram.model.options import MountOptions
from uavgram.model.survey import Survey

_UNLIKELY = 0.001  # probability of so large a difference between a right mount and right angles


def apply_stated_mount(
    mount: MountOptions, ypr_rad: Floats, heading_rad: Floats, source: str
) -> tuple[Floats, tuple[Message, ...]]:
    """Replace angles of a gimbal by those that the project states, and report the difference.

    Parameters
    ----------
    mount
        Mount; a stated yaw counts from the vehicle's nose, pitch and roll from the horizon.
    ypr_rad
        (N, 3) the gimbal's yaw from north, pitch and roll; where they are NaN, the result is
        meaningless.
    heading_rad
        (N,) of the vehicle, from north.
    source
        Source of the gimbal's angles.
    """
    stated = np.array(mount.angles_deg((np.nan,) * 3))
    known = np.isfinite(ypr_rad).all(axis=1)
    if np.isnan(stated).all() or not known.any():
        return ypr_rad, ()
    replaced = np.where(np.isfinite(stated), np.radians(stated), ypr_rad)
    replaced[:, 0] += np.where(np.isfinite(stated[0]), heading_rad, 0.0)
    recorded, used = matrix_from_ypr(*ypr_rad[known].T), matrix_from_ypr(*replaced[known].T)
    return replaced, (report_stated_mount(mount, recorded, used, source),)


def report_stated_mount(
    mount: MountOptions, recorded: Floats, used: Floats, source: str
) -> Message:
    """Report how far the stated mount is from recorded angles: a warning where they contradict it.

    Parameters
    ----------
    mount
        Mount, with the sigma of its angles.
    recorded, used
        (N, 3, 3) attitudes of the camera by the gimbal, and as used.
    source
        Source of the gimbal's angles.
    """
    turns_deg = np.degrees(np.linalg.norm(log_so3(np.swapaxes(recorded, 1, 2) @ used), axis=1))
    usual = float(np.median(turns_deg)) / mount.boresight_sigma_deg
    contradicts = chdtrc(3, usual**2) < _UNLIKELY
    text = (
        "The camera is taken to look as the angles under `mount` in the project state. The "
        f"gimbal's own angles ({source}), up to {turns_deg.max():.1f} degrees apart, were not "
        "used: to use them, write `auto` into `mount`."
    )
    if contradicts:
        text = (
            "The mount that the project states contradicts the recorded angles: the gimbal's own "
            f"angles ({source}) are up to {turns_deg.max():.1f} degrees apart, and were not used. "
            "Check how the camera hung. If you are not sure, write `auto` into `mount`."
        )
    return Message("warning" if contradicts else "info", "mount-stated", text)


MAX_SCATTER_RATIO = 0.2
"""Largest remaining share of the scatter for another mount to be reported. Errors of the log
scatter the points alike under every mount."""

MIN_SHARE_ON_GROUND = 0.9
"""Share of the picks whose rays must meet the ground under the other mount."""

_TURNS = [
    (tilt, turn) for tilt in (0, 90, -90) for turn in (0, 90, 180, -90) if (tilt, turn) != (0, 0)
]
"""Rotations [deg] about the camera's x axis, then about its optical axis: usual mistakes of a
mount."""


def find_turned_mount(survey: Survey) -> Message | None:
    """Report another mount that reduces the scatter of points in several photos by far.

    Parameters
    ----------
    survey
        Survey with telemetry; without it, the mount is unknown.

    Returns
    -------
    Message or None
        None where the mount is in order, or undetermined.
    """
    seeds = survey.seeds
    if seeds is None:
        return None
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    stated = compute_scatter(survey, seeds, ray, np.eye(3))
    turned = {turn: compute_scatter(survey, seeds, ray, _rotation(*turn)) for turn in _TURNS}
    best = min(turned, key=turned.__getitem__)
    heading = _report_turned_heading(survey, ray, min(stated, turned[best]))
    if heading is not None:
        return heading
    if not turned[best] < MAX_SCATTER_RATIO * stated:
        return None
    tilt, turn = best
    how = [f"{turn:+d} degrees about the optical axis (roll)"] if turn else []
    how += [f"{tilt:+d} degrees up or down (pitch)"] if tilt else []
    apart = f"{stated:.1f} m apart" if np.isfinite(stated) else "partly in the sky"
    action = "Correct `mount`, or its gimbal."
    if not tilt:
        action = (
            "If another program turned the photos, use those of the memory card; else correct "
            "`mount`, or its gimbal."
        )
    text = (
        "The camera seems to be mounted in another direction than the project states: where "
        f"several photos show one point, their rays meet the ground {apart} as stated, and "
        f"{turned[best]:.1f} m apart with all photos turned by {' and '.join(how)}. "
        f"{action}"
    )
    return Message("warning", "mount-turned", text)


def _report_turned_heading(survey: Survey, ray_camera: Floats, least_m: float) -> Message | None:
    """Report a common rotation of all headings that reduces the scatter of points by far.

    Parameters
    ----------
    survey
        Survey with telemetry.
    ray_camera
        (P, 3) rays of the picks.
    least_m
        Scatter of the points under the best mount.
    """
    seeds = survey.seeds
    assert seeds is not None  # noqa: S101  (the caller asked)
    scatter = {}
    for turn in (90, 180, -90):
        world = _rotation(0, -turn)
        there = replace(seeds, world_from_camera=world @ seeds.world_from_camera)
        scatter[turn] = compute_scatter(survey, there, ray_camera, np.eye(3))
    best = min(scatter, key=scatter.__getitem__)
    if not scatter[best] < MAX_SCATTER_RATIO * least_m:
        return None
    apart = f"{least_m:.1f} m apart" if np.isfinite(least_m) else "partly in the sky"
    text = (
        "All headings of the camera seem to be wrong by the same angle: correct the gimbal's yaw, "
        "or `mount.yaw_deg`. Where several photos show one point, their rays meet the ground "
        f"{apart} as stated, and {scatter[best]:.1f} m apart with all headings turned by "
        f"{best:+d} degrees."
    )
    return Message("warning", "mount-turned", text)


def _rotation(tilt_deg: float, turn_deg: float) -> Floats:
    """Return the rotation (3, 3) of the camera in another mount, in the present camera axes."""
    return matrix_from_ypr(np.radians(turn_deg), 0.0, np.radians(tilt_deg))


def compute_scatter(
    survey: Survey, seeds: Poses, ray_camera: Floats, camera_from_mounted: Floats
) -> float:
    """Return the RMS scatter [m] of points on the ground between photos; infinite in the sky.

    Parameters
    ----------
    survey
        Survey with the picks.
    seeds
        Poses of its frames.
    ray_camera
        (P, 3) rays of the picks.
    camera_from_mounted
        (3, 3) rotation of the camera in its mount.
    """
    # Repeated clicks in a photo are one sighting of their point.
    seen = np.stack([survey.pick_frame, survey.pick_label])
    (frame, label), first = np.unique(seen, axis=1, return_index=True)
    rotation = seeds.world_from_camera[frame] @ camera_from_mounted
    ground = intersect_ground(
        seeds.center_world_m[frame],
        np.einsum("pij,pj->pi", rotation, ray_camera[first]),
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

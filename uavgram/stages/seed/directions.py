"""Other directions of the camera than stated: by its mount, or by all headings.

A camera that is mounted with a wrong orientation (image up at the tail, pitch 0 for -90) rotates
every photo against the log by the same angle. Headings may be counted from another direction, or
counterclockwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.geometry.motion.rotation import exp_with_right_jacobian, matrix_from_ypr
from uavgram.model.arrays import Floats
from uavgram.model.frames import PhotoExposures, Poses
from uavgram.model.survey import Survey

LEAST_TILT_DEG, STEP_DEG = 30, 5
"""Least rotation of a mount up or down in the search, and its step [deg]: the adjustment finds
smaller ones."""

TURNS_DEG = (0, 90, 180, -90)
"""Rotations about the optical axis, or of all headings, in the search [deg]."""

REMAINING_RAD = float(np.radians(STEP_DEG))
"""Sigma of the direction of the camera in its mount, once another one was found [rad]."""


class OtherDirections(NamedTuple):
    """Survey with other directions of the camera.

    Attributes
    ----------
    survey
        The survey with seeds by these directions, and a prior about them.
    scatter_m
        Scatter of points in several photos [m].
    finding, turn, action
        Parts of a message: the mistake, the correction of the photos, and what to do.
    """

    survey: Survey
    scatter_m: float
    finding: str
    turn: str
    action: str


def list_other_directions(
    survey: Survey, compute_scatter_m: Callable[[Poses], float]
) -> Iterator[OtherDirections]:
    """List the best other mount, the best other headings, and headings of the other sense.

    Parameters
    ----------
    survey
        Survey with telemetry.
    compute_scatter_m
        Function that computes the scatter of points in several photos [m].
    """
    yield _find_other_mount(survey, compute_scatter_m)
    yield _find_other_headings(survey, compute_scatter_m)
    if isinstance(survey.track, PhotoExposures):
        yield _reverse_headings(survey, survey.track, compute_scatter_m)


def _find_other_mount(
    survey: Survey, compute_scatter_m: Callable[[Poses], float]
) -> OtherDirections:
    """Rotate the camera in its mount about its x axis, then about its optical axis."""
    seeds, prior = survey.seeds, survey.telemetry
    assert seeds is not None  # noqa: S101  (the caller asked)
    assert prior is not None  # noqa: S101
    tilts = [t for t in range(-90, 91, STEP_DEG) if t == 0 or abs(t) >= LEAST_TILT_DEG]
    turns = [(tilt, turn) for tilt in tilts for turn in TURNS_DEG if (tilt, turn) != (0, 0)]
    rotations = [matrix_from_ypr(*np.radians([turn, 0.0, tilt])) for tilt, turn in turns]
    turned = [replace(seeds, world_from_camera=seeds.world_from_camera @ one) for one in rotations]
    scatter_m = [compute_scatter_m(poses) for poses in turned]
    best = int(np.argmin(scatter_m))
    tilt, turn = turns[best]
    how = [f"{turn:+d} degrees about the optical axis (roll)"] if turn else []
    how += [f"{tilt:+d} degrees up or down (pitch)"] if tilt else []
    finding = "The camera seems to be mounted in another direction than the project states"
    action = "Correct `mount`, or its gimbal."
    if prior.mount_is_assumed and tilt:
        finding = "The camera did not look straight down, as was assumed"
        action = "State its direction in `mount`."
    elif not tilt:
        action = (
            "If another program turned the photos, use those of the memory card; else correct "
            "`mount`, or its gimbal."
        )
    prior = replace(
        prior,
        gimbal_from_camera=prior.gimbal_from_camera @ rotations[best],
        boresight_sigma_rad=float(np.hypot(prior.boresight_sigma_rad, REMAINING_RAD)),
        mount_is_assumed=False,
    )
    return OtherDirections(
        replace(survey, seeds=turned[best], telemetry=prior),
        scatter_m[best],
        finding,
        f"all photos turned by {' and '.join(how)}",
        action,
    )


def _find_other_headings(
    survey: Survey, compute_scatter_m: Callable[[Poses], float]
) -> OtherDirections:
    """Rotate all photos about the vertical by the same angle."""
    seeds, prior = survey.seeds, survey.telemetry
    assert seeds is not None  # noqa: S101  (the caller asked)
    assert prior is not None  # noqa: S101
    turned = {
        turn: _rotate_about_up(seeds, np.full(len(seeds.center_world_m), -np.radians(turn)))
        for turn in TURNS_DEG
        if turn
    }
    scatter_m = {turn: compute_scatter_m(poses) for turn, poses in turned.items()}
    best = min(scatter_m, key=scatter_m.__getitem__)
    # A heading bias is log minus truth, and turns the vehicle counterclockwise.
    bias_rad = prior.heading_bias_rad - float(np.radians(best))
    return OtherDirections(
        replace(survey, seeds=turned[best], telemetry=replace(prior, heading_bias_rad=bias_rad)),
        scatter_m[best],
        "All headings of the camera seem to be wrong by the same angle",
        f"all headings turned by {best:+d} degrees",
        "Correct the gimbal's yaw, or `mount.yaw_deg`.",
    )


def _reverse_headings(
    survey: Survey, track: PhotoExposures, compute_scatter_m: Callable[[Poses], float]
) -> OtherDirections:
    """Count the headings of the photos the other way round."""
    seeds, prior = survey.seeds, survey.telemetry
    assert seeds is not None  # noqa: S101  (the caller asked)
    assert prior is not None  # noqa: S101
    # The heading of the optical axis, or of image up where it looks straight down.
    ahead = track.world_from_gimbal[:, :, 0] - track.world_from_gimbal[:, :, 2]
    heading_rad = np.arctan2(ahead[:, 0], ahead[:, 1])
    about_up = _rotations_about_up(2.0 * heading_rad)
    reversed_track = replace(
        track,
        world_from_body=about_up @ track.world_from_body,
        world_from_gimbal=about_up @ track.world_from_gimbal,
    )
    angle_rad = np.zeros(len(seeds.center_world_m))
    names = [survey.frame_id[k] for k in prior.frame_index]
    angle_rad[prior.frame_index] = 2.0 * heading_rad[track.rows_of(names)]
    turned = _rotate_about_up(seeds, angle_rad)
    return OtherDirections(
        replace(survey, seeds=turned, track=reversed_track),
        compute_scatter_m(turned),
        "The headings of the photos seem to be counted counterclockwise",
        "the sign of each heading changed",
        "Headings count clockwise from north: correct their signs.",
    )


def _rotate_about_up(seeds: Poses, angle_rad: Floats) -> Poses:
    """Rotate cameras by angles (F,) about up, counterclockwise."""
    turned = _rotations_about_up(angle_rad) @ seeds.world_from_camera
    return replace(seeds, world_from_camera=turned)


def _rotations_about_up(angle_rad: Floats) -> Floats:
    """Return rotations (n, 3, 3) about up, counterclockwise, by angles (n,)."""
    return exp_with_right_jacobian(angle_rad[:, None] * [0.0, 0.0, 1.0])[0]

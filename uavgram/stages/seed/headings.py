"""Estimate headings and tilts that the photos' poses do not state, from common points.

The iterations cannot correct a heading that is wrong by half a turn; so the seeds are rotated
before the adjustment to the agreement of common points, positions and known points. Their
uncertainty is kept: these are first values, and the adjustment decides.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.heading_search import PlanPoints, search_headings
from uavgram.estimation.first_poses.tied.bundle import compute_tied_rays, fit_to_positions
from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.model.arrays import Bools, Floats
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.naming import format_count
from uavgram.model.survey import Survey

MAX_MISFIT_SIGMAS = 4.0
"""Largest misfit of tied poses to the positions, in sigmas (root mean square)."""


def find_attitudes_by_ties(survey: Survey) -> Floats | None:
    """Return world from camera (F, 3, 3) by ties; NaN for untied frames; None if undetermined.

    Poses from ties alone, transformed onto the positions of the seeds.
    """
    seeds = survey.seeds
    if seeds is None or not survey.ties.points + survey.matches.points:
        return None
    found = estimate_tied_poses(compute_tied_rays(survey)[0])
    if found is None:
        return None
    placed = fit_to_positions(found, seeds.center_world_m, found.placed)
    if placed is None:
        return None
    off = (placed.center - seeds.center_world_m)[placed.placed]
    variance = np.einsum("fii->fi", seeds.covariance)[placed.placed, :3]
    fits = np.mean(off**2 / variance) <= MAX_MISFIT_SIGMAS**2
    return placed.rotation if fits else None


def measure_turns(rotation: Floats, seed: Floats) -> Floats:
    """Compute rotations (F,) about up between attitudes (F, 3, 3) and others; NaN where missing."""
    turn = rotation @ seed.transpose(0, 2, 1)
    return np.asarray(np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1]))


def measure_tilts(rotation: Floats, seed: Floats) -> Floats:
    """Compute angles (F,) between the ups of attitudes (F, 3, 3) and others; NaN where missing."""
    cosine = np.einsum("fi,fi->f", rotation[:, 2], seed[:, 2])
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def add_attitudes(survey: Survey, rotation: Floats, which: Bools) -> Survey:
    """Replace attitudes of some photos, as first values of unknown attitudes.

    Parameters
    ----------
    survey
        Survey whose seeds are the photos' own.
    rotation
        (F, 3, 3) world from camera.
    which
        (F,) mask of the photos; the others are unchanged.
    """
    seeds, prior, track = survey.seeds, survey.telemetry, survey.track
    assert seeds is not None  # noqa: S101  (the photos have poses)
    assert prior is not None  # noqa: S101  (it comes with the seeds)
    assert isinstance(track, PhotoExposures)  # noqa: S101  (a log states attitudes)
    turned = np.where(which[:, None, None], rotation, seeds.world_from_camera)
    turn = turned @ seeds.world_from_camera.transpose(0, 2, 1)
    # The attitude's error is in camera axes, which rotate.
    axes = np.tile(np.eye(6), (len(which), 1, 1))
    axes[:, 3:, 3:] = turned.transpose(0, 2, 1) @ seeds.world_from_camera
    unknown = np.zeros((len(which), 6, 6))
    unknown[:, 3:, 3:] = np.pi**2 * which[:, None, None] * np.eye(3)
    marginal = axes @ seeds.covariance @ axes.transpose(0, 2, 1) + unknown
    of_prior = axes[prior.frame_index]
    own = of_prior @ prior.covariance @ of_prior.transpose(0, 2, 1) + unknown[prior.frame_index]
    row = track.rows_of(survey.frame_id)
    gimbal = track.world_from_gimbal.copy()
    gimbal[row] = turn @ gimbal[row]
    return replace(
        survey,
        seeds=replace(seeds, world_from_camera=turned, covariance=marginal),
        telemetry=replace(prior, covariance=own),
        track=replace(track, world_from_gimbal=gimbal),
    )


UNKNOWN_RAD = 1.0
"""Sigma of a heading [rad] above which it counts as unknown."""

CONTRADICTION_SIGMAS = 4.0
"""Sigmas by which the points must contradict a heading before it counts as unknown."""

MIN_SINE_BELOW_HORIZON = np.sin(np.radians(5.0))
"""Sine of the angle below the horizon under which a ray's place on the ground is unusable."""


def find_headings(survey: Survey) -> tuple[Survey, tuple[Message, ...]]:
    """Rotate the seeds to the headings that ties, or else picks, determine.

    For photos without a stated attitude, and those whose stated heading is nearly unknown. Where
    ties show that a photo without a stated attitude looks in a very different direction than the
    assumed mount, its tilt is taken from them, too. Surveys with a log, or whose photos all state
    their attitudes, are unchanged.

    Parameters
    ----------
    survey
        All observations.

    Returns
    -------
    survey
        Seeds, and the photos' own poses, rotated about the vertical, or entirely.
    messages
        Photos whose nose the picks contradict: their heading counts as unknown. Also those whose
        tilt the ties contradict: their attitude counts as unknown.
    """
    track = survey.track
    if survey.seeds is None or not isinstance(track, PhotoExposures):
        return survey, ()
    row = track.rows_of(survey.frame_id)
    sigma = track.sigma_attitude_rad[row, 1]
    free = track.by_mount[row] | (sigma > UNKNOWN_RAD)
    if not free.any():
        return survey, ()
    turn = search_headings(_plan(survey, track.sigma_attitude_rad[row, 0], sigma), free)
    tied = find_attitudes_by_ties(survey)
    if tied is not None:
        by_ties = measure_turns(tied, survey.seeds.world_from_camera)
        turn = np.where(free & np.isfinite(by_ties), by_ties, turn)
    doubted = free & (sigma <= UNKNOWN_RAD) & (np.abs(turn) > CONTRADICTION_SIGMAS * sigma)
    survey_turned = _rotate_headings(survey, track, turn, doubted)
    messages = tuple(_messages(survey, turn, doubted))
    if tied is None:
        return survey_turned, messages
    off = measure_tilts(tied, survey.seeds.world_from_camera)
    limit = CONTRADICTION_SIGMAS * track.sigma_attitude_rad[row, 0]
    tilted = track.by_mount[row] & (np.nan_to_num(off) > limit)
    if not tilted.any():
        return survey_turned, messages
    return add_attitudes(survey_turned, tied, tilted), (
        *messages,
        _tilt_message(survey, off, tilted),
    )


def _plan(survey: Survey, tilt_sigma: Floats, turn_sigma: Floats) -> PlanPoints:
    """Project the picks to the ground at the seeds, with sigmas."""
    seeds = survey.seeds
    assert seeds is not None  # noqa: S101  (the caller asked)
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    frame, label = survey.pick_frame, survey.pick_label
    direction = np.einsum("pij,pj->pi", seeds.world_from_camera[frame], ray)
    height = survey.ground.height_m
    ground = intersect_ground(
        seeds.center_world_m[frame],
        direction,
        np.array([height, 0.0, 0.0]),
        np.zeros(2),
        survey.height_above_m[label],
    )
    offset = ground[:, :2] - seeds.center_world_m[frame, :2]
    down = -direction[:, 2] / np.linalg.norm(direction, axis=1)
    usable = (
        np.isfinite(offset).all(axis=1) & (down > MIN_SINE_BELOW_HORIZON) & ~survey.is_free[label]
    )
    above = np.maximum(seeds.center_world_m[:, 2] - height, 1.0)
    variance = np.einsum("fii->fi", seeds.covariance)
    rise = np.sqrt(variance[:, 2] + survey.ground.height_sigma_m**2) / above
    # A tilt moves points below the camera by h, all alike; points far out by h / sin^2.
    frame, label, offset, down = frame[usable], label[usable], offset[usable], down[usable]
    beyond = above[frame] * (1.0 / down**2 - 1.0) * tilt_sigma[frame]
    rough = survey.ground.roughness_sigma_m / down
    stretched = rise[frame] * np.linalg.norm(offset, axis=1)
    anchor = np.full((len(survey.label), 2), np.nan)
    anchor[survey.control_label] = survey.control_world_m[:, :2]
    return PlanPoints(
        frame=frame,
        label=label,
        offset_m=offset,
        sigma_m=np.sqrt(beyond**2 + stretched**2 + rough**2 + (0.01 * above[frame]) ** 2),
        center_m=seeds.center_world_m[:, :2],
        center_sigma_m=np.sqrt(variance[:, 0] + (above * tilt_sigma) ** 2),
        turn_sigma_rad=np.where(turn_sigma > UNKNOWN_RAD, np.inf, turn_sigma),
        anchor_m=anchor,
    )


def _rotate_headings(survey: Survey, track: PhotoExposures, turn: Floats, doubted: Bools) -> Survey:
    """Rotate seeds and exposures about up; a contradicted heading gets the sigma of an unknown one.

    The sigmas of a photo's attitude are those of its tilt and its yaw, and all horizontal axes of
    its position have the same sigma: a rotation about up changes no covariance in the camera's
    axes.
    """
    seeds, prior = survey.seeds, survey.telemetry
    assert seeds is not None  # noqa: S101  (the caller asked)
    assert prior is not None  # noqa: S101  (it comes with the seeds)
    zero = np.zeros_like(turn)
    about_up = matrix_from_ypr(turn, zero, zero)
    rotation = about_up @ seeds.world_from_camera
    of_frame = {name: k for k, name in enumerate(survey.frame_id)}
    place = np.array([of_frame.get(name, -1) for name in track.frame_id], dtype=np.int64)
    all_turns = np.where((place >= 0)[:, None, None], about_up[place], np.eye(3))
    up = rotation[:, 2, :]  # the world's up in the camera's axes
    more = np.where(doubted, np.pi**2, 0.0)[:, None, None] * up[:, :, None] * up[:, None, :]
    marginal, own = seeds.covariance.copy(), prior.covariance.copy()
    marginal[:, 3:, 3:] += more
    own[:, 3:, 3:] += more[prior.frame_index]
    return replace(
        survey,
        seeds=replace(seeds, world_from_camera=rotation, covariance=marginal),
        telemetry=replace(prior, covariance=own),
        track=replace(
            track,
            world_from_body=all_turns @ track.world_from_body,
            world_from_gimbal=all_turns @ track.world_from_gimbal,
        ),
    )


def _messages(survey: Survey, turn: Floats, doubted: Bools) -> Iterator[Message]:
    names = [
        f"{survey.frame_id[k]} ({abs(np.degrees(turn[k])):.0f} degrees)"
        for k in np.flatnonzero(doubted)
    ]
    if not names:
        return
    text = (
        "The picks contradict the heading of the drone in the tags of "
        f"{format_count(len(names), 'photo')}: {', '.join(names)}. Their heading was taken as "
        f"unknown "
        "and found from the picks."
    )
    frames = tuple(survey.frame_id[k] for k in np.flatnonzero(doubted))
    yield Message("info", "course-contradicted", text, frames=frames)


def _tilt_message(survey: Survey, off_rad: Floats, tilted: Bools) -> Message:
    frames = tuple(survey.frame_id[k] for k in np.flatnonzero(tilted))
    typical = np.degrees(np.median(off_rad[tilted]))
    text = (
        f"{len(frames)} photos that state no attitude do not look in the direction of `mount`: the "
        f"tie points between them show them tilted by {typical:.0f} degrees from it, and this tilt "
        "is used. If you know how the camera was tilted, set mount.pitch_deg, or give yaw_deg, "
        "pitch_deg and roll_deg in a CSV file (`poses`)."
    )
    return Message("info", "attitude-by-ties", text, frames=frames)

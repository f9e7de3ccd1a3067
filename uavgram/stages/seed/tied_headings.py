"""Attitudes of photos from the tie points between them and the places where they were taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.first_poses.tied.placing import onto_positions
from uavgram.estimation.first_poses.tied.survey_rays import tied_rays
from uavgram.estimation.first_poses.tied.tied_poses import tied_poses
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.photo_poses import PhotoExposures
from uavgram.model.survey.survey import Survey

BESIDE = 4.0
"""Sigmas of the positions (root mean square) up to which tied poses go with them."""


def attitudes_by_ties(survey: Survey) -> Floats | None:
    """(F, 3, 3) world from camera; NaN for frames that no ties join; None where nothing is told.

    Poses from ties alone, laid onto the positions of the seeds.
    """
    seeds = survey.seeds
    if seeds is None or not survey.ties.points + survey.matches.points:
        return None
    found = tied_poses(tied_rays(survey)[0])
    if found is None:
        return None
    placed = onto_positions(found, seeds.center_world_m, found.placed)
    if placed is None:
        return None
    off = (placed.center - seeds.center_world_m)[placed.placed]
    variance = np.einsum("fii->fi", seeds.covariance)[placed.placed, :3]
    fits = np.mean(off**2 / variance) <= BESIDE**2
    return placed.rotation if fits else None


def turns_about_up(rotation: Floats, seed: Floats) -> Floats:
    """(F,) by how much attitudes (F, 3, 3) are turned about up from others; NaN where missing."""
    turn = rotation @ seed.transpose(0, 2, 1)
    return np.asarray(np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1]))


def tilts_between(rotation: Floats, seed: Floats) -> Floats:
    """(F,) angles between the ups of attitudes (F, 3, 3) and of others; NaN where missing."""
    cosine = np.einsum("fi,fi->f", rotation[:, 2], seed[:, 2])
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def with_attitudes(survey: Survey, rotation: Floats, which: Bools) -> Survey:
    """The survey with other attitudes of some photos, as first values of something unknown.

    Parameters
    ----------
    survey
        Its seeds are the photos' own.
    rotation
        (F, 3, 3) world from camera.
    which
        (F,) the photos; the others stay as they are.
    """
    seeds, prior, track = survey.seeds, survey.telemetry, survey.track
    assert seeds is not None  # noqa: S101  (the photos have poses)
    assert prior is not None  # noqa: S101  (it comes with the seeds)
    assert isinstance(track, PhotoExposures)  # noqa: S101  (a log states attitudes)
    turned = np.where(which[:, None, None], rotation, seeds.world_from_camera)
    turn = turned @ seeds.world_from_camera.transpose(0, 2, 1)
    # The attitude's error stands in camera axes, which turn.
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

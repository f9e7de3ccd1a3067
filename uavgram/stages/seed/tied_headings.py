"""Attitudes of photos from the tie points between them and the places where they were taken."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.tied.placing import onto_positions
from uavgram.estimation.first_poses.tied.survey_rays import tied_rays
from uavgram.estimation.first_poses.tied.tied_poses import tied_poses
from uavgram.model.arrays import Floats
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

"""The tie points of a survey as rays."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.tied.tied_rays import TiedRays
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Ints
from uavgram.model.survey.survey import Survey


def tied_rays(survey: Survey) -> tuple[TiedRays, Ints]:
    """Rays to tie points and along chains of matches, each once by frame and point.

    Returns
    -------
    rays
        The points of the chains behind the tie points.
    row : (N,)
        Which sighting each is: first those of the ties, then those of the matches.
    """
    ties, matches, camera = survey.ties, survey.matches, survey.calibration
    clicked = matches.pick
    frame = np.concatenate([ties.frame, matches.frame])
    point = np.concatenate([ties.point, ties.points + matches.point])
    pixel = np.concatenate([ties.pixel_px, matches.pixel_px])
    sigma = np.concatenate([ties.sigma_px, matches.sigma_px])
    ray = back_project(camera.model, camera.parameters, pixel)
    size = np.linalg.norm(ray, axis=1)
    _, first = np.unique(np.column_stack([frame, point]), axis=0, return_index=True)
    rows = np.sort(first)
    rows = rows[np.isfinite(size[rows])]
    found = TiedRays(
        frame=frame[rows],
        point=point[rows],
        ray=ray[rows] / size[rows, None],
        sigma_rad=sigma[rows] / camera.parameters[0],
        frames=len(survey.frame_id),
        points=ties.points + len(clicked),
    )
    return found, rows

"""The tie points of a survey as rays."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.first_poses.tied.tied_rays import TiedRays
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration import Calibration
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
    sizes = len(survey.frame_id), ties.points + len(clicked)
    return rays_of(camera, (frame, point), pixel, sigma, sizes)


def rays_of(
    camera: Calibration,
    seen: tuple[Ints, Ints],
    pixel_px: Floats,
    sigma_px: Floats,
    sizes: tuple[int, int],
) -> tuple[TiedRays, Ints]:
    """Rays through pixels, each once by frame and point; and (N,) which pixel each is of.

    Parameters
    ----------
    camera
        Of all frames.
    seen
        (n,), (n,) which frame sees which point.
    pixel_px, sigma_px
        (n, 2), (n,) where, and the sigma of each coordinate.
    sizes
        How many frames and points there are.
    """
    frame, point = seen
    ray = back_project(camera.model, camera.parameters, pixel_px)
    size = np.linalg.norm(ray, axis=1)
    _, first = np.unique(np.column_stack([frame, point]), axis=0, return_index=True)
    rows = np.sort(first)
    rows = rows[np.isfinite(size[rows])]
    found = TiedRays(
        frame=frame[rows],
        point=point[rows],
        ray=ray[rows] / size[rows, None],
        sigma_rad=sigma_px[rows] / camera.parameters[0],
        frames=sizes[0],
        points=sizes[1],
    )
    return found, rows

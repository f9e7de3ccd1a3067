"""How cameras moved while their photos were read, where no log says it: as the photos follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.rolling import NONE
from uavgram.model.arrays import Floats
from uavgram.model.camera.readout import UNKNOWN_READOUT, Readout
from uavgram.model.flight.log import Track
from uavgram.model.survey.rolling_shutter import RollingShutter
from uavgram.model.survey.survey import Survey

USUAL_M_S = 7.0
"""Speed of a drone that takes photos of the ground."""

SPEED_SIGMA = 0.65
"""Of that speed, as a share: from photos while it hovers to 15 m/s."""

RATE_RAD_S = 0.1
"""Sigma of how fast it turns then, six degrees a second: also what it moves otherwise than to the
next photo looks like that."""

JUMP = 2.0
"""Times as long as the other: a way to the next photo that is no part of a line of photos."""


SHUTTER = 1.5
"""Times by which squares of ties fall, beside those of as many unknowns that say nothing, where a
shutter is felt. Of flights of 8 photos with 350 to 590 sightings it was 0.95 to 1.0 without one,
and 2.7 to 12 with 10 ms."""


def with_motion_by_photos(survey: Survey) -> Survey:
    """The survey with the motion of its cameras as far as the order of its photos tells it.

    Along the way from the photo before to the photo after, all at one speed that is unknown as the
    times between photos are: it is the same unknown as a readout time. Which way the camera turned
    meanwhile, ties tell for each photo. A survey without ties has none of it, nor has one whose
    rows are read at once.
    """
    readout = survey.calibration.readout or UNKNOWN_READOUT
    if isinstance(survey.track, Track) or readout == NONE or not survey.ties.points:
        return survey
    center, rotation = _first_poses(survey)
    way = _ways(center)
    size = np.linalg.norm(way, axis=1)
    if not np.any(size > 0):
        return survey
    way *= USUAL_M_S / np.maximum(np.median(size[size > 0]), size)[:, None]
    motion = np.zeros((len(center), 6))
    motion[:, :3] = way
    if survey.gauge == "plane":
        motion[:, :3] = np.einsum("fji,fj->fi", np.nan_to_num(rotation), way)
    sigma_s = float(np.hypot(SPEED_SIGMA * readout.value_s, readout.sigma_s))
    return replace(
        survey,
        rolling=RollingShutter(
            readout=Readout(value_s=readout.value_s, sigma_s=sigma_s),
            motion=motion,
            rate_sigma_rad_s=RATE_RAD_S,
            by_photos=True,
        ),
    )


def is_in_question(survey: Survey) -> bool:
    """Whether nobody says that rows are read one after the other, and no log would show it."""
    rolling = survey.rolling
    return rolling is not None and rolling.by_photos and not rolling.readout.value_s


def ask_for_shutter(plain: Adjustment, rolling: Adjustment) -> bool:
    """Whether ties fit much better where each photo may have turned while it was read.

    By the median, as wrong ones are still among them, and beyond what so many unknowns explain.

    Parameters
    ----------
    plain, rolling
        The same ties without a shutter, and with one.
    """
    before, after = (
        float(np.median(np.sum(one.minimum.blocks["ties"].residual ** 2, axis=1)))
        for one in (plain, rolling)
    )
    unknowns = rolling.problem.layout.size - plain.problem.layout.size
    by_chance = 1.0 - unknowns / max(plain.degrees_of_freedom, 1)
    return before * by_chance > SHUTTER * after


def _first_poses(survey: Survey) -> tuple[Floats, Floats]:
    """Centres (F, 3) and rotations (F, 3, 3), of frames in order; NaN where nothing is known."""
    if survey.seeds is not None:
        return survey.seeds.center_world_m, survey.seeds.world_from_camera
    frame = {name: k for k, name in enumerate(survey.frame_id)}
    center = np.full((len(frame), 3), np.nan)
    rotation = np.full((len(frame), 3, 3), np.nan)
    for one in survey.candidate_poses:
        k = frame[one.frame_id]
        center[k], rotation[k] = one.center_world_m[0], one.world_from_camera[0]
    return center, rotation


def _ways(center: Floats) -> Floats:
    """(F, 3) from the photo before to the one after, halved; 0 where neither is known."""
    way = np.zeros_like(center)
    known = np.flatnonzero(np.isfinite(center[:, 0]))
    if len(known) < 2:
        return way
    step = np.diff(center[known], axis=0)
    before, after = step[[0, *range(len(step))]], step[[*range(len(step)), -1]]
    long, short = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    mean = (before + after) / 2
    mean = np.where((long > JUMP * short)[:, None], after, mean)
    way[known] = np.where((short > JUMP * long)[:, None], before, mean)
    return way

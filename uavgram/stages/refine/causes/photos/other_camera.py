"""Hypotheses on single photos of another zoom, or of another camera, than all others."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from uavgram.estimation.first_poses.homography import resect_from_plane
from uavgram.estimation.reliability.hypotheses import Explained, Moved, explained
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey.corrections import SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing
from uavgram.stages.refine.causes.labels.places import labels_of
from uavgram.stages.refine.causes.photos.consensus import SMALLEST, seen_at
from uavgram.stages.refine.causes.photos.turned import against_the_log, misplaced_photos, picks_of

STRAINED, MOST_PHOTOS = 16.0, 4
"""Least decrease of the sum of squares by a zoom of its own, for a photo to be examined; and
largest number of such photos."""

ZOOMS = np.exp(np.linspace(-1.0, 1.0, 101))
"""Factors of the focal length that are tried for a photo."""

LEAST = 0.03
"""Least relative difference of the focal length from that of all others for another zoom."""


def photos_of_another_zoom(standing: Standing) -> Iterator[Hypothesis]:
    """Propose another focal length for single photos."""
    survey, camera = standing.survey, standing.survey.calibration
    middle = camera.parameters[2:4]
    for frame, gain in _strained(standing).items():
        picks = picks_of(standing, frame)
        factor = _zoom(standing, frame, picks)
        if factor is None or abs(factor - 1.0) < LEAST:
            continue
        pixel = middle + (survey.pixel_px[picks] - middle) / factor
        places = {int(k): (float(u), float(v)) for k, (u, v) in zip(picks, pixel, strict=True)}
        yield Hypothesis(
            tell=partial(_told, survey.frame_id[frame], factor),
            mend=SurveyCorrection(pixel_of_pick=places),
            remedy=SurveyCorrection(without_picks=frozenset(picks.tolist())),
            promise=gain,
            price=PRICE + float(np.log(len(survey.frame_id))),
            settles=frozenset([survey.frame_id[frame]]),
        )


def _strained(standing: Standing) -> dict[int, float]:
    """Find photos of the survey that need a zoom of their own, and the gain."""
    adjustment = standing.adjustment
    found = dict.fromkeys(misplaced_photos(standing).tolist(), 0.0) | against_the_log(standing)
    if adjustment.minimum.converged:
        small = adjustment.survey
        middle = small.calibration.parameters[2:4]
        away = (small.pixel_px - middle) / small.pick_sigma_px[:, None]
        rows = [np.flatnonzero(small.pick_frame == k) for k in range(len(small.frame_id))]
        tests = explained(adjustment, [(Moved("pixels", r, away[r, :, None]),) for r in rows])
        index = {name: k for k, name in enumerate(standing.survey.frame_id)}
        gains = {index[n]: t.gain for n, t in zip(small.frame_id, tests, strict=True)}
        found |= {k: gain for k, gain in gains.items() if gain > max(STRAINED, found.get(k, 0.0))}
    worst = sorted(found, key=lambda k: -found[k])[:MOST_PHOTOS]
    return {k: found[k] for k in worst}


def _zoom(standing: Standing, frame: int, picks: Ints) -> float | None:
    """Find a photo's factor of the focal length that fits points and log best; None without pose.

    Parameters
    ----------
    standing, frame
        The survey, and one of its photos.
    picks
        (n,) its picks.
    """
    survey, camera = standing.survey, standing.survey.calibration
    label = labels_of(standing)[survey.pick_label[picks]]
    known = np.flatnonzero((label >= 0) & ~survey.off_ground[survey.pick_label[picks]])
    if len(known) <= SMALLEST:
        return None
    world = standing.adjustment.state.point[label[known], :2]
    middle = camera.parameters[2:4]
    # Scale the pixels before the distortion is removed, as that belongs to the lens.
    pixel = middle + (survey.pixel_px[picks[known]] - middle) / ZOOMS[:, None, None]
    ray = back_project(camera.model, camera.parameters, pixel.reshape(-1, 2))
    every = (ray / ray[:, 2:]).reshape(*pixel.shape[:2], 3)
    sigma = survey.pick_sigma_px[picks[known]] / camera.parameters[0]
    center, whitening = _by_the_log(standing, frame)
    cost = np.full(len(ZOOMS), np.inf)
    for k, factor in enumerate(ZOOMS):
        zoomed = every[k]
        pose = resect_from_plane(world, zoomed) if np.isfinite(zoomed).all() else None
        if pose is None or pose[0][2] <= 0:
            continue
        off = (seen_at(world, pose) - zoomed[:, :2]) * factor / sigma[:, None]
        lifted = pose[0] + np.array([0.0, 0.0, standing.adjustment.state.plane[0]])
        cost[k] = np.sum(off**2) + np.sum((whitening @ (lifted - center)) ** 2)
    best = int(np.argmin(cost))
    if not 0 < best < len(ZOOMS) - 1 or not np.isfinite(cost[best - 1 : best + 2]).all():
        return None
    # vertex of the parabola through the three lowest
    low, middle, high = cost[best - 1 : best + 2]
    part = 0.5 * (low - high) / max(low - 2.0 * middle + high, 1e-12)
    return float(np.exp(np.log(ZOOMS[best]) + part * np.log(ZOOMS[1] / ZOOMS[0])))


def _by_the_log(standing: Standing, frame: int) -> tuple[Floats, Floats]:
    """Return a photo's camera position (3,) by the log, with common biases; and its whitening.

    All zeros where there is no log.
    """
    adjustment, survey = standing.adjustment, standing.survey
    names = adjustment.survey.frame_id
    block, telemetry = adjustment.minimum.blocks.get("telemetry"), adjustment.survey.telemetry
    name = survey.frame_id[frame]
    if block is None or telemetry is None or name not in names:
        return np.zeros(3), np.zeros((3, 3))
    at = names.index(name)
    row = int(np.flatnonzero(telemetry.frame_index == at)[0])
    white = adjustment.problem.telemetry_whitening[row]
    off = np.linalg.solve(white, block.residual[row])[:3]
    covariance = np.linalg.inv(white.T @ white)[:3, :3]
    own = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=np.float64)
    return adjustment.state.center[at] - off, own


def _told(frame: str, factor: float, _: Explained | None) -> Message:
    text = (
        f"The photo {frame!r} was taken at another zoom, or with another camera, than the others: "
        "take it out, or give photos of each camera a project of their own. It fits where its "
        f"focal length is {factor:.2f} times that of the camera file."
    )
    return Message(
        "warning",
        "other-camera",
        text,
        frames=(frame,),
        several=MessagePlural(
            "{count} photos were taken at another zoom, or with another camera, than the others",
            f"{frame!r} ({factor:.2f} times the focal length)",
            ending="Take them out, or give photos of each camera a project of their own.",
        ),
    )

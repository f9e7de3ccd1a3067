"""Find points off the ground that only one photo shows so far, along their lines of sight."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.imaging.matching.least_squares import REASON_TEXTS, RefusalReason
from uavgram.imaging.matching.line_of_sight import SightLine, match_along_line
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import Picks
from uavgram.pipeline.match.adjustment import MIN_HEIGHT_M
from uavgram.pipeline.match.height_evidence import MIN_PX
from uavgram.pipeline.match.patch_search import Photos
from uavgram.pipeline.progress import Progress, silent
from uavgram.stages.match import (
    REGION_SQUARED,
    Candidates,
    Found,
    Missed,
    Pair,
    compute_radii,
    pick_sigmas,
)

HEIGHTS_M = -0.5, MIN_HEIGHT_M, 10.0
"""Heights above the ground [m]: lower limit of the search, upper limit of finds that count as the
ground beside an edge, and upper limit of the search, the ridge of a house."""

BELOW_CAMERA = 0.5
"""Share of the camera's height up to which objects are searched."""

STEP_PX = 1.0
"""Distance of places on a line [px], in the photo in which it is largest."""

MAX_PLACES = 1500
"""Largest number of places on one line: for distant photos, and a high object."""

ASIDE_PX = 1.0
"""Sigma across the line of sight [px] above which a photo's pose is too poor to search along it."""

_STEPS = 3  # from a height above level ground to one above ground that slopes
_ABOUT_PX = 3.0  # of the source, by which photos are compared


def search_sightlines(
    photos: Photos,
    picks: Picks,
    adjustment: Adjustment,
    candidates: Candidates,
    rows: Ints,
    sigma_px: float,
    progress: Progress = silent,
) -> dict[Pair, Found | Missed]:
    """Search for places, each pick in all photos together.

    Parameters
    ----------
    photos
        Grey, by name.
    picks
        Picks of the project.
    adjustment, candidates
        The adjustment that predicted the places, and all of them.
    rows
        Places to search for.
    sigma_px
        Sigma of picks that do not state one [px].
    progress
        Shows long loops.
    """
    covariance = candidates.places.covariance_px2[rows]
    known = np.linalg.eigvalsh(covariance)[:, 0] < ASIDE_PX**2
    known &= np.isin([candidates.pair[row][0] for row in rows], adjustment.survey.frame_id)
    results: dict[Pair, Found | Missed] = {}
    for row, far in zip(
        rows[~known].tolist(), compute_radii(covariance[~known]).tolist(), strict=True
    ):
        too_far = Missed(int(candidates.pick[row]), far, REASON_TEXTS[RefusalReason.TOO_FAR])
        results[candidates.pair[row]] = too_far
    rows = rows[known]
    chosen = np.unique(candidates.pick[rows]).tolist()
    for pick in progress(iter(chosen), "looking along lines of sight", len(chosen)):
        own = rows[candidates.pick[rows] == pick]
        results |= _search_pick(photos, picks, adjustment, candidates, own, sigma_px)
    return results


def _search_pick(
    photos: Photos,
    picks: Picks,
    adjustment: Adjustment,
    candidates: Candidates,
    rows: Ints,
    sigma_px: float,
) -> dict[Pair, Found | Missed]:
    """Search for the places of one pick; other picks of its label must agree with the height.

    Parameters
    ----------
    photos, picks, adjustment, candidates, sigma_px
        As for `search_sightlines`.
    rows
        Its places, in adjusted photos.
    """
    pick, pairs = int(candidates.pick[rows[0]]), [candidates.pair[row] for row in rows]
    frame = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    of = frame[picks.image[pick]], adjustment.label_index(picks.label[pick])
    by_photo = {  # one pick in each other photo: a repetition is no other view
        picks.image[i]: i
        for i in np.flatnonzero(picks.of_source("hand")).tolist()
        if picks.label[i] == picks.label[pick] and picks.image[i] in frame
    }
    picked = [i for image, i in by_photo.items() if image != picks.image[pick]]
    names = [*(image for image, _ in pairs), *(picks.image[i] for i in picked)]
    line = project_sightline(
        adjustment, of, np.array([frame[name] for name in names]), picks.pixel_px[pick]
    )
    stated = np.where(np.isnan(picks.sigma_px), sigma_px, picks.sigma_px)
    agrees = _agrees(
        line, slice(len(pairs), None), picks.pixel_px[picked], (stated[pick], stated[picked])
    )
    line.pixel_px[~agrees] = np.nan
    source = photos.get(picks.image[pick])
    found = match_along_line(source, [photos.get(name) for name in names], line)
    sigma = pick_sigmas(found.covariance_px2, np.ones(len(names), np.bool_))
    radius = compute_radii(candidates.places.covariance_px2[rows]).tolist()
    results: dict[Pair, Found | Missed] = {}
    for k, pair in enumerate(pairs):
        if found.refused[k]:
            why = REASON_TEXTS[RefusalReason(int(found.refused[k]))]
            results[pair] = Missed(pick, radius[k], why)
        else:
            u, v = np.round(found.pixel_px[k], 3).tolist()
            own, score = round(float(sigma[k]), 4), round(float(found.score[k]), 3)
            results[pair] = Found(pick, (u, v), own, score, radius[k])
    return results


def _agrees(
    line: SightLine, others: slice, picked_px: Floats, sigma_px: tuple[float, Floats]
) -> Bools:
    """Mark places (k,) of a line that agree with the picks of the same label in other photos.

    Parameters
    ----------
    line
        Line of sight.
    others
        These photos.
    picked_px
        (m, 2) picks there.
    sigma_px
        Sigma of the pick on the line, and sigmas (m,) of the others.
    """
    own, there = sigma_px
    turn = line.affine[:, others]
    noise = own**2 * turn @ np.swapaxes(turn, 2, 3)
    noise += (there**2 + MIN_PX**2)[:, None, None] * np.eye(2)
    off = line.pixel_px[:, others] - picked_px
    square = np.einsum("kmi,kmi->km", off, np.linalg.solve(noise, off[..., None])[..., 0])
    return np.asarray((square <= REGION_SQUARED).all(axis=1))


def project_sightline(
    adjustment: Adjustment, of: tuple[int, int], others: Ints, pixel_px: Floats
) -> SightLine:
    """Project a picked pixel's line of sight to other photos.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    of
        Frame and label of the pick.
    others
        (t,) frames.
    pixel_px
        (2,) picked.
    """
    frame, label = of
    center, ray = _sightline(adjustment, frame, pixel_px)
    from_m, raised_m, to_m = HEIGHTS_M
    # Heights with a step of about STEP_PX in the photo that shows them farthest apart.
    ground = _place_at_heights(adjustment, label, (center, ray), [0.0])
    to_m = min(to_m, BELOW_CAMERA * float(center[2] - ground[0, 2]))
    ends = _pixels(
        adjustment, others, _place_at_heights(adjustment, label, (center, ray), [0.0, to_m])
    )
    long = np.linalg.norm(ends[1] - ends[0], axis=1)
    long_px = float(np.nan_to_num(long).max()) * (to_m - from_m) / to_m
    height = np.linspace(from_m, to_m, min(int(long_px / STEP_PX) + 8, MAX_PLACES))
    place = _place_at_heights(adjustment, label, (center, ray), height)
    # Affine map by differences: the line of sight of a neighbouring pixel at the same height.
    columns = []
    for step in _ABOUT_PX * np.eye(2):
        both = []
        for sign in (1.0, -1.0):
            start, beside = _sightline(adjustment, frame, pixel_px + sign * step)
            level = start + ((place[:, 2] - start[2]) / beside[2])[:, None] * beside
            both.append(_pixels(adjustment, others, level))
        columns.append((both[0] - both[1]) / (2.0 * _ABOUT_PX))
    return SightLine(
        source_px=pixel_px,
        pixel_px=_pixels(adjustment, others, place),
        affine=np.stack(columns, axis=-1),
        lowest=int(np.searchsorted(height, raised_m)),
    )


def _sightline(adjustment: Adjustment, frame: int, pixel_px: Floats) -> tuple[Floats, Floats]:
    """Return origin and direction (3,) of a pixel's line of sight."""
    state, lens = adjustment.state, adjustment.problem.intrinsics(adjustment.state)
    pose = RowPoses(state.center[frame], state.rotation[frame], adjustment.sweep()[frame])
    return sight_lines(adjustment.survey.calibration, lens, pose, pixel_px)


def _place_at_heights(
    adjustment: Adjustment, label: int, sight: tuple[Floats, Floats], height_m: Floats | list[float]
) -> Floats:
    """Return places (k, 3) on a line of sight at heights (k,) above the ground.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    label
        Label in the area of the ground.
    sight
        Origin of the line, and its direction.
    height_m
        The heights.
    """
    center, ray = sight
    problem, state, height = adjustment.problem, adjustment.state, np.asarray(height_m)
    of = np.full(len(height), label)
    place, _, _ = problem.world_points(state, of)
    for _ in range(_STEPS):
        ground = problem.ground.at(state.plane, state.relief, of, place[:, :2])
        up = ground.height_m + height
        place = center + ((up - center[2]) / ray[2])[:, None] * ray
    return np.asarray(place)


def _pixels(adjustment: Adjustment, frames: Ints, world_m: Floats) -> Floats:
    """Project places (k, 3) to frames (t,): pixels (k, t, 2), NaN behind a camera."""
    state, sweep = adjustment.state, adjustment.sweep()
    poses = RowPoses(state.center[frames], state.rotation[frames], sweep[frames])
    every = np.broadcast_to(world_m[:, None], (len(world_m), len(frames), 3))
    lens = adjustment.problem.intrinsics(state)
    return project_rows(adjustment.survey.calibration, lens, poses, every)

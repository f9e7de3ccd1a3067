"""Points off the ground that one photo alone shows so far: found along their lines of sight."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.imaging.matching.matched import REASON, Refused
from uavgram.imaging.matching.on_line import Line, found_on_line
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.observations import Picks
from uavgram.pipeline.match.looking import Photos
from uavgram.pipeline.progress import Progress, silent
from uavgram.stages.match.found import Found, Missed, Pair, pick_sigmas
from uavgram.stages.match.plan import Candidates, radii

HEIGHTS_M = -0.5, 0.25, 10.0
"""Above the ground: looked at from, up to which a find would be the ground beside an edge, and up
to the ridge of a house."""

STEP_PX = 1.0
"""Between places of a line, in the photo that shows them farthest apart."""

MOST_PLACES = 1500

ASIDE_PX = 1.0
"""Sigma across the line of sight, of a photo whose pose is too poor to see along it."""

_STEPS = 3  # from a height above level ground to one above ground that slopes
_ABOUT_PX = 3.0  # of the source, by which photos are compared


def look_up(
    photos: Photos,
    picks: Picks,
    adjustment: Adjustment,
    candidates: Candidates,
    rows: Ints,
    progress: Progress = silent,
) -> dict[Pair, Found | Missed]:
    """What is found of some places, each pick in all photos together.

    Parameters
    ----------
    photos
        Grey, by name.
    picks
        Of the project.
    adjustment, candidates
        What predicted the places, and all of them.
    rows
        Those to look at.
    progress
        Shows long loops.
    """
    spread = np.linalg.eigvalsh(candidates.places.covariance_px2[rows])
    radius = radii(candidates.places.covariance_px2[rows])
    frame = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    label = adjustment.survey.row_of_label
    results: dict[Pair, Found | Missed] = {}
    chosen = np.unique(candidates.pick[rows])
    for pick in progress(iter(chosen.tolist()), "looking along lines of sight", len(chosen)):
        own = np.flatnonzero(candidates.pick[rows] == pick)
        pairs = [candidates.pair[rows[i]] for i in own]
        sure = [
            k
            for k, (i, pair) in enumerate(zip(own, pairs, strict=True))
            if spread[i, 0] < ASIDE_PX**2 and pair[0] in frame
        ]
        poor = Missed(pick, 0.0, REASON[Refused.TOO_FAR])
        results |= dict.fromkeys(pairs, poor)
        if not sure:
            continue
        others = np.array([frame[pairs[k][0]] for k in sure])
        line = line_of_sight(
            adjustment, (frame[picks.image[pick]], label[picks.label[pick]]), others,
            picks.pixel_px[pick],
        )  # fmt: skip
        images = [photos.get(pairs[k][0]) for k in sure]
        found = found_on_line(photos.get(picks.image[pick]), images, line)
        sigma = pick_sigmas(found.covariance_px2, np.ones(len(sure), np.bool_))
        for n, k in enumerate(sure):
            far = float(radius[own[k]])
            if found.refused[n]:
                why = REASON[Refused(int(found.refused[n]))]
                results[pairs[k]] = Missed(pick, far, why)
            else:
                u, v = np.round(found.pixel_px[n], 3).tolist()
                score = round(float(found.score[n]), 3)
                results[pairs[k]] = Found(pick, (u, v), round(float(sigma[n]), 4), score, far)
    return results


def line_of_sight(
    adjustment: Adjustment, of: tuple[int, int], others: Ints, pixel_px: Floats
) -> Line:
    """A picked pixel's line of sight as other photos show it.

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
    center, ray = _sight(adjustment, frame, pixel_px)
    from_m, raised_m, to_m = HEIGHTS_M
    ends = _pixels(adjustment, others, _at_heights(adjustment, label, (center, ray), [0.0, to_m]))
    long = np.linalg.norm(ends[1] - ends[0], axis=1)
    long_px = float(np.nan_to_num(long).max()) * (to_m - from_m) / to_m
    height = np.linspace(from_m, to_m, min(int(long_px / STEP_PX) + 8, MOST_PLACES))
    place = _at_heights(adjustment, label, (center, ray), height)
    columns = []
    for step in _ABOUT_PX * np.eye(2):
        both = []
        for sign in (1.0, -1.0):
            start, beside = _sight(adjustment, frame, pixel_px + sign * step)
            level = start + ((place[:, 2] - start[2]) / beside[2])[:, None] * beside
            both.append(_pixels(adjustment, others, level))
        columns.append((both[0] - both[1]) / (2.0 * _ABOUT_PX))
    return Line(
        source_px=pixel_px,
        pixel_px=_pixels(adjustment, others, place),
        affine=np.stack(columns, axis=-1),
        lowest=int(np.searchsorted(height, raised_m)),
    )


def _sight(adjustment: Adjustment, frame: int, pixel_px: Floats) -> tuple[Floats, Floats]:
    """Where a pixel's line of sight begins, and its direction, (3,) each."""
    state, lens = adjustment.state, adjustment.problem.intrinsics(adjustment.state)
    pose = RowPoses(state.center[frame], state.rotation[frame], adjustment.sweep()[frame])
    return sight_lines(adjustment.survey.calibration, lens, pose, pixel_px)


def _at_heights(
    adjustment: Adjustment, label: int, sight: tuple[Floats, Floats], height_m: Floats | list[float]
) -> Floats:
    """(k, 3) places of a line of sight at heights (k,) above the ground.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    label
        Whose area's ground it is.
    sight
        Where the line begins, and its direction.
    height_m
        The heights.
    """
    center, ray = sight
    ground, state = adjustment.problem.ground, adjustment.state
    height = np.asarray(height_m)
    of = np.full(len(height), label)
    place = np.tile(adjustment.points()[0][label], (len(height), 1))
    for _ in range(_STEPS):
        up = ground.at(state.plane, state.relief, of, place[:, :2]).height_m + height
        place = center + ((up - center[2]) / ray[2])[:, None] * ray
    return np.asarray(place)


def _pixels(adjustment: Adjustment, frames: Ints, world_m: Floats) -> Floats:
    """(k, t, 2) pixels of places (k, 3) in frames (t,); NaN behind a camera."""
    state, sweep = adjustment.state, adjustment.sweep()
    poses = RowPoses(state.center[frames], state.rotation[frames], sweep[frames])
    every = np.broadcast_to(world_m[:, None], (len(world_m), len(frames), 3))
    lens = adjustment.problem.intrinsics(state)
    return project_rows(adjustment.survey.calibration, lens, poses, every)

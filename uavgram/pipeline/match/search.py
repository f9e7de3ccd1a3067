"""Search for picks in the other photos, round by round, each with the poses of the last.

Photos whose pose is unknown or vague are searched where features predict the picks; their finds
give them a pose.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.measuring.predicted_pixels import FlightOfPhotos
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.row_projection import RowPoses, project_rows, sight_lines
from uavgram.imaging.matching.least_squares import (
    REASON_TEXTS,
    Matches,
    RefusalReason,
    SoughtPoints,
)
from uavgram.imaging.matching.line_of_sight import LineMatches, SightLine, match_along_line
from uavgram.imaging.matching.match import match_points
from uavgram.imaging.photos.cache import LruCache
from uavgram.imaging.raster import Image
from uavgram.io.photos.catalogue import read_grey
from uavgram.model.arrays import Bools, Floats, Ints, rows_of
from uavgram.model.observations import Picks
from uavgram.pipeline.match.adjustment import MIN_HEIGHT_M, BaseAdjustment, find_blank_labels
from uavgram.pipeline.match.height_evidence import collect_height_evidence, predict_candidates
from uavgram.pipeline.match.places_by_features import FeaturePlaces
from uavgram.pipeline.match.selection import list_labels_without_height
from uavgram.pipeline.parallel import Progress, prefetch, silent
from uavgram.stages.match import (
    CONTRADICTED,
    EVEN_ODDS,
    MAX_RADIUS_PX,
    MIN_PX,
    REGION_SQUARED,
    Candidates,
    Found,
    Missed,
    Pair,
    Record,
    choose_lines,
    choose_next_places,
    find_raised_labels,
    pick_sigmas,
    shows_ground,
)

MAX_BYTES = 1_000_000_000
"""Memory for decoded photos [bytes]: fifty of 20 megapixels."""

Photos = LruCache[str, Image]
"""Grey photos by name, decoded once while they are kept."""


def load_grey_photos(paths: Mapping[str, str]) -> Photos:
    """Return photos by name that are decoded on demand, in the stored orientation."""
    return LruCache(lambda name: read_grey(paths[name]), lambda photo: photo.nbytes, MAX_BYTES)


def search_places(
    photos: Photos, candidates: Candidates, rows: Ints, picks: Picks, progress: Progress = silent
) -> dict[Pair, Found | Missed]:
    """Search for places, and return the results in their order.

    Parameters
    ----------
    photos
        Grey, by name.
    candidates, rows
        Predicted places, and those to search for: each photo and label once.
    picks
        All picks.
    progress
        Shows long loops.

    Raises
    ------
    InputError
        A photo cannot be read.
    """
    places, pick = candidates.places.select(rows), candidates.pick[rows]
    by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
    count = Counter(label for _, label in {(picks.image[i], picks.label[i]) for i in by_hand})
    sought = SoughtPoints(
        is_confirmed=np.array([count[picks.label[i]] > 1 for i in pick], dtype=np.bool_),
        source_px=picks.pixel_px[pick],
        target_px=places.pixel_px,
        covariance_px2=places.covariance_px2 + MIN_PX**2 * np.eye(2),
        affine=places.affine,
        rise=places.rise,
    )
    # Places in the same two photos are searched together, photo by photo.
    groups: dict[tuple[str, str], list[int]] = {}
    for k, row in enumerate(rows.tolist()):
        target, source = candidates.pair[row][0], picks.image[pick[k]]
        groups.setdefault((target, source), []).append(k)

    def look(group: tuple[tuple[str, str], list[int]]) -> Matches:
        (target, source), some = group
        own = replace(sought, **rows_of(sought, np.array(some)))
        return match_points(photos.get(source), photos.get(target), own)

    results: dict[Pair, Found | Missed] = {}
    done = prefetch(look, sorted(groups.items()))
    for (_, some), found in progress(done, "looking in the photos", len(groups)):
        own = rows[some]
        results |= _make_results(found, candidates, own, candidates.is_raised[own])
    return {pair: results[pair] for pair in (candidates.pair[row] for row in rows)}


def _make_results(
    found: Matches | LineMatches, candidates: Candidates, rows: Ints, is_raised: Bools
) -> dict[Pair, Found | Missed]:
    """Make the results of the matching at places.

    Parameters
    ----------
    found
        Its first n values are those of the places.
    candidates, rows
        All places, and (n,) those that were searched for.
    is_raised
        Whether the points are off the ground.
    """
    stated = pick_sigmas(found.covariance_px2, is_raised)
    results: dict[Pair, Found | Missed] = {}
    for k, row in enumerate(rows.tolist()):
        pick, radius = int(candidates.pick[row]), float(candidates.radius_px[row])
        result: Found | Missed
        if found.refused[k]:
            result = Missed(pick, radius, REASON_TEXTS[RefusalReason(int(found.refused[k]))])
        else:
            u, v = np.round(found.pixel_px[k], 3).tolist()
            sigma, score = round(float(stated[k]), 4), round(float(found.score[k]), 3)
            result = Found(pick, (u, v), sigma, score, radius)
        results[candidates.pair[row]] = result
    return results


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
    for row in rows[~known].tolist():
        pick, far = int(candidates.pick[row]), float(candidates.radius_px[row])
        too_far = Missed(pick, far, REASON_TEXTS[RefusalReason.TOO_FAR])
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
    pick = int(candidates.pick[rows[0]])
    frame = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    of = frame[picks.image[pick]], adjustment.label_index(picks.label[pick])
    by_photo = {  # one pick in each other photo: a repetition is no other view
        picks.image[i]: i
        for i in np.flatnonzero(picks.of_source("hand")).tolist()
        if picks.label[i] == picks.label[pick] and picks.image[i] in frame
    }
    picked = [i for image, i in by_photo.items() if image != picks.image[pick]]
    names = [*(candidates.pair[row][0] for row in rows), *(picks.image[i] for i in picked)]
    line = project_sightline(
        adjustment, of, np.array([frame[name] for name in names]), picks.pixel_px[pick]
    )
    stated = np.where(np.isnan(picks.sigma_px), sigma_px, picks.sigma_px)
    agrees = _agrees(
        line, slice(len(rows), None), picks.pixel_px[picked], (stated[pick], stated[picked])
    )
    line.pixel_px[~agrees] = np.nan
    source = photos.get(picks.image[pick])
    found = match_along_line(source, [photos.get(name) for name in names], line)
    return _make_results(found, candidates, rows, np.ones(len(names), np.bool_))


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


MAX_ROUNDS = 11
"""Largest number of rounds of search and adjustment."""

LINES_BEFORE = 1
"""Rounds from the end at which lines of sight are searched, even if ground places remain."""

PLANE = 3
"""Number of points that determine a plane."""


UNPLACED = "the photos do not show it on the ground, and its height is not known"

GROUNDLESS = (
    "the photos do not show which points are on the ground, as these look different in most of "
    "them: also pick three marks on the road, each in two photos, with the height 0"
)


class Search(NamedTuple):
    """Finds and misses, the last adjustment with them, and labels without a place (`Adjusted`)."""

    record: Record
    adjustment: Adjustment
    unplaced: frozenset[str]


def search_all_photos(
    base: BaseAdjustment,
    photos: Photos,
    wanted: Callable[[Pair], bool],
    progress: Progress = silent,
    on_ground: float = EVEN_ODDS,
) -> Search:
    """Search for picks in all photos until there is nothing left to try.

    Parameters
    ----------
    base
        The project, its own picks adjusted.
    photos
        Grey, by name.
    wanted
        Whether to search for a label in a photo.
    progress
        Shows long loops.
    on_ground
        Odds that a label without a height is on the ground.
    """
    record, adjustment, unplaced = _drop_contradicted(base, Record())
    by_features = False
    sigma_px, features = base.inputs.project.picks_sigma_px, FeaturePlaces(base.inputs)
    for left in reversed(range(MAX_ROUNDS)):
        candidates = _candidates(base, adjustment)
        asked = np.array([wanted(pair) for pair in candidates.pair], dtype=np.bool_)
        rows, lines = (
            choose_next_places(candidates, asked, record),
            choose_lines(candidates, asked, record),
        )
        picks = base.inputs.picks
        evidence = collect_height_evidence(adjustment, picks, candidates, record, sigma_px)
        off = np.array(adjustment.survey.label)[adjustment.survey.is_free].tolist()
        as_ground = [pair for pair in record.found if pair[1] in off]  # its patch may be wrong
        raised = find_raised_labels(evidence, on_ground)
        raised = raised or set(list_labels_without_height(picks, as_ground))
        is_over = candidates.is_raised[rows].all()  # for ground points
        if raised and (is_over or left == LINES_BEFORE + 1):  # along their lines of sight, or not
            freed = _free_heights(base, raised, record)
            if freed is not None:
                base, (record, adjustment, unplaced) = freed
                continue
        if rows.size and not (lines.size and left == LINES_BEFORE):
            looked = search_places(photos, candidates, rows, picks, progress)
            looked = _revoke_contradicted(candidates, rows, looked, record)
        elif lines.size:  # the poses are as good as ground points allow
            looked = search_sightlines(
                photos, picks, adjustment, candidates, lines, sigma_px, progress
            )
        elif not by_features:  # once, in photos without a good pose
            by_features = True
            looked = _search_by_features(photos, base, features, candidates, record, wanted)
        else:
            break
        before, record = record, record.add_results(looked)
        if record.found != before.found:
            record, adjustment, unplaced = _drop_contradicted(base, record)
    unsure = {pair: UNPLACED for pair in record.found if pair[1] in unplaced}
    evidence = collect_height_evidence(
        adjustment, base.inputs.picks, _candidates(base, adjustment), record, sigma_px
    )
    if not (_knows_ground(base, adjustment) or shows_ground(evidence, on_ground)):
        blank = find_blank_labels(base.inputs.picks)
        unsure |= {pair: GROUNDLESS for pair in record.found if pair[1] in blank}
    return Search(record.revoke_finds(unsure), adjustment, unplaced)


def _knows_ground(base: BaseAdjustment, adjustment: Adjustment) -> bool:
    """Return whether known points, each picked in two photos, determine the ground.

    Known are control points, and labels of stated height.
    """
    picks, survey = base.inputs.picks, adjustment.survey
    known = set(np.array(picks.label)[~np.isnan(picks.height_m)].tolist())
    known |= {survey.label[k] for k in survey.control_label.tolist()}
    pairs = {(picks.image[i], picks.label[i]) for i in base.sources(adjustment)}
    photos = Counter(label for _, label in pairs)
    return sum(photos[label] > 1 for label in known) >= PLANE


def _free_heights(
    base: BaseAdjustment, raised: Collection[str], record: Record
) -> tuple[BaseAdjustment, Search] | None:
    """Free the heights of labels and remove their finds, as far as other points place the photos.

    Labels picked in one photo place no photo.

    Parameters
    ----------
    base, record
        The project, and the search so far.
    raised
        Labels off the ground.
    """
    picks = base.inputs.picks
    photos = Counter(label for _, label in set(zip(picks.image, picks.label, strict=True)))
    for labels in (set(raised), {label for label in raised if photos[label] == 1}):
        if labels:
            freed = base.free_heights(labels)
            with suppress(GeometryError):
                return freed, _drop_contradicted(freed, record.remove_labels(labels))
    return None


def _drop_contradicted(base: BaseAdjustment, record: Record) -> Search:
    """Adjust with the finds, and drop contradicted ones."""
    adjusted = base.adjust_finds(record.found)
    return Search(
        record.revoke_finds(adjusted.contradicted), adjusted.adjustment, adjusted.unplaced
    )


def _candidates(base: BaseAdjustment, adjustment: Adjustment) -> Candidates:
    """Predict the places of picks made by people."""
    alone = base.mark_unknown_heights(adjustment.survey)
    sources = base.sources(adjustment)
    return predict_candidates(adjustment, _flight(base), base.inputs.picks, sources, alone)


def _revoke_contradicted(
    candidates: Candidates, rows: Ints, looked: Mapping[Pair, Found | Missed], record: Record
) -> dict[Pair, Found | Missed]:
    """Revoke finds that others in the same photo contradict.

    Those that were contradicted before are also revoked where they are not at their present place.

    Parameters
    ----------
    candidates, rows
        Predicted places, and those that were searched for.
    looked
        Finds and misses there.
    record
        The search so far.
    """
    found = {
        row: one
        for row, one in zip(rows.tolist(), looked.values(), strict=True)
        if isinstance(one, Found)
    }
    wrong = set(candidates.list_contradicted(found))
    for row, one in found.items():
        before = record.missed.get(candidates.pair[row], ())
        is_repeated = any(missed.why == CONTRADICTED for missed in before)
        if is_repeated and not candidates.holds(row, one.pixel_px, one.sigma_px):
            wrong.add(candidates.pair[row])
    return {
        pair: one.revoke(CONTRADICTED) if isinstance(one, Found) and pair in wrong else one
        for pair, one in looked.items()
    }


def _flight(base: BaseAdjustment) -> FlightOfPhotos | None:
    telemetry = base.posed.telemetry
    if telemetry is None:
        return None
    return telemetry.prior, telemetry.track, telemetry.poses.frame_id


def _search_by_features(
    photos: Photos,
    base: BaseAdjustment,
    features: FeaturePlaces,
    candidates: Candidates,
    record: Record,
    wanted: Callable[[Pair], bool],
) -> dict[Pair, Found | Missed]:
    """Search where features predict picks, in photos whose pose is unknown or vague.

    Parameters
    ----------
    photos, base, wanted
        As for `search_all_photos`.
    features
        Predictions by the features of the photos.
    candidates, record
        Places predicted by poses, and the search so far.
    """
    sharp = {image for image, _ in record.found}
    near = np.flatnonzero(candidates.radius_px <= MAX_RADIUS_PX)
    sharp |= {candidates.pair[row][0] for row in near}

    def is_open(pair: Pair) -> bool:
        return pair[0] not in sharp and pair not in record.found and wanted(pair)

    results: dict[Pair, Found | Missed] = {}
    for places in features.predict(base.inputs.picks, is_open):
        rows = [k for k, pair in enumerate(places.pair) if not isinstance(results.get(pair), Found)]
        some = np.array(rows, dtype=np.int64)
        results |= search_places(photos, places, some, base.inputs.picks)
    return results

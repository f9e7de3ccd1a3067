"""First values of the adjustment: from the telemetry, from known lengths, from control points.

Also frames in doubt, which begin once more: their pose may be the wrong planar solution.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.special import chdtri

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import (
    FirstValues,
    add_free_points,
    count_lines_per_frame,
    estimate_ground_height,
    estimate_length_poses,
    intersect_seed_rays,
)
from uavgram.estimation.first_poses.known_frames import PlaneNetwork, align_in_plane
from uavgram.estimation.first_poses.known_points import find_candidate_poses
from uavgram.estimation.first_poses.length_poses import (
    compare_with_seed,
    find_allowed,
    move_seed_to_plane,
)
from uavgram.estimation.first_poses.resection import MIN_PICKS, Pose
from uavgram.estimation.first_poses.tied.two_views import add_turned_frames
from uavgram.estimation.reliability.redundancy import compute_cofactors
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause, Refined
from uavgram.estimation.survey.selection import replace_matches_by_picks
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import pose_above_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey import Survey
from uavgram.stages.refine.frame_planes import describe_missing_input, find_frame_planes

MAX_TILT_RAD, MAX_HEIGHT_RATIO = 0.1, 0.15
"""Tilt [rad], and share of the height, up to which the iterations reach a pose from the seed
anyway."""

MAX_BASES = 4
"""Frames whose lengths begin in turn where those of the first led to no result."""

BEYOND_LENS = LeftOut(
    LeftOutCause.BEYOND_LENS, "the lens is not calibrated there, at the rim of the photo"
)
NO_GROUND = LeftOut(
    LeftOutCause.NO_GROUND, "it is in the sky: its line of sight does not meet the ground"
)
ABOVE_CAMERA = LeftOut(
    LeftOutCause.NO_GROUND, "its stated height is above the camera: correct the height"
)
NO_HEIGHT = LeftOut(
    LeftOutCause.UNDETERMINED,
    "the height of its point is to be found, which takes photos from two places: pick it in "
    "another photo, from further aside, or state its height",
)
NOT_JOINED = LeftOut(
    LeftOutCause.NOT_JOINED,
    "nothing places its photo, which takes a flight log, three lengths that it shows (or right "
    "angles, parallels and the like), or four points that it shares with placed photos and that "
    "fit together",
)


def find_first_values(survey: Survey) -> list[FirstValues]:
    """Compute sets of first values, most likely first; unplaced points and frames are NaN."""
    if survey.telemetry is not None:
        ray = _compute_rays(survey)
        found = [intersect_seed_rays(each, ray) for each in _seed_surveys(survey)]
        return [add_free_points(survey, values) for values in found]
    shown = replace_matches_by_picks(survey)
    begun = find_frame_planes(shown, _compute_rays(shown))
    counts, planes = begun.counts, begun.planes
    own: list[ChosenPoses] = [
        {frame: pose_above_plane(plane)} for frame, plane in _list_planes(planes, counts)
    ]
    if survey.gauge == "world":
        choices = _list_choices(survey)
        on_control = _extend_choices(survey, planes, choices) if choices[0] else []
        if _is_any_placed(on_control):
            return on_control
        # Planes by lengths and control together, then by lengths alone: control may be wrong.
        taped = add_control_distances(shown)
        together = find_frame_planes(taped, _compute_rays(taped)).planes
        each = [
            {**planes, **together, frame: plane[None]}
            for found in (together, planes)
            for frame, plane in _list_planes(found, counts)
        ]
        on_planes = [one for some in each for one in _extend_choices(survey, some, choices[:1])]
        if _is_any_placed(on_planes):
            return [one for one in on_planes if _is_any_placed([one])]
        local = _extend_choices(replace(survey, gauge="plane"), planes, own)
        moved = [_move_to_control(survey, values) for values in local]
        if not _is_any_placed(moved):
            raise GeometryError(
                "without a flight log a photo is placed by three control points in it, or two and "
                "three known lengths, or six points on four lines of known position: pick more of "
                "them, or give the log"
            )
        return moved
    chosen = [tied for tied in _list_choices(survey)[:1] if tied]
    if not planes and not chosen:
        raise GeometryError(describe_missing_input(shown, begun))
    return _extend_choices(survey, planes, chosen + own)


def _list_planes(planes: Mapping[int, Floats], counts: Ints) -> list[tuple[int, Floats]]:
    """List the planes (3,) of the frame with most equations (F,), each with that frame."""
    frame = max(planes, key=lambda f: (counts[f], -f), default=-1)
    return [(frame, plane) for plane in planes.get(frame, ())]


def find_other_first_values(
    survey: Survey, known: Mapping[str, Pose], doubtful: Collection[str]
) -> list[FirstValues]:
    """Compute first values that differ from an adjustment with some frames in doubt.

    All frames in doubt are joined to the others again. Where the others are wrong themselves, the
    lengths of other frames begin.

    Parameters
    ----------
    survey
        Survey without telemetry.
    known
        Poses of frames (by name) as adjusted.
    doubtful
        Names of frames in doubt, and perhaps of others.

    Raises
    ------
    GeometryError
        There are none.
    """
    shown = replace_matches_by_picks(survey)
    _, counts, planes = find_frame_planes(shown, _compute_rays(shown))
    named = dict(enumerate(survey.frame_id))
    trusted = {f: known[name] for f, name in named.items() if name in known.keys() - doubtful}
    chosen = [trusted]
    if survey.gauge == "plane":
        chosen = [trusted] if trusted else []
        likeliest = sorted(planes, key=lambda f: (-counts[f], f))[:MAX_BASES]
        chosen += [{f: pose_above_plane(planes[f][0])} for f in likeliest]
    found = [
        values
        for values in _extend_choices(survey, planes, chosen)
        if any(_has_other_pose(values, f, known.get(name)) for f, name in named.items())
    ]
    if not found:
        raise GeometryError("no first values lead elsewhere")
    return found


def _has_other_pose(values: FirstValues, frame: int, known: Pose | None) -> bool:
    """Return whether a frame has a new pose, or one too far away for the iterations."""
    if np.isnan(values.center[frame, 0]):
        return False
    return known is None or _is_far(known, (values.center[frame], values.rotation[frame]))


def _is_far(one: Pose, other: Pose) -> bool:
    """Return whether iterations may not lead from one pose to the other, by tilt and height."""
    tilt = np.arccos(np.clip(one[1][2] @ other[1][2], -1.0, 1.0))
    return bool(
        tilt > MAX_TILT_RAD or abs(one[0][2] - other[0][2]) > MAX_HEIGHT_RATIO * abs(one[0][2])
    )


def _seed_surveys(survey: Survey) -> list[Survey]:
    """Return the survey with its seeds and, if lengths contradict these, with seeds that fit them.

    Lengths are used in frames that show three or more of them completely, if these determine the
    pose. Of the poses that explain the lengths, only those that the telemetry allows are used. If
    one is close to the seed, the iterations find it from there. Poses far from the seed, or from
    each other, are starts of their own for the frame with most lines; other frames use their best
    one.
    """
    assert survey.seeds is not None  # noqa: S101  (the caller asked)
    seeds, ground = survey.seeds, survey.ground
    allowed_planes: dict[int, Floats] = {}
    for frame, poses in estimate_length_poses(survey).items():
        center = seeds.center_world_m[frame]
        seed = (center, seeds.world_from_camera[frame], seeds.covariance[frame], ground)
        known = poses.take(np.flatnonzero(poses.converged))
        # Poses by lengths within the telemetry's prior, likeliest first.
        compared = compare_with_seed(*seed, known)
        order = np.argsort(known.cost + compared.squared_distance, kind="stable")
        order = order[find_allowed(compared.squared_distance[order])]
        inside, shift = known.take(order), compared.shift[order]
        # Distance from the seed, and from the likeliest of several.
        height, *tilt = np.concatenate([shift, shift - shift[:1]]).T
        above = center[2] - ground.height_m
        if (np.hypot(*tilt) > MAX_TILT_RAD).any() or (
            np.abs(height) > MAX_HEIGHT_RATIO * above
        ).any():
            allowed_planes[frame] = inside.plane
    if not allowed_planes:
        return [survey]
    counts = count_lines_per_frame(survey)
    first = max(allowed_planes, key=lambda f: (counts[f], -f))
    best = {frame: planes[0] for frame, planes in allowed_planes.items()}
    return [
        survey,
        *(_replace_seeds(survey, best | {first: plane}) for plane in allowed_planes[first]),
    ]


def _replace_seeds(survey: Survey, planes: dict[int, Floats]) -> Survey:
    """Move the seeds of some frames to the height and tilt of their planes."""
    assert survey.seeds is not None  # noqa: S101  (the caller asked)
    center = np.array(survey.seeds.center_world_m)
    rotation = np.array(survey.seeds.world_from_camera)
    for frame, plane in planes.items():
        center[frame], rotation[frame] = move_seed_to_plane(
            center[frame], rotation[frame], survey.ground, plane
        )
    seeds = replace(survey.seeds, center_world_m=center, world_from_camera=rotation)
    return replace(survey, seeds=seeds)


ChosenPoses = dict[int, Pose]
"""Centre and rotation of some frames, world from camera."""

MAX_CHOICES = 8
"""Largest number of starts from candidate poses: each takes an adjustment."""


def _list_choices(survey: Survey) -> list[ChosenPoses]:
    """List every frame's best pose; then with one frame's next best, nearest rival first."""
    frame_at = {name: k for k, name in enumerate(survey.frame_id)}
    candidates = [(frame_at[c.frame_id], c) for c in find_candidate_poses(survey)]
    best = {f: (c.center_world_m[0], c.world_from_camera[0]) for f, c in candidates}
    rivals = [
        (c.misfit[k] - c.misfit[0], f, (c.center_world_m[k], c.world_from_camera[k]))
        for f, c in candidates
        for k in range(1, len(c.misfit))
    ]
    rivals.sort(key=lambda rival: rival[:2])
    return [best, *(best | {f: pose} for _, f, pose in rivals[: MAX_CHOICES - 1])]


def _extend_choices(
    survey: Survey, planes: dict[int, Floats], choices: list[ChosenPoses]
) -> list[FirstValues]:
    """Compute first values from every choice of poses: over control points, or at the gauge.

    Heights of control points above the label's own give the plane's.

    Parameters
    ----------
    survey
        Survey without telemetry.
    planes
        (n, 3) planes of every frame that has any, likeliest first.
    choices
        Poses of some frames, which the others join.
    """
    label = survey.control_label
    control = survey.gauge == "world"
    height = 0.0
    if control:
        height = estimate_ground_height(survey)
    lift = np.array([0.0, 0.0, height])
    shown, values = replace_matches_by_picks(_state_control_heights(survey, height)), []
    ray = _compute_rays(shown)
    for poses in choices:
        network = PlaneNetwork(shown, ray)
        if control:
            network.point[label] = survey.control_world_m[:, :2]
        for frame, (center, rotation) in poses.items():
            network.place(frame, center - lift, rotation)
        network.grow(planes)
        nothing = np.zeros(len(survey.label))
        poses_found = add_turned_frames(survey, network.center + lift, network.rotation)
        grown = FirstValues(network.point, *poses_found, height, nothing)
        values.append(add_free_points(survey, grown if control else _move_to_gauge(grown)))
    return values


def _is_any_placed(values: Sequence[FirstValues]) -> bool:
    """Return whether any first values place a photo."""
    return any(np.isfinite(each.center).any() for each in values)


MOST_EXCHANGED = 12
"""Number of control points up to which exchanges of two of them are tried, and their distances
used."""

LINE_RATIO = 0.01
"""Ratio of the second to the largest extent of control points below which they are on one line."""

AGREEMENT_SHARE = 0.02
"""Largest distance of a control point from its place in the network of photos, as a share of the
extent of all control, to agree."""


def _move_to_control(survey: Survey, values: FirstValues) -> FirstValues:
    """Rotate and shift first values onto the control; NaN where fewer than two points agree."""
    up = estimate_ground_height(survey)
    here, there = values.point_m[survey.control_label], survey.control_world_m[:, :2]
    agree = find_agreeing_control(here, there)
    turn, shift = np.full((3, 3), np.nan), np.full(3, np.nan)
    if agree.any():
        turn, shift = align_in_plane(here[agree], there[agree])
    return FirstValues(
        values.point_m @ turn[:2, :2].T + shift[:2],
        values.center @ turn.T + shift + np.array([0.0, 0.0, up]),
        turn @ values.rotation,
        up,
        values.departure_m,
    )


def find_agreeing_control(here: Floats, there: Floats) -> Bools:
    """Mark the control points (n,) that one movement takes to their places; none of fewer than two.

    Each pair of points gives a movement, and the one with which most others agree counts. Of four
    points two may be exchanged, and these two agree in another movement: the exchange with which
    more than one other point agrees decides.

    Parameters
    ----------
    here, there
        (n, 2) places in a network of photos, NaN where it has none; places as they are known.
    """
    known = np.flatnonzero(np.isfinite(here[:, 0])).tolist()
    best = _find_agreeing(here, there, known)
    for pair in combinations(known, 2) if len(known) <= MOST_EXCHANGED else ():
        exchanged = there.copy()
        exchanged[list(pair)] = there[list(reversed(pair))]
        agree = _find_agreeing(here, exchanged, known)
        if agree.sum() > best.sum() + 1:
            best = agree & ~np.isin(np.arange(len(here)), pair)
    return best


def do_all_agree(here: Floats, there: Floats) -> bool:
    """Return whether one movement takes all points (n, 2) to their places (n, 2)."""
    return len(here) < 3 or bool(_find_agreeing(here, there, range(len(here))).all())


def _find_agreeing(here: Floats, there: Floats, known: Sequence[int]) -> Bools:
    """Mark the points (n,) that agree with the best movement; none of fewer than two."""
    best = np.zeros(len(here), dtype=np.bool_)
    for pair in combinations(known, 2):
        turn, shift = align_in_plane(here[list(pair)], there[list(pair)])
        off = np.linalg.norm(here @ turn[:2, :2].T + shift[:2] - there, axis=1)
        agree = off < AGREEMENT_SHARE * np.ptp(there, axis=0).max()
        if agree.sum() > max(best.sum(), 1):
            best = np.asarray(agree)
    return best


def _state_control_heights(survey: Survey, height_m: float) -> Survey:
    """State the heights of control points above the plane, where they are free.

    They are known: such a point places photos as one on the ground does.
    """
    label = survey.control_label[survey.is_free[survey.control_label]]
    rows = np.isin(survey.control_label, label)
    free, above = survey.is_free.copy(), survey.height_above_m.copy()
    free[label] = False
    above[label] = survey.control_world_m[rows, 2] - height_m
    return replace(survey, is_free=free, height_above_m=above)


def add_control_distances(survey: Survey) -> Survey:
    """Add the distances between control points in one plane, as if they were taped.

    Of points on one line only the longest: the others say no more about the plane.
    """
    rows = np.flatnonzero(~survey.is_free[survey.control_label])[:MOST_EXCHANGED]
    one, other = (rows[k] for k in np.triu_indices(len(rows), 1))
    place, sigma = survey.control_world_m, survey.control_sigma_m.max(axis=1, initial=0.0)
    if len(rows) > 2:
        off = place[rows] - place[rows].mean(axis=0)
        extent = np.linalg.svd(off, compute_uv=False)
        if extent[1] < LINE_RATIO * extent[0]:
            longest = np.linalg.norm(place[one] - place[other], axis=1).argmax()
            one, other = one[longest : longest + 1], other[longest : longest + 1]
    return replace(
        survey,
        line_start=np.append(survey.line_start, survey.control_label[one]),
        line_end=np.append(survey.line_end, survey.control_label[other]),
        length_m=np.append(survey.length_m, np.linalg.norm(place[one] - place[other], axis=1)),
        length_sigma_m=np.append(survey.length_sigma_m, np.hypot(sigma[one], sigma[other])),
        line_name=(),
        line_tape=(),
        line_along=(),
    )


def _move_to_gauge(values: FirstValues) -> FirstValues:
    """Rotate and shift first values so that the first placed frame meets the gauge's conditions."""
    placed = int(np.flatnonzero(np.isfinite(values.center[:, 0]))[0])
    image_up = -values.rotation[placed][:2, 1]
    size = np.linalg.norm(image_up)
    north = image_up / size if size > 0 else np.array([0.0, 1.0])
    center = values.center[placed, :2]
    turn, shift = align_in_plane(
        np.stack([center, center + north]), np.array([[0.0, 0.0], [0.0, 1.0]])
    )
    return FirstValues(
        values.point_m @ turn[:2, :2].T + shift[:2],
        values.center @ turn.T + shift,
        turn @ values.rotation,
        0.0,
        values.departure_m,
    )


def find_unusable_picks(survey: Survey, values: FirstValues) -> dict[int, LeftOut]:
    """Find picks without first values in front of their camera, and the reasons."""
    frame, label = survey.pick_frame, survey.pick_label
    up = values.height_m + (survey.height_above_m + values.departure_m)[label]
    world = np.column_stack([values.point_m[label], up])
    depth = np.einsum("ni,ni->n", world - values.center[frame], values.rotation[frame][:, :, 2])
    placed = np.isfinite(values.center[frame, 0])
    from_above = survey.off_ground[label] | (values.center[frame, 2] > up)
    usable = placed & (np.nan_to_num(depth, nan=-1.0) > 0) & from_above
    one_place = survey.is_free[label] & np.isnan(values.point_m[label, 0])
    # Too few shared points check a pose without a log that sees the sky at most picks.
    frames = len(survey.frame_id)
    seen = 2 * np.bincount(frame[usable], minlength=frames) > np.bincount(frame, minlength=frames)
    known = np.append(label[seen[frame]], survey.control_label)
    own = np.unique(np.column_stack([frame, label])[np.isin(label, known)], axis=0)
    shared = np.bincount(own[:, 0], minlength=frames)
    checked = seen | (shared >= MIN_PICKS) | (survey.telemetry is not None)
    why = np.where(one_place, 2, placed & checked[frame])
    is_stated = survey.height_above_m[label] != 0.0
    why[is_stated & (up >= values.center[frame, 2])] = 3
    causes = (NOT_JOINED, NO_GROUND, NO_HEIGHT, ABOVE_CAMERA)
    return {int(i): causes[why[i]] for i in np.flatnonzero(~usable)}


def _compute_rays(survey: Survey) -> Floats:
    """Compute the rays (P, 3) of the picks in their cameras."""
    return back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)


def find_picks_in_lens(survey: Survey) -> tuple[Bools, dict[int, LeftOut]]:
    """Mark picks (P,) within the lens model, and return why others take no part."""
    keep: Bools = np.isfinite(_compute_rays(survey).sum(axis=1))
    return keep, dict.fromkeys(np.flatnonzero(~keep).tolist(), BEYOND_LENS)


MAX_FIT_PROBABILITY = 0.001
"""Probability below which the residuals of a frame's picks put its pose in doubt."""

LOST_PICK_COST = 400.0
"""Cost of a pick that an adjustment had to leave out: that of a poor fit."""


def find_doubtful_frames(survey: Survey, refined: Refined) -> frozenset[str]:
    """Find frames that an adjustment fits badly, or at whose picks it sees no ground.

    The sum of squares of a frame's picks is compared with chi-square of their redundancy.
    """
    adjustment = refined.adjustment
    block, names = adjustment.minimum.blocks["pixels"], adjustment.survey.frame_id
    frame = adjustment.survey.pick_frame
    # Redundancy of each pick: trace of its cofactor matrix.
    own = np.einsum("nii->n", compute_cofactors(block, adjustment.covariance))
    redundancy = np.bincount(frame, own, len(names))
    square = np.bincount(frame, np.sum(block.residual**2, axis=1), len(names))
    bad = square > chdtri(np.maximum(redundancy, 1.0), MAX_FIT_PROBABILITY)
    unseen = {
        survey.frame_id[survey.pick_frame[pick]]
        for pick, why in refined.pick_reason.items()
        if why.cause is LeftOutCause.NO_GROUND
    }
    return frozenset(unseen | {names[k] for k in np.flatnonzero(bad)})


def cost_with_lost(refined: Refined, picks: int) -> float:
    """Return the cost of an adjustment of so many picks, including the left-out ones."""
    return refined.adjustment.minimum.cost + LOST_PICK_COST * (picks - len(refined.pick_index))

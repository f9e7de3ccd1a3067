"""First values of the adjustment: from the telemetry, from known lengths, from control points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.network import (
    POOR,
    FirstValues,
    PlaneNetwork,
    align_in_plane,
    from_telemetry,
    length_poses,
    lines_per_frame,
)
from uavgram.estimation.first_poses.prior_gate import (
    OUTSIDE,
    allowed,
    compare_with_seed,
    seed_on_plane,
)
from uavgram.estimation.first_poses.resection import LengthPoses
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause
from uavgram.geometry.camera.back_projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.survey import Survey

FAR_RAD, FAR_HEIGHT = 0.1, 0.15
"""Tilt, and share of the height, up to which the iterations reach a pose from the seed anyway."""

MOST_OTHERS, MUCH_BETTER = 3, 0.5
"""Frames to begin with where the first leads nowhere; share of its misfit that makes them count."""

NO_GROUND = LeftOut(
    LeftOutCause.NO_GROUND, "its ray does not meet the ground in front of the camera"
)
NOT_JOINED = LeftOut(
    LeftOutCause.NOT_JOINED,
    "its frame has neither telemetry, nor three known lengths, nor four points in common with "
    "the frames that do, picked where one camera could see them",
)


def first_values(survey: Survey) -> list[FirstValues]:
    """Sets of first values, most likely first; picks they leave without a place are NaN."""
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    if survey.telemetry is not None:
        return [from_telemetry(each, ray) for each in _with_seeds(survey)]
    counts = lines_per_frame(survey)
    candidates = _plausible(length_poses(survey), counts)
    planes = {f: found.plane for f, found in candidates.items()}
    if survey.gauge == "world":
        return [_over_control(survey, ray, planes, poses) for poses in _choices(survey)]
    if not planes:
        raise GeometryError(
            "without a flight log a pose needs three known lengths that one frame sees whole "
            f"(most here: {counts.max()} in {survey.frame_id[int(counts.argmax())]!r}): pick both "
            "ends of more lines in one frame, tape a fourth, or give the log"
        )
    first = max(planes, key=lambda f: (counts[f], -f))
    networks = _networks(survey, ray, planes, first)
    least = min(network.misfit for network in networks)
    if least > POOR:
        # Its lengths may be explained by a false pose alone: another frame's say otherwise.
        rest = sorted(planes.keys() - {first}, key=lambda f: (-counts[f], f))[:MOST_OTHERS]
        others = [one for f in rest for one in _networks(survey, ray, planes, f)]
        best = min(others, key=lambda network: network.misfit, default=None)
        if best is not None and best.misfit < MUCH_BETTER * least:
            networks.insert(0, best)
    return [_at_gauge(network) for network in networks]


def _networks(
    survey: Survey, ray: Floats, planes: dict[int, Floats], first: int
) -> list[PlaneNetwork]:
    """All frames joined to one, for each plane (n, 3) that explains the lengths of that one.

    Parameters
    ----------
    survey
        Without telemetry.
    ray
        (P, 3) of its picks.
    planes
        Of every frame that has some, likeliest first.
    first
        The frame to begin with.
    """
    networks = []
    for plane in planes[first]:
        network = PlaneNetwork(survey, ray)
        network.start(first, plane)
        network.grow(planes)
        networks.append(network)
    return networks


def _plausible(candidates: dict[int, LengthPoses], counts: Ints) -> dict[int, LengthPoses]:
    """Frames whose lengths agree with each other; all of them where none do."""
    kept = {
        f: found
        for f, found in candidates.items()
        if found.cost[0] <= float(chdtri(max(counts[f] - 3, 1), OUTSIDE))
    }
    return kept or candidates


def _with_seeds(survey: Survey) -> list[Survey]:
    """The survey with its seeds; and, where lengths say otherwise, with seeds that fit them.

    Lengths have a say in a frame that shows three or more whole and whose pose they determine: of
    the poses that explain them, those that the telemetry allows. Where such a pose and the seed
    together lie near the seed, the iterations find them by themselves. Where they lie far away, or
    apart, each is a start of its own: for the frame with most lines; the others take the best of
    theirs.
    """
    assert survey.seeds is not None  # noqa: S101  (the caller asked)
    seeds, ground = survey.seeds, survey.ground
    allowed_planes: dict[int, Floats] = {}
    for frame, poses in length_poses(survey).items():
        center = seeds.center_world_m[frame]
        seed = (center, seeds.world_from_camera[frame], seeds.covariance[frame], ground)
        known = poses.take(np.flatnonzero(poses.converged))
        compared = compare_with_seed(*seed, known)
        order = np.argsort(known.cost + compared.squared_distance, kind="stable")
        order = order[allowed(compared.squared_distance[order])]
        inside, shift = known.take(order), compared.shift[order]
        # From the seed, and from the likeliest of several.
        height, *tilt = np.concatenate([shift, shift - shift[:1]]).T
        above = center[2] - ground.height_m
        if (np.hypot(*tilt) > FAR_RAD).any() or (np.abs(height) > FAR_HEIGHT * above).any():
            allowed_planes[frame] = inside.plane
    if not allowed_planes:
        return [survey]
    counts = lines_per_frame(survey)
    first = max(allowed_planes, key=lambda f: (counts[f], -f))
    best = {frame: planes[0] for frame, planes in allowed_planes.items()}
    return [
        survey,
        *(_reseeded(survey, best | {first: plane}) for plane in allowed_planes[first]),
    ]


def _reseeded(survey: Survey, planes: dict[int, Floats]) -> Survey:
    """The survey with the seeds of some frames moved to the height and level of their planes."""
    assert survey.seeds is not None  # noqa: S101  (the caller asked)
    center = np.array(survey.seeds.center_world_m)
    rotation = np.array(survey.seeds.world_from_camera)
    for frame, plane in planes.items():
        center[frame], rotation[frame] = seed_on_plane(
            center[frame], rotation[frame], survey.ground, plane
        )
    seeds = replace(survey.seeds, center_world_m=center, world_from_camera=rotation)
    return replace(survey, seeds=seeds)


Chosen = dict[int, tuple[Floats, Floats]]
"""Centre and rotation of some frames."""

MOST_CHOICES = 8
"""Starts from candidate poses: an adjustment each."""


def _choices(survey: Survey) -> list[Chosen]:
    """Every frame's best candidate pose; then with one frame's next best, nearest rival first."""
    frame_at = {name: k for k, name in enumerate(survey.frame_id)}
    candidates = [
        (frame_at[c.frame_id], c) for c in survey.candidate_poses if c.frame_id in frame_at
    ]
    best = {f: (c.center_world_m[0], c.world_from_camera[0]) for f, c in candidates}
    rivals = [
        (c.misfit[k] - c.misfit[0], f, (c.center_world_m[k], c.world_from_camera[k]))
        for f, c in candidates
        for k in range(1, len(c.misfit))
    ]
    rivals.sort(key=lambda rival: rival[:2])
    return [best, *(best | {f: pose} for _, f, pose in rivals[: MOST_CHOICES - 1])]


def _over_control(
    survey: Survey, ray: Floats, planes: dict[int, Floats], poses: Chosen
) -> FirstValues:
    """First values over control points; their heights above the label's own give the plane's."""
    label = survey.control_label
    height = float(np.mean(survey.control_world_m[:, 2] - survey.height_above_m[label]))
    network = PlaneNetwork(survey, ray)
    network.point[label] = survey.control_world_m[:, :2]
    for frame, (center, rotation) in poses.items():
        network.place(frame, center - [0.0, 0.0, height], rotation)
    network.grow(planes)
    if np.isnan(network.center).all():
        raise GeometryError(
            "without a flight log a pose needs four control points in one frame, or two and three "
            "known lengths: pick more of them, or give the log"
        )
    center = network.center + np.array([0.0, 0.0, height])
    return FirstValues(network.point, center, network.rotation, height)


def _at_gauge(network: PlaneNetwork) -> FirstValues:
    """The network turned and shifted so that its first frame meets the gauge's conditions."""
    placed = int(np.flatnonzero(np.isfinite(network.center[:, 0]))[0])
    image_up = -network.rotation[placed][:2, 1]
    size = np.linalg.norm(image_up)
    north = image_up / size if size > 0 else np.array([0.0, 1.0])
    center = network.center[placed, :2]
    turn, shift = align_in_plane(
        np.stack([center, center + north]), np.array([[0.0, 0.0], [0.0, 1.0]])
    )
    return FirstValues(
        network.point @ turn[:2, :2].T + shift[:2],
        network.center @ turn.T + shift,
        turn @ network.rotation,
        0.0,
    )


def unusable(survey: Survey, values: FirstValues) -> dict[int, LeftOut]:
    """Picks without first values in front of their camera, and why."""
    frame, label = survey.pick_frame, survey.pick_label
    up = np.full(len(label), values.height_m) + survey.height_above_m[label]
    world = np.column_stack([values.point_m[label], up])
    depth = np.einsum("ni,ni->n", world - values.center[frame], values.rotation[frame][:, :, 2])
    placed = np.isfinite(values.center[frame, 0])
    usable = placed & (np.nan_to_num(depth, nan=-1.0) > 0)
    return {int(i): NO_GROUND if placed[i] else NOT_JOINED for i in np.flatnonzero(~usable)}

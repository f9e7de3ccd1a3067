"""Estimate headings and tilts that the photos' poses do not state, from common points.

The iterations cannot correct a heading that is wrong by half a turn; so the seeds are rotated
before the adjustment to the agreement of common points, positions and known points. Their
uncertainty is kept: these are first values, and the adjustment decides.

A photo of known tilt gives a plan of its points, up to a rotation about the vertical and a shift.
Photos are placed one by one. For each, all headings of a full circle are tried, and the one is
taken at which its points agree with those already placed and its position with the stated one. The
search is repeated from many headings of the first photo, because only the positions determine the
heading of the whole group.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.tied.bundle import compute_tied_rays, fit_to_positions
from uavgram.estimation.first_poses.tied.tied_poses import estimate_tied_poses
from uavgram.geometry.camera.projection import back_project
from uavgram.geometry.ground.plane import intersect_ground
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.naming import format_count
from uavgram.model.survey import Survey

START_COUNT = 18
"""Number of initial headings of a group of photos: close enough that the right one keeps the others
in place."""

HEADING_COUNT = 48
"""Number of headings that are tried for each photo; the best is then refined."""

KEPT_COUNT = 3
"""Number of initial headings that are continued to the end: those that fit best so far."""

SWEEPS = 3
"""Number of times that each photo is placed again among all others."""

ROBUST_SIGMAS = 3.0
"""Distance in sigmas above which the weight of a pick falls (Cauchy), because labels may be
wrong."""


class PlanPoints(NamedTuple):
    """Points of the ground in plan, as the photos show them.

    Attributes
    ----------
    frame, label
        (P,) of each pick.
    offset_m
        (P, 2) east and north from the photo's position, at its present heading.
    sigma_m
        (P,) sigma of each offset, without errors that move all points of a photo alike.
    center_m
        (F, 2) positions of the photos.
    center_sigma_m
        (F,) sigma of each, including errors that move all points of a photo alike.
    turn_sigma_rad
        (F,) sigma of the present heading; infinite: unknown.
    anchor_m
        (K, 2) known points; NaN for others.
    """

    frame: Ints
    label: Ints
    offset_m: Floats
    sigma_m: Floats
    center_m: Floats
    center_sigma_m: Floats
    turn_sigma_rad: Floats
    anchor_m: Floats


def search_headings(plan: PlanPoints, free: Bools) -> Floats:
    """Search turns (F,) about up [rad] by which the photos' plans agree; 0 if undetermined.

    Parameters
    ----------
    plan
        Plans of the photos.
    free
        (F,) mask of the photos with unknown heading; the others do not move.
    """
    turns = np.zeros(len(free))
    for frames in _find_groups(plan):
        if not free[frames].any():
            continue
        anchored = not free[frames].all() or _has_anchor(plan, frames)
        if len(frames) == 1 and not anchored:
            continue
        found = _find_best_layout(plan, free, frames, anchored=anchored)
        turns[frames] = found[frames]
    return np.asarray((turns + np.pi) % (2 * np.pi) - np.pi)


def _find_groups(plan: PlanPoints) -> list[Ints]:
    """Return groups of photos that are connected by common points."""
    group = np.arange(len(plan.center_m))
    while True:
        of_label = np.full(len(plan.anchor_m), len(group))
        np.minimum.at(of_label, plan.label, group[plan.frame])
        new = group.copy()
        np.minimum.at(new, plan.frame, of_label[plan.label])
        if (new == group).all():
            seen = np.unique(plan.frame)
            return [seen[group[seen] == k] for k in np.unique(group[seen])]
        group = new


def _has_anchor(plan: PlanPoints, frames: Ints) -> bool:
    mine = np.isin(plan.frame, frames)
    return bool(np.isfinite(plan.anchor_m[plan.label[mine], 0]).any())


def _find_best_layout(plan: PlanPoints, free: Bools, frames: Ints, *, anchored: bool) -> Floats:
    """Return the turns (F,) of the layout that fits best."""
    starts: list[tuple[int, float] | None] = [None]
    if not anchored:
        first = int(frames[np.argmax(np.bincount(plan.frame, minlength=len(free))[frames])])
        starts = [(first, 2 * np.pi * k / START_COUNT) for k in range(START_COUNT)]
    laid = [_place_group(plan, free, frames, start) for start in starts]
    laid.sort(key=lambda each: each[0])
    moving = [int(f) for f in frames if free[f]]
    swept = []
    for cost, laying in laid[:KEPT_COUNT]:
        for _ in range(SWEEPS):
            cost = sum(laying.settle(frame) for frame in moving)  # noqa: PLW2901
        swept.append((cost, laying.turn))
    return min(swept, key=lambda each: each[0])[1]


def _place_group(
    plan: PlanPoints, free: Bools, frames: Ints, start: tuple[int, float] | None
) -> tuple[float, _Layout]:
    """Place a group from a first photo's turn, or from known photos; also return its cost."""
    laying = _Layout.begun(plan)
    if start is None:
        for frame in frames[~free[frames]]:
            laying.put(int(frame), 0.0, np.zeros(2))
    else:
        laying.put(*start, np.zeros(2))
    waiting = [int(f) for f in frames if not laying.there[f]]
    cost = 0.0
    while waiting:
        frame = max(waiting, key=laying.heading_information)
        cost += laying.settle(frame)
        waiting.remove(frame)
    return cost, laying


@dataclass(eq=False)
class _Layout:
    """Photos placed so far, and positions of their points (`total` over `weight`, by label)."""

    plan: PlanPoints
    picks: list[Ints]
    turn: Floats
    shift: Floats
    there: Bools
    total: Floats
    weight: Floats

    @classmethod
    def begun(cls, plan: PlanPoints) -> _Layout:
        order = np.argsort(plan.frame, kind="stable")
        bounds = np.searchsorted(plan.frame[order], np.arange(len(plan.center_m) + 1))
        picks = [order[bounds[f] : bounds[f + 1]] for f in range(len(plan.center_m))]
        known = np.isfinite(plan.anchor_m[:, 0])
        weight = np.where(known, 1.0, 0.0)
        total = np.where(known[:, None], plan.anchor_m, 0.0)
        count = len(plan.center_m)
        none = np.zeros(count, dtype=np.bool_)
        return cls(plan, picks, np.zeros(count), np.zeros((count, 2)), none, total, weight)

    def heading_information(self, frame: int) -> float:
        """Compute the information of the points already placed on a photo's heading."""
        picks = self.picks[frame]
        weight = np.where(self.weight[self.plan.label[picks]] > 0, 1.0, 0.0)
        weight /= self.plan.sigma_m[picks] ** 2
        offset = self.plan.offset_m[picks]
        size = weight.sum()
        if not size > 0:
            return -1.0
        mean = weight @ offset / size
        own = 1.0 / (1.0 / size + self.plan.center_sigma_m[frame] ** 2)
        return float(weight @ np.sum((offset - mean) ** 2, axis=1) + own * (mean @ mean))

    def put(self, frame: int, turn: float, shift: Floats) -> None:
        """Place a photo; its points move with it."""
        self._weigh(frame, -1.0)
        self.turn[frame], self.shift[frame], self.there[frame] = turn, shift, True
        self._weigh(frame, 1.0)

    def _weigh(self, frame: int, sign: float) -> None:
        if not self.there[frame]:
            return
        picks = self.picks[frame]
        weight = sign / self.plan.sigma_m[picks] ** 2
        label = self.plan.label[picks]
        place = self.plan.center_m[frame] + self.shift[frame]
        place = place + self.plan.offset_m[picks] @ _rotation(np.array([self.turn[frame]]))[0].T
        np.add.at(self.total, label, weight[:, None] * place)
        np.add.at(self.weight, label, weight)

    def settle(self, frame: int) -> float:
        """Place a photo where it fits best among the others, and return its cost there."""
        self._weigh(frame, -1.0)
        self.there[frame] = False
        around = 2 * np.pi * np.arange(HEADING_COUNT) / HEADING_COUNT
        cost, _ = self._costs(frame, around)
        best = around[int(cost.argmin())]
        near = best + np.linspace(-1.0, 1.0, 17) * 2 * np.pi / HEADING_COUNT
        cost, shift = self._costs(frame, near)
        k = int(cost.argmin())
        self.put(frame, float(near[k]), shift[k])
        return float(cost[k])

    def _costs(self, frame: int, turn: Floats) -> tuple[Floats, Floats]:
        """Compute costs (T,) of a photo at some turns, and the best shifts (T, 2) there."""
        plan, picks = self.plan, self.picks[frame]
        label = plan.label[picks]
        met = self.weight[label] > 1e-9
        picks, label = picks[met], label[met]
        sigma = plan.turn_sigma_rad[frame]
        prior = (((turn + np.pi) % (2 * np.pi) - np.pi) / sigma) ** 2
        if not len(picks):
            return prior, np.zeros((len(turn), 2))
        target = self.total[label] / self.weight[label][:, None] - plan.center_m[frame]
        place = np.einsum("tij,pj->tpi", _rotation(turn), plan.offset_m[picks])
        off = place - target
        weight = 1.0 / (plan.sigma_m[picks] ** 2 + 1.0 / self.weight[label])
        own = 1.0 / (2.0 * plan.center_sigma_m[frame] ** 2)
        robust = np.ones(off.shape[:2])
        # Robust shift by reweighted least squares, with the position's sigma as prior.
        for _ in range(3):
            total = weight * robust
            shift = -np.einsum("tp,tpi->ti", total, off) / (total.sum(axis=1) + own)[:, None]
            squared = weight * np.sum((off + shift[:, None]) ** 2, axis=2)
            robust = 1.0 / (1.0 + squared / ROBUST_SIGMAS**2)
        cost = ROBUST_SIGMAS**2 * np.log1p(squared / ROBUST_SIGMAS**2).sum(axis=1)
        return cost + own * np.sum(shift**2, axis=1) + prior, shift


def _rotation(angle: Floats) -> Floats:
    """Return (T, 2, 2) rotations about up."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], -2)


MAX_MISFIT_SIGMAS = 4.0
"""Largest misfit of tied poses to the positions, in sigmas (root mean square)."""


def find_attitudes_by_ties(survey: Survey) -> Floats | None:
    """Return world from camera (F, 3, 3) by ties; NaN for untied frames; None if undetermined.

    Poses from ties alone, transformed onto the positions of the seeds.
    """
    seeds = survey.seeds
    if seeds is None or not survey.ties.points + survey.matches.points:
        return None
    found = estimate_tied_poses(compute_tied_rays(survey)[0])
    if found is None:
        return None
    placed = fit_to_positions(found, seeds.center_world_m, found.placed)
    if placed is None:
        return None
    off = (placed.center - seeds.center_world_m)[placed.placed]
    variance = np.einsum("fii->fi", seeds.covariance)[placed.placed, :3]
    fits = np.mean(off**2 / variance) <= MAX_MISFIT_SIGMAS**2
    return placed.rotation if fits else None


def measure_turns(rotation: Floats, seed: Floats) -> Floats:
    """Compute rotations (F,) about up between attitudes (F, 3, 3) and others; NaN where missing."""
    turn = rotation @ seed.transpose(0, 2, 1)
    return np.asarray(np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1]))


def measure_tilts(rotation: Floats, seed: Floats) -> Floats:
    """Compute angles (F,) between the ups of attitudes (F, 3, 3) and others; NaN where missing."""
    cosine = np.einsum("fi,fi->f", rotation[:, 2], seed[:, 2])
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


def add_attitudes(survey: Survey, rotation: Floats, which: Bools) -> Survey:
    """Replace attitudes of some photos, as first values of unknown attitudes.

    Parameters
    ----------
    survey
        Survey whose seeds are the photos' own.
    rotation
        (F, 3, 3) world from camera.
    which
        (F,) mask of the photos; the others are unchanged.
    """
    seeds, prior, track = survey.seeds, survey.telemetry, survey.track
    assert seeds is not None  # noqa: S101  (the photos have poses)
    assert prior is not None  # noqa: S101  (it comes with the seeds)
    assert isinstance(track, PhotoExposures)  # noqa: S101  (a log states attitudes)
    turned = np.where(which[:, None, None], rotation, seeds.world_from_camera)
    turn = turned @ seeds.world_from_camera.transpose(0, 2, 1)
    # The attitude's error is in camera axes, which rotate.
    axes = np.tile(np.eye(6), (len(which), 1, 1))
    axes[:, 3:, 3:] = turned.transpose(0, 2, 1) @ seeds.world_from_camera
    unknown = np.zeros((len(which), 6, 6))
    unknown[:, 3:, 3:] = np.pi**2 * which[:, None, None] * np.eye(3)
    marginal = axes @ seeds.covariance @ axes.transpose(0, 2, 1) + unknown
    of_prior = axes[prior.frame_index]
    own = of_prior @ prior.covariance @ of_prior.transpose(0, 2, 1) + unknown[prior.frame_index]
    row = track.rows_of(survey.frame_id)
    gimbal = track.world_from_gimbal.copy()
    gimbal[row] = turn @ gimbal[row]
    return replace(
        survey,
        seeds=replace(seeds, world_from_camera=turned, covariance=marginal),
        telemetry=replace(prior, covariance=own),
        track=replace(track, world_from_gimbal=gimbal),
    )


UNKNOWN_RAD = 1.0
"""Sigma of a heading [rad] above which it counts as unknown."""

CONTRADICTION_SIGMAS = 4.0
"""Sigmas by which the points must contradict a heading before it counts as unknown."""

MIN_SINE_BELOW_HORIZON = np.sin(np.radians(5.0))
"""Sine of the angle below the horizon under which a ray's place on the ground is unusable."""


def find_headings(survey: Survey) -> tuple[Survey, tuple[Message, ...]]:
    """Rotate the seeds to the headings that ties, or else picks, determine.

    For photos without a stated attitude, and those whose stated heading is nearly unknown. Where
    ties show that a photo without a stated attitude looks in a very different direction than the
    assumed mount, its tilt is taken from them, too. Surveys with a log, or whose photos all state
    their attitudes, are unchanged.

    Parameters
    ----------
    survey
        All observations.

    Returns
    -------
    survey
        Seeds, and the photos' own poses, rotated about the vertical, or entirely.
    messages
        Photos whose nose the picks contradict: their heading counts as unknown. Also those whose
        tilt the ties contradict: their attitude counts as unknown.
    """
    track = survey.track
    if survey.seeds is None or not isinstance(track, PhotoExposures):
        return survey, ()
    row = track.rows_of(survey.frame_id)
    sigma = track.sigma_attitude_rad[row, 1]
    free = track.by_mount[row] | (sigma > UNKNOWN_RAD)
    if not free.any():
        return survey, ()
    turn = search_headings(_plan(survey, track.sigma_attitude_rad[row, 0], sigma), free)
    tied = find_attitudes_by_ties(survey)
    if tied is not None:
        by_ties = measure_turns(tied, survey.seeds.world_from_camera)
        turn = np.where(free & np.isfinite(by_ties), by_ties, turn)
    doubted = free & (sigma <= UNKNOWN_RAD) & (np.abs(turn) > CONTRADICTION_SIGMAS * sigma)
    survey_turned = _rotate_headings(survey, track, turn, doubted)
    messages = tuple(_messages(survey, turn, doubted))
    if tied is None:
        return survey_turned, messages
    off = measure_tilts(tied, survey.seeds.world_from_camera)
    limit = CONTRADICTION_SIGMAS * track.sigma_attitude_rad[row, 0]
    tilted = track.by_mount[row] & (np.nan_to_num(off) > limit)
    if not tilted.any():
        return survey_turned, messages
    return add_attitudes(survey_turned, tied, tilted), (
        *messages,
        _tilt_message(survey, off, tilted),
    )


def _plan(survey: Survey, tilt_sigma: Floats, turn_sigma: Floats) -> PlanPoints:
    """Project the picks to the ground at the seeds, with sigmas."""
    seeds = survey.seeds
    assert seeds is not None  # noqa: S101  (the caller asked)
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    frame, label = survey.pick_frame, survey.pick_label
    direction = np.einsum("pij,pj->pi", seeds.world_from_camera[frame], ray)
    height = survey.ground.height_m
    ground = intersect_ground(
        seeds.center_world_m[frame],
        direction,
        np.array([height, 0.0, 0.0]),
        np.zeros(2),
        survey.height_above_m[label],
    )
    offset = ground[:, :2] - seeds.center_world_m[frame, :2]
    down = -direction[:, 2] / np.linalg.norm(direction, axis=1)
    usable = (
        np.isfinite(offset).all(axis=1) & (down > MIN_SINE_BELOW_HORIZON) & ~survey.is_free[label]
    )
    above = np.maximum(seeds.center_world_m[:, 2] - height, 1.0)
    variance = np.einsum("fii->fi", seeds.covariance)
    rise = np.sqrt(variance[:, 2] + survey.ground.height_sigma_m**2) / above
    # A tilt moves points below the camera by h, all alike; points far out by h / sin^2.
    frame, label, offset, down = frame[usable], label[usable], offset[usable], down[usable]
    beyond = above[frame] * (1.0 / down**2 - 1.0) * tilt_sigma[frame]
    rough = survey.ground.roughness_sigma_m / down
    stretched = rise[frame] * np.linalg.norm(offset, axis=1)
    anchor = np.full((len(survey.label), 2), np.nan)
    anchor[survey.control_label] = survey.control_world_m[:, :2]
    return PlanPoints(
        frame=frame,
        label=label,
        offset_m=offset,
        sigma_m=np.sqrt(beyond**2 + stretched**2 + rough**2 + (0.01 * above[frame]) ** 2),
        center_m=seeds.center_world_m[:, :2],
        center_sigma_m=np.sqrt(variance[:, 0] + (above * tilt_sigma) ** 2),
        turn_sigma_rad=np.where(turn_sigma > UNKNOWN_RAD, np.inf, turn_sigma),
        anchor_m=anchor,
    )


def _rotate_headings(survey: Survey, track: PhotoExposures, turn: Floats, doubted: Bools) -> Survey:
    """Rotate seeds and exposures about up; a contradicted heading gets the sigma of an unknown one.

    The sigmas of a photo's attitude are those of its tilt and its yaw, and all horizontal axes of
    its position have the same sigma: a rotation about up changes no covariance in the camera's
    axes.
    """
    seeds, prior = survey.seeds, survey.telemetry
    assert seeds is not None  # noqa: S101  (the caller asked)
    assert prior is not None  # noqa: S101  (it comes with the seeds)
    zero = np.zeros_like(turn)
    about_up = matrix_from_ypr(turn, zero, zero)
    rotation = about_up @ seeds.world_from_camera
    of_frame = {name: k for k, name in enumerate(survey.frame_id)}
    place = np.array([of_frame.get(name, -1) for name in track.frame_id], dtype=np.int64)
    all_turns = np.where((place >= 0)[:, None, None], about_up[place], np.eye(3))
    up = rotation[:, 2, :]  # the world's up in the camera's axes
    more = np.where(doubted, np.pi**2, 0.0)[:, None, None] * up[:, :, None] * up[:, None, :]
    marginal, own = seeds.covariance.copy(), prior.covariance.copy()
    marginal[:, 3:, 3:] += more
    own[:, 3:, 3:] += more[prior.frame_index]
    return replace(
        survey,
        seeds=replace(seeds, world_from_camera=rotation, covariance=marginal),
        telemetry=replace(prior, covariance=own),
        track=replace(
            track,
            world_from_body=all_turns @ track.world_from_body,
            world_from_gimbal=all_turns @ track.world_from_gimbal,
        ),
    )


def _messages(survey: Survey, turn: Floats, doubted: Bools) -> Iterator[Message]:
    names = [
        f"{survey.frame_id[k]} ({abs(np.degrees(turn[k])):.0f} degrees)"
        for k in np.flatnonzero(doubted)
    ]
    if not names:
        return
    text = (
        "The picks contradict the heading of the drone in the tags of "
        f"{format_count(len(names), 'photo')}: {', '.join(names)}. Their heading was taken as "
        f"unknown "
        "and found from the picks."
    )
    frames = tuple(survey.frame_id[k] for k in np.flatnonzero(doubted))
    yield Message("info", "course-contradicted", text, frames=frames)


def _tilt_message(survey: Survey, off_rad: Floats, tilted: Bools) -> Message:
    frames = tuple(survey.frame_id[k] for k in np.flatnonzero(tilted))
    typical = np.degrees(np.median(off_rad[tilted]))
    text = (
        f"{len(frames)} photos that state no attitude do not look in the direction of `mount`: the "
        f"tie points between them show them tilted by {typical:.0f} degrees from it, and this tilt "
        "is used. If you know how the camera was tilted, set mount.pitch_deg, or give yaw_deg, "
        "pitch_deg and roll_deg in a CSV file (`poses`)."
    )
    return Message("info", "attitude-by-ties", text, frames=frames)

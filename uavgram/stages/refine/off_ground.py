"""Detect labels off the ground, and the roughness of the ground, from matches and ties.

Matches and ties in several photos determine a point in space to about a centimetre. If a point of a
roof or a kerb were taken for a point of the ground plane, it would distort all observations that
are connected with it. Therefore, before matches are used as points of the ground:

* labels off the ground are detected;
* the roughness of the ground is estimated from the other matches, or from ties alone. Without it,
  the photos would be bent until labels on uneven ground are in a plane.

One photo does not determine a height. If several points in two or more photos are off the ground,
points in one photo only may be off it with the same frequency and by as much.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import expit, logit

from uavgram.estimation.first_poses.first_values import find_seen_labels
from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import (
    Adjustment,
    Placed,
    Refined,
    compute_heights,
    compute_relative_covariance,
)
from uavgram.geometry.ground.plane import fit_robust_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import (
    FREE_HEIGHT,
    Message,
    MessagePlural,
    propose_free_heights,
    propose_pick_removal,
)
from uavgram.model.survey import Survey
from uavgram.stages.refine.readjustment import readjust

MAX_UNEVENNESS_M = 0.05
"""Allowed distance of ground points from their plane while the plane is fitted [m]."""

MIN_OFF_GROUND_M = 0.25
"""Height [m] above which a point is off the ground, even if the ground is smooth."""

OFF_GROUND_SIGMAS = 4.0
"""Height above which a point is off the ground, in sigmas of the unevenness and of the height."""

MIN_CHAINS = 6
"""Least number of chains on the ground that show its roughness without the ties."""

MIN_ROUGHNESS_M = 0.003
"""Roughness below which a ground counts as plane [m]."""

SIGNIFICANCE = 0.001
"""Probability of such heights on a plane above which the ground counts as one."""

SAME_GROUND_RADIUS = 1.25
"""Radius about the middle of the labels within which ties count as the same ground, in units of the
labels' own radius."""

MEDIAN_SIGMAS = 0.6745
"""Median of the absolute value of a normal variable, in sigmas."""


@dataclass(frozen=True, eq=False)
class GroundEvidence:
    """Properties of the ground that matches show.

    Attributes
    ----------
    off_ground
        Names of labels off the ground.
    roughness_m, probability
        Roughness by index of the area: distance of its points from its plane, where it is
        significant; and the probability of that by chance.
    """

    off_ground: frozenset[str] = frozenset()
    roughness_m: Mapping[int, float] = field(default_factory=dict)
    probability: Mapping[int, float] = field(default_factory=dict)


def find_off_ground_labels(adjustment: Adjustment) -> GroundEvidence:
    """Find labels off the ground, and the roughness of each area.

    The area of a tie is unknown: with several areas, only chains are used.

    Parameters
    ----------
    adjustment
        Adjustment with chains and ties anywhere in space: see `tie_outliers.py`.
    """
    survey, ties = adjustment.survey, adjustment.survey.ties
    chains = np.flatnonzero(ties.pick >= 0)
    chains = chains[~survey.off_ground[survey.pick_label[ties.pick[chains]]]]
    lone = _ties_near_labels(adjustment) if len(survey.grounds) == 1 else chains[:0]
    if not len(chains) + len(lone):
        return GroundEvidence()
    world, sigma = _points_in_space(adjustment)
    label = survey.pick_label[ties.pick[chains]]
    off, roughness, probability = set[str](), dict[int, float](), dict[int, float]()
    for area in range(len(survey.grounds)):
        own = chains[survey.area[label] == area]
        points = np.concatenate([own, lone])
        if not len(points):
            continue
        departure = _heights_over_plane(world[points], sigma[points])
        if departure is None:
            continue
        # A label off the ground is reported with its height; among many ties on the ground, a low
        # object such as a bush or a car's bonnet is detectable.
        least = np.where(ties.pick[points] >= 0, MIN_OFF_GROUND_M, 0.0)
        stands = _is_off_ground(departure, sigma[points], least)
        named = survey.pick_label[ties.pick[own[stands[: len(own)]]]]
        off |= {survey.label[k] for k in named}
        level = ~stands
        if level[: len(own)].sum() >= MIN_CHAINS:
            level[len(own) :] = False
        level &= sigma[points] <= MIN_OFF_GROUND_M  # otherwise an error of matching is a hill
        size, chance = _roughness(departure[level], sigma[points][level])
        if size > survey.grounds[area].roughness_sigma_m:
            roughness[area], probability[area] = size, chance
    return GroundEvidence(frozenset(off), roughness, probability)


def apply_ground_evidence(survey: Survey, shown: GroundEvidence) -> Survey:
    """Free the heights of labels off the ground, and set the roughness of the rest.

    Parameters
    ----------
    survey
        All observations.
    shown
        Properties of the ground that its matches show.
    """
    grounds = tuple(
        replace(ground, roughness_sigma_m=shown.roughness_m.get(k, ground.roughness_sigma_m))
        for k, ground in enumerate(survey.grounds)
    )
    free = survey.is_free | np.isin(survey.label, sorted(shown.off_ground))
    return replace(survey, grounds=grounds, is_free=free)


def _ties_near_labels(adjustment: Adjustment) -> Ints:
    """Return ties without a pick within the radius of the labels on the ground.

    Objects further out, such as a bank or a meadow, are not the measured ground.
    """
    survey, tie = adjustment.survey, adjustment.state.tie[:, :2]
    label = adjustment.state.point[~survey.off_ground, :2]
    lone = np.flatnonzero(survey.ties.pick < 0)
    if not len(label):
        return lone[:0]
    middle = label.mean(axis=0)
    reach = float(np.linalg.norm(label - middle, axis=1).max())
    near = np.linalg.norm(tie[lone] - middle, axis=1) <= SAME_GROUND_RADIUS * reach
    return np.asarray(lone[near])


def _points_in_space(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Return all chains and ties (T, 3), and the sigmas (T,) of their heights within the survey."""
    world = adjustment.state.tie
    every = np.arange(len(world))
    columns = adjustment.problem.layout.tie_columns(every)
    gradient = np.broadcast_to(np.eye(3), (len(world), 3, 3))
    own = adjustment.covariance.blocks(columns)
    inner = compute_relative_covariance(
        adjustment.minimum.factor, Placed(world, gradient, columns), every, own
    )
    return world, np.sqrt(np.maximum(inner[:, 2, 2], 0.0))


def _heights_over_plane(world_m: Floats, sigma_m: Floats) -> Floats | None:
    """Compute heights (n,) over the plane of most points (n, 3); None where there is none."""
    height = world_m[:, 2]
    plane = fit_robust_plane(world_m[:, :2], height, np.hypot(sigma_m, MAX_UNEVENNESS_M))
    return None if plane is None else height - plane


def _is_off_ground(departure_m: Floats, sigma_m: Floats, least_m: Floats) -> Bools:
    """Mark points (n,) too high or too low for this ground, by at least a height (n,)."""
    near = np.abs(departure_m) < np.maximum(MIN_OFF_GROUND_M, OFF_GROUND_SIGMAS * sigma_m)
    spread = float(np.median(np.abs(departure_m[near])) / MEDIAN_SIGMAS) if near.any() else 0.0
    limit = np.maximum(least_m, OFF_GROUND_SIGMAS * np.hypot(spread, sigma_m))
    return np.asarray(np.abs(departure_m) > limit)


def _roughness(departure_m: Floats, sigma_m: Floats) -> tuple[float, float]:
    """Estimate the distance of ground points from their plane, and its probability by chance.

    The likeliest variance in addition to that of the heights, by Newton's steps (a variance
    component; see estimation/reliability/variance_components.py). Zero where the ground counts as
    plane.
    """
    if len(departure_m) < MIN_CHAINS:
        return 0.0, 1.0
    degrees = max(len(departure_m) - 3, 1)  # about their plane
    chance = compute_upper_tail(float(np.sum((departure_m / sigma_m) ** 2)), float(degrees))
    variance = max(float(np.var(departure_m)) - float(np.median(sigma_m**2)), MIN_ROUGHNESS_M**2)
    for _ in range(20):
        # Fisher scoring: variance += sum(w^2 d^2 - w) / sum(w^2).
        weight = 1.0 / (variance + sigma_m**2)
        fisher = float(np.sum(weight**2))
        variance += float(np.sum(weight**2 * departure_m**2) - np.sum(weight)) / fisher
        variance = max(variance, 1e-8)
    size = float(np.sqrt(variance))
    return (size, chance) if size > MIN_ROUGHNESS_M and chance < SIGNIFICANCE else (0.0, 1.0)


def count_photos(survey: Survey) -> Ints:
    """Count the photos (K,) that show each label, as a pick or as a match."""
    return np.bincount(find_seen_labels(survey)[1], minlength=len(survey.label))


def set_free_heights(survey: Survey, names: Sequence[str], before: Sequence[str] = ()) -> Survey:
    """Make the heights of labels unknowns.

    Parameters
    ----------
    survey
        The survey before.
    names
        Labels whose heights become unknowns.
    before
        Labels whose heights were unknowns; those that are not among `names` return to the ground.
    """
    free = survey.is_free & ~np.isin(survey.label, list(before))
    return replace(survey, is_free=free | np.isin(survey.label, list(names)))


MIN_OFF_GROUND = 3
"""Least number of points off the ground that are not exceptions: one or two are roof corners."""


def free_unchecked_heights(
    survey: Survey, refined: Refined, found: Collection[str]
) -> tuple[Survey, Refined, tuple[Message, ...]]:
    """Give points that may be off the ground like others uncertain heights, and readjust.

    Parameters
    ----------
    survey
        All observations, with the detected heights free.
    refined
        Its adjustment.
    found
        Labels whose heights were found.
    """
    adjustment, sigma = refined.adjustment, dict[str, float]()
    if len(found) < MIN_OFF_GROUND:
        return survey, refined, ()
    on_ground = np.flatnonzero(~adjustment.survey.off_ground)
    names = [adjustment.survey.label[k] for k in on_ground]
    for _ in range(HEIGHT_ROUNDS):
        size_m = _expect_heights(adjustment, on_ground, found)
        size_m = np.where(size_m > MAX_UNEVENNESS_M, size_m, 0.0)
        sigma = dict(zip(names, size_m.tolist(), strict=True))
        again = _readjust_if_possible(adjustment, _set_height_sigmas(adjustment.survey, sigma))
        if again is None or not any(sigma.values()):
            return survey, refined, ()
        adjustment = again
    unseen = {name: size for name, size in sigma.items() if size > 0.0}
    return (
        _set_height_sigmas(survey, sigma),
        replace(refined, adjustment=adjustment),
        (_unchecked_message(list(unseen), max(unseen.values()), len(found)),),
    )


def _expect_heights(adjustment: Adjustment, on_ground: Ints, found: Collection[str]) -> Floats:
    """Compute root mean squares (n,) of the heights of points taken to be on the ground [m].

    A share of all points is off the ground, with heights like those found; the others depart from
    it by its roughness. The photos show each height more or less exactly, and thus how probable
    either is (Bayes' theorem).

    Parameters
    ----------
    adjustment
        The survey, with points off the ground free.
    on_ground
        (n,) points taken to be on the ground.
    found
        Labels whose heights were found.
    """
    survey, blocks = adjustment.survey, adjustment.minimum.blocks
    height_m, sigma_m = np.zeros(len(survey.label)), np.full(len(survey.label), np.inf)
    third = adjustment.problem.third
    for name, label in (("roughness", third.rough), ("heights", third.stated)):
        if name in blocks:
            # Estimate without the prior, from that with it and the leverage of the prior.
            leverage = adjustment.covariance.leverage(blocks[name])[:, 0]
            shown = np.maximum(1.0 - leverage, MIN_SHOWN)
            height_m[label] = adjustment.state.point[label, 2] / shown
            sigma_m[label] = third.sigma_m[label] * np.sqrt(leverage / shown)
    up_m = adjustment.state.point[adjustment.label_rows(found), 2]
    square = float(np.mean(up_m**2))
    usual = np.array([ground.roughness_sigma_m for ground in survey.grounds])[survey.area]
    # Densities of the shown heights for points off the ground, over those on it; one photo alone
    # shows none, and a ground without roughness is stated to be a plane.
    is_once = count_photos(survey) < UNCHECKED_PHOTOS
    seen = np.isfinite(sigma_m) & ~is_once
    on, off = usual[seen] ** 2 + sigma_m[seen] ** 2, square + sigma_m[seen] ** 2
    log_ratio = np.where(is_once, 0.0, -np.inf)
    log_ratio[seen] = 0.5 * (np.log(on / off) + height_m[seen] ** 2 * (1.0 / on - 1.0 / off))
    probability = np.full(len(on_ground), len(found) / (len(found) + len(on_ground)))
    for _ in range(SHARE_ROUNDS):
        share = (len(found) + probability.sum()) / (len(found) + len(on_ground))
        probability = expit(logit(share) + log_ratio[on_ground])
    return np.asarray(np.sqrt(probability * square))


HEIGHT_ROUNDS, SHARE_ROUNDS = 2, 30
"""Readjustments with uncertain heights; and iterations of the share of points off the ground."""

MIN_SHOWN = 1e-6
"""Least share of a height that photos show, below which it is unknown."""


def _set_height_sigmas(survey: Survey, sigma_m: Mapping[str, float]) -> Survey:
    own = [
        sigma_m.get(k, stated)
        for k, stated in zip(survey.label, survey.height_sigma_m, strict=True)
    ]
    return replace(survey, height_sigma_m=np.array(own))


def _readjust_if_possible(adjustment: Adjustment, survey: Survey) -> Adjustment | None:
    try:
        after = readjust(adjustment, survey)
    except SingularError:
        return None
    return after if after.minimum.converged else None


def _unchecked_message(unseen: list[str], sigma_m: float, found: int) -> Message:
    several = len(unseen) > 1
    what = f"{len(unseen)} points" if several else f"The point {unseen[0]!r}"
    text = (
        f"{what} may be off the ground, as {found} others are: one photo, or photos from nearly "
        f"the same place, do not show {'their heights' if several else 'its height'}. "
        f"{'They are' if several else 'It is'} taken as uncertain by up to {sigma_m:.2f} m. Pick "
        f"{'them' if several else 'it'} in a photo from further aside, or state the "
        f"{'heights' if several else 'height'}."
    )
    return Message("warning", "heights-unseen", text, labels=tuple(unseen))


UNCHECKED_PHOTOS = 2
"""Number of photos that determine the height of a point but leave its picks unchecked."""


MIN_HEIGHT_SIGMAS = 3.0
"""Difference of a height from the ground, or from a stated height, in its sigmas, below which
nothing was found."""


def report_off_ground(refined: Refined) -> Iterator[Message]:
    """Report each label that was adjusted with a free height without a statement.

    A height that may as well be zero is no finding: the point is only less certain.
    """
    survey = refined.adjustment.survey
    height, sigma = compute_heights(refined.adjustment)
    photos = count_photos(survey)
    for row, label in enumerate(survey.label):
        if label in refined.off_ground:
            up, sigma_m, shown = float(height[row]), float(sigma[row]), int(photos[row])
            if abs(up) < MIN_HEIGHT_SIGMAS * sigma_m:
                continue
            message = off_ground_message(label, up, sigma_m, shown)
            if shown != UNCHECKED_PHOTOS:
                yield message
                continue
            picks = np.flatnonzero(survey.pick_label == row)
            frames = [survey.frame_id[frame] for frame in survey.pick_frame[picks]]
            either = (propose_pick_removal([(frame, label)]) for frame in frames)
            yield replace(message, instead=tuple(one for one in either if one is not None))


def off_ground_message(label: str, height_m: float, sigma_m: float, photos: int) -> Message:
    """Report a label that fits at a height.

    Parameters
    ----------
    label
        The point.
    height_m, sigma_m
        Its height above the ground and the sigma of it, in metres.
    photos
        Number of photos that show it.
    """
    side = "above" if height_m > 0 else "below"
    digits = int(np.clip(1 - np.floor(np.log10(max(sigma_m, 1e-4))), 1, 3))
    size = f"{abs(height_m):.{digits}f} ± {sigma_m:.{digits}f} m {side} the ground"
    size_m, rough = abs(height_m), min(digits, 1 if abs(height_m) >= 1.0 else 2)
    other = " (or one of its two picks is on another thing)" if photos == UNCHECKED_PHOTOS else ""
    text = (
        f"{label!r} is {size}{other}. It was adjusted with that height. To confirm it, let its "
        f"height be found from the photos {FREE_HEIGHT}, or enter it."
    )
    several = MessagePlural(
        "{count} points are above or below the ground, and were adjusted with these heights",
        f"{label!r} {abs(height_m):.{digits}f} ± {sigma_m:.{digits}f} m {side}{other}",
        ending=f"To confirm it, let their heights be found from the photos {FREE_HEIGHT}, or enter "
        "them.",
    )
    return Message(
        "warning",
        "point-off-ground",
        text,
        labels=(label,),
        heights_m=(height_m,),
        heights_sigma_m=(sigma_m,),
        several=several,
        plain=f"{label} is {size_m:.{rough}f} m {side} the ground{other}.",
        mend=propose_free_heights([label]),
    )

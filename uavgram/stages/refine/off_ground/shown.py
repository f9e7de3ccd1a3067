"""Detect labels off the ground, and the roughness of the ground, from matches and ties.

A chain of matches determines its point in space to a centimetre, and so do ties. On a plane a roof
would distort all connected observations, and so would a kerb. So before matches are used as points
of the ground, those off the ground are detected, and the ground gets the roughness that the others
show. Ties alone show that roughness as well: otherwise photos that are held by them would be bent
until labels on uneven ground, and the lengths between them, are in a plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from uavgram.estimation.first_poses.first_points import seen_labels
from uavgram.estimation.reliability.redundancy import upper_tail
from uavgram.estimation.survey.adjustment import Adjustment, Placed, within_survey
from uavgram.geometry.ground.plane import fit_robust_plane
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

UNEVEN_M = 0.05
"""Allowed distance of ground points from their plane while the plane is fitted [m]."""

LEAST_OFF_M = 0.25
"""Height [m] above which a point is off the ground, even if the ground is smooth."""

FAR = 4.0
"""Height above which a point is off the ground, in sigmas of the unevenness and of the height."""

FEW = 6
"""Least number of chains on the ground that show its roughness without the ties."""

LEAST_M = 0.003
"""Roughness below which a ground counts as plane [m]."""

BY_CHANCE = 0.001
"""Probability of such heights on a plane above which the ground counts as one."""

BEYOND = 1.25
"""Radius about the middle of the labels within which ties count as the same ground, in units of the
labels' own radius."""

MEDIAN = 0.6745
"""Median of the absolute value of a normal variable, in sigmas."""


@dataclass(frozen=True, eq=False)
class Shown:
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


def shown_by_sightings(adjustment: Adjustment) -> Shown:
    """Find labels off the ground, and the roughness of each area.

    The area of a tie is unknown: with several areas, only chains are used.

    Parameters
    ----------
    adjustment
        Adjustment with chains and ties anywhere in space: see `sound_ties`.
    """
    survey, ties = adjustment.survey, adjustment.survey.ties
    chains = np.flatnonzero(ties.pick >= 0)
    chains = chains[~survey.off_ground[survey.pick_label[ties.pick[chains]]]]
    lone = _about_labels(adjustment) if len(survey.grounds) == 1 else chains[:0]
    if not len(chains) + len(lone):
        return Shown()
    world, sigma = _in_space(adjustment)
    label = survey.pick_label[ties.pick[chains]]
    off, roughness, probability = set[str](), dict[int, float](), dict[int, float]()
    for area in range(len(survey.grounds)):
        own = chains[survey.area[label] == area]
        points = np.concatenate([own, lone])
        if not len(points):
            continue
        departure = _departures(world[points], sigma[points])
        if departure is None:
            continue
        # A label off the ground is reported with its height; among many ties on the ground, a low
        # object such as a bush or a car's bonnet is detectable.
        least = np.where(ties.pick[points] >= 0, LEAST_OFF_M, 0.0)
        stands = _stands_off(departure, sigma[points], least)
        named = survey.pick_label[ties.pick[own[stands[: len(own)]]]]
        off |= {survey.label[k] for k in named}
        level = ~stands
        if level[: len(own)].sum() >= FEW:
            level[len(own) :] = False
        level &= sigma[points] <= LEAST_OFF_M  # otherwise an error of matching is a hill
        size, chance = _roughness(departure[level], sigma[points][level])
        if size > survey.grounds[area].roughness_sigma_m:
            roughness[area], probability[area] = size, chance
    return Shown(frozenset(off), roughness, probability)


def with_shown(survey: Survey, shown: Shown) -> Survey:
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


def _about_labels(adjustment: Adjustment) -> Ints:
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
    near = np.linalg.norm(tie[lone] - middle, axis=1) <= BEYOND * reach
    return np.asarray(lone[near])


def _in_space(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Return all chains and ties (T, 3), and the sigmas (T,) of their heights within the survey."""
    world = adjustment.state.tie
    every = np.arange(len(world))
    columns = adjustment.problem.layout.tie_columns(every)
    gradient = np.broadcast_to(np.eye(3), (len(world), 3, 3))
    own = adjustment.covariance.blocks(columns)
    inner = within_survey(adjustment.minimum.factor, Placed(world, gradient, columns), every, own)
    return world, np.sqrt(np.maximum(inner[:, 2, 2], 0.0))


def _departures(world_m: Floats, sigma_m: Floats) -> Floats | None:
    """Compute heights (n,) over the plane of most points (n, 3); None where there is none."""
    height = world_m[:, 2]
    plane = fit_robust_plane(world_m[:, :2], height, np.hypot(sigma_m, UNEVEN_M))
    return None if plane is None else height - plane


def _stands_off(departure_m: Floats, sigma_m: Floats, least_m: Floats) -> Bools:
    """Mark points (n,) too high or too low for this ground, by at least a height (n,)."""
    near = np.abs(departure_m) < np.maximum(LEAST_OFF_M, FAR * sigma_m)
    spread = float(np.median(np.abs(departure_m[near])) / MEDIAN) if near.any() else 0.0
    limit = np.maximum(least_m, FAR * np.hypot(spread, sigma_m))
    return np.asarray(np.abs(departure_m) > limit)


def _roughness(departure_m: Floats, sigma_m: Floats) -> tuple[float, float]:
    """Estimate the distance of ground points from their plane, and its probability by chance.

    The likeliest variance in addition to that of the heights, by Newton's steps (a variance
    component; see estimation/reliability/variance_components.py). Zero where the ground counts as
    plane.
    """
    if len(departure_m) < FEW:
        return 0.0, 1.0
    degrees = max(len(departure_m) - 3, 1)  # about their plane
    chance = upper_tail(float(np.sum((departure_m / sigma_m) ** 2)), float(degrees))
    variance = max(float(np.var(departure_m)) - float(np.median(sigma_m**2)), LEAST_M**2)
    for _ in range(20):
        # Fisher scoring: variance += sum(w^2 d^2 - w) / sum(w^2).
        weight = 1.0 / (variance + sigma_m**2)
        fisher = float(np.sum(weight**2))
        variance += float(np.sum(weight**2 * departure_m**2) - np.sum(weight)) / fisher
        variance = max(variance, 1e-8)
    size = float(np.sqrt(variance))
    return (size, chance) if size > LEAST_M and chance < BY_CHANCE else (0.0, 1.0)


def photos_of(survey: Survey) -> Ints:
    """Count the photos (K,) that show each label, as a pick or as a match."""
    return np.bincount(seen_labels(survey)[1], minlength=len(survey.label))

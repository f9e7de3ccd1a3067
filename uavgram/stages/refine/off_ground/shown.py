"""What matches and ties show of the ground: labels that do not stand on it, how uneven it is.

A chain of matches says where its point is in space, to a centimetre, and ties do so between them.
On a plane a roof would bend everything that hangs on it, and a kerb too. So before matches are
taken for points of the ground, those that are none are told, and the ground gets the roughness that
the others show. Ties alone show that roughness as well: photos that are held by them would else be
bent until labels on uneven ground, and the lengths between them, lie in a plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from uavgram.estimation.first_poses.first_points import seen_labels
from uavgram.estimation.reliability.redundancy import upper_tail
from uavgram.estimation.survey.adjustment import Adjustment, Placed, within_survey
from uavgram.geometry.ground.plane import plane_of_most
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.survey import Survey

UNEVEN_M = 0.05
"""How far a point of the ground may lie off its plane while the plane is looked for."""

LEAST_OFF_M = 0.25
"""Height from which on a point does not stand on the ground, however smooth that is."""

FAR = 4.0
"""Sigmas of the ground's unevenness, and of the height, from which on it is not on the ground."""

FEW = 6
"""Chains on the ground from which on these alone tell how uneven it is, without the ties."""

LEAST_M = 0.003
"""Unevenness below which a ground is as good as plane."""

BY_CHANCE = 0.001
"""Probability of heights as large on a plane from which on it is taken for one."""

BEYOND = 1.25
"""Reach of the labels about their middle, in which ties are of the same ground."""

MEDIAN = 0.6745
"""Of the absolute value of a normal variable, in sigmas."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What matches show of the ground.

    Attributes
    ----------
    off_ground
        Names of labels that do not stand on it.
    roughness_m, probability
        Area by index: how far its points lie off its plane, where they do; and the probability of
        that by chance.
    """

    off_ground: frozenset[str] = frozenset()
    roughness_m: Mapping[int, float] = field(default_factory=dict)
    probability: Mapping[int, float] = field(default_factory=dict)


def shown_by_sightings(adjustment: Adjustment) -> Shown:
    """Labels off the ground, and the roughness of each area.

    Which area a tie lies on is not known: of several areas, chains alone tell.

    Parameters
    ----------
    adjustment
        With chains and ties anywhere in space: see `sound_ties`.
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
        # A label is told with its height; of ties so many are on the ground that a low thing among
        # them, a bush or a car's bonnet, stands out.
        least = np.where(ties.pick[points] >= 0, LEAST_OFF_M, 0.0)
        stands = _stands_off(departure, sigma[points], least)
        named = survey.pick_label[ties.pick[own[stands[: len(own)]]]]
        off |= {survey.label[k] for k in named}
        level = ~stands
        if level[: len(own)].sum() >= FEW:
            level[len(own) :] = False
        level &= sigma[points] <= LEAST_OFF_M  # else an error of matching is a hill
        size, chance = _roughness(departure[level], sigma[points][level])
        if size > survey.grounds[area].roughness_sigma_m:
            roughness[area], probability[area] = size, chance
    return Shown(frozenset(off), roughness, probability)


def with_shown(survey: Survey, shown: Shown) -> Survey:
    """The survey with free heights of what stands off the ground, and the roughness of the rest.

    Parameters
    ----------
    survey
        All observations.
    shown
        What its matches show.
    """
    grounds = tuple(
        replace(ground, roughness_sigma_m=shown.roughness_m.get(k, ground.roughness_sigma_m))
        for k, ground in enumerate(survey.grounds)
    )
    free = survey.is_free | np.isin(survey.label, sorted(shown.off_ground))
    return replace(survey, grounds=grounds, is_free=free)


def _about_labels(adjustment: Adjustment) -> Ints:
    """Ties that no pick is of, as near the middle of the labels on the ground as these are.

    What photos show beyond, a bank or a meadow, is not the ground that is measured on.
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
    """(T, 3) all chains and ties, and the sigmas (T,) of their heights within the survey."""
    world = adjustment.state.tie
    every = np.arange(len(world))
    columns = adjustment.problem.layout.tie_columns(every)
    gradient = np.broadcast_to(np.eye(3), (len(world), 3, 3))
    own = adjustment.covariance.blocks(columns)
    inner = within_survey(adjustment.minimum.factor, Placed(world, gradient, columns), every, own)
    return world, np.sqrt(np.maximum(inner[:, 2, 2], 0.0))


def _departures(world_m: Floats, sigma_m: Floats) -> Floats | None:
    """(n,) heights over the plane that most points (n, 3) lie on; None where there is none."""
    height = world_m[:, 2]
    plane = plane_of_most(world_m[:, :2], height, np.hypot(sigma_m, UNEVEN_M))
    return None if plane is None else height - plane


def _stands_off(departure_m: Floats, sigma_m: Floats, least_m: Floats) -> Bools:
    """(n,) what lies too high, or too low, for this ground: by some height (n,) at least."""
    near = np.abs(departure_m) < np.maximum(LEAST_OFF_M, FAR * sigma_m)
    spread = float(np.median(np.abs(departure_m[near])) / MEDIAN) if near.any() else 0.0
    limit = np.maximum(least_m, FAR * np.hypot(spread, sigma_m))
    return np.asarray(np.abs(departure_m) > limit)


def _roughness(departure_m: Floats, sigma_m: Floats) -> tuple[float, float]:
    """How far points of the ground lie off its plane, and the probability of that by chance.

    The likeliest variance beside that of the heights, by Newton's steps (a variance component; see
    estimation/reliability/variance_components.py). Zero where the ground is as good as plane.
    """
    if len(departure_m) < FEW:
        return 0.0, 1.0
    degrees = max(len(departure_m) - 3, 1)  # about their plane
    chance = upper_tail(float(np.sum((departure_m / sigma_m) ** 2)), float(degrees))
    variance = max(float(np.var(departure_m)) - float(np.median(sigma_m**2)), LEAST_M**2)
    for _ in range(20):
        weight = 1.0 / (variance + sigma_m**2)
        fisher = float(np.sum(weight**2))
        variance += float(np.sum(weight**2 * departure_m**2) - np.sum(weight)) / fisher
        variance = max(variance, 1e-8)
    size = float(np.sqrt(variance))
    return (size, chance) if size > LEAST_M and chance < BY_CHANCE else (0.0, 1.0)


def photos_of(survey: Survey) -> Ints:
    """(K,) how many photos show each label, as a pick or as a match."""
    return np.bincount(seen_labels(survey)[1], minlength=len(survey.label))

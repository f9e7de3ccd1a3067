"""Known things as observations: residuals by the row, their derivatives by the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.terms.known_functions import (
    condition_departures,
    is_condition,
    line_departures,
    measured_departure,
    refers_to_ground,
    row_count,
)
from uavgram.estimation.survey.unknowns import Layout, State
from uavgram.geometry.ground.line_of_position import inverse_root
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey.known import KnownThing
from uavgram.model.survey.survey import Survey


class Places(Protocol):
    """Where points are, by the unknowns of a survey."""

    survey: Survey
    layout: Layout

    def world_points(self, state: State, label: Ints) -> tuple[Floats, Floats, Floats]:
        """World coordinates of labels, and their derivatives."""
        ...

    def ground_points(self, state: State, label: Ints) -> tuple[Floats, Floats, Floats]:
        """Places on the ground straight below labels, and their derivatives."""
        ...

    def plane_columns(self, label: Ints) -> Ints:
        """Unknowns of the ground under labels."""
        ...


class KnownRows(NamedTuple):
    """Known things in R rows, by what they depend on.

    Attributes
    ----------
    thing
        (R,) which of the things each row is of.
    sigma
        (R,) standard deviation of each, in the unit of the thing; with what the roughness of the
        ground below adds.
    value
        (R,) departure from what is known, in the same unit.
    gradient
        (R, m) by the unknowns.
    columns
        (R, m) which unknowns.
    label, by_up
        (R, k) points of each row, and derivatives by how high each lies, the ground below it too.
    joint
        Rows that are correlated, with their covariance: those of points on one line of known
        position. They are of one thing, so their columns are the same.
    """

    thing: Ints
    sigma: Floats
    value: Floats
    gradient: Floats
    columns: Ints
    label: Ints
    by_up: Floats
    joint: tuple[tuple[Ints, Floats], ...] = ()

    def block(self) -> Block:
        """As a group of observations of one number each; correlated ones made independent."""
        return Block(
            self.whitened(self.value)[:, None],
            self.columns,
            self.whitened(self.gradient)[:, None],
        )

    def whitened(self, of_rows: Floats) -> Floats:
        """Numbers (R, ...) of the rows over their standard deviations."""
        scaled = of_rows / self.sigma.reshape(-1, *(1,) * (of_rows.ndim - 1))
        for rows, covariance in self.joint:
            scaled[rows] = inverse_root(covariance) @ of_rows[rows]
        return np.asarray(scaled)

    def covariance(self, rows: Ints) -> Floats:
        """(r, r) covariance of what is known in the rows of one thing."""
        for own, covariance in self.joint:
            if np.array_equal(own, rows):
                return covariance
        return np.diag(self.sigma[rows] ** 2)


def known_rows(places: Places, state: State, things: Sequence[KnownThing]) -> KnownRows:
    """The rows of known things.

    Parameters
    ----------
    places
        The likelihood.
    state
        Values of the unknowns.
    things
        At least one; their labels are those of the likelihood's survey.

    Notes
    -----
    All rows have as many points as that with the most: others name their first point again,
    without a derivative.
    """
    most = max(len(thing.label) for thing in things)
    label = np.array([(*t.label, *t.label[:1] * (most - len(t.label))) for t in things])
    world, by_world = _located(places.world_points(state, label.ravel()), label)
    feet, by_feet = world, by_world
    if any(refers_to_ground(thing) for thing in things):
        feet, by_feet = _located(places.ground_points(state, label.ravel()), label)
    found = _functions(places.survey, things, world, feet)
    row = found.thing
    point, plane = places.layout.point_columns(label.ravel()), places.plane_columns(label.ravel())
    columns = np.concatenate([point, plane], axis=1).reshape(len(things), -1)
    gradient = np.einsum("rpi,rpij->rpj", found.by_point, by_world[row])
    gradient += np.einsum("rpi,rpij->rpj", found.by_foot, by_feet[row])
    return KnownRows(
        thing=row,
        sigma=_sigma(things, found),
        value=found.value,
        gradient=gradient.reshape(len(row), -1),
        columns=columns[row],
        label=label[row],
        by_up=found.by_point[..., 2] + found.by_foot[..., 2],
        joint=found.joint,
    )


def _sigma(things: Sequence[KnownThing], found: _Functions) -> Floats:
    """(R,) standard deviation of each row."""
    sigma = np.hypot(np.array([thing.sigma for thing in things])[found.thing], found.rough)
    for rows, covariance in found.joint:
        sigma[rows] = np.sqrt(np.diag(covariance))
    return np.asarray(sigma)


class _Functions(NamedTuple):
    """Of R rows: thing (R,), value (R,), gradients (R, k, 3) by points and feet, roughness (R,).

    `joint` as in `KnownRows`.
    """

    thing: Ints
    value: Floats
    by_point: Floats
    by_foot: Floats
    rough: Floats
    joint: tuple[tuple[Ints, Floats], ...]


def _functions(
    survey: Survey, things: Sequence[KnownThing], world: Floats, feet: Floats
) -> _Functions:
    """The rows as functions of points (N, k, 3) and their feet; those that are alike at once."""
    row = things_of_rows(survey, things)
    first = np.searchsorted(row, np.arange(len(things)))
    value, rough = np.zeros(len(row)), np.zeros(len(row))
    by_point, by_foot = np.zeros((2, len(row), world.shape[1], 3))
    alike: dict[tuple[str, int, bool, bool], list[int]] = {}
    joint = []
    for i, thing in enumerate(things):
        if thing.position is not None:
            k = len(thing.label)
            beside, covariance = line_departures(thing, world[i, :k])
            own = np.flatnonzero(row == i)
            value[own], by_point[own, :k] = beside.value, beside.gradient
            joint.append((own, covariance))
            continue
        flat = on_ground(survey, thing)
        key = thing.kind, len(thing.label), is_condition(thing), flat
        alike.setdefault(key, []).append(i)
    for (_, count, conditional, flat), group in alike.items():
        if conditional:
            residual, gradient = condition_departures(
                things[group[0]], world[group, :count], on_ground=flat
            )
            rows = first[group][:, None] + np.arange(residual.shape[1])
            value[rows], by_point[rows, :count] = residual, gradient
            continue
        for i in group:
            at = first[i]
            one = measured_departure(things[i], world[i, :count], survey, feet[i, :count])
            value[at], rough[at] = one.value, one.rough
            by_point[at, :count], by_foot[at, :count] = one.gradient, one.by_feet
    return _Functions(row, value, by_point, by_foot, rough, tuple(joint))


def _located(points: tuple[Floats, Floats, Floats], label: Ints) -> tuple[Floats, Floats]:
    """(N, k, 3) places of labels (N, k), and their derivatives (N, k, 3, j) by all unknowns."""
    world, d_point, d_plane = points
    by_unknowns = np.concatenate([d_point, d_plane], axis=2)
    return world.reshape(*label.shape, 3), by_unknowns.reshape(*label.shape, 3, -1)


def things_of_rows(survey: Survey, things: Sequence[KnownThing]) -> Ints:
    """(R,) which of some known things each of their rows is of."""
    counts = [row_count(thing, on_ground=on_ground(survey, thing)) for thing in things]
    return np.repeat(np.arange(len(things)), counts)


_ONE_PLANE = ("coplanar", "plane_distance")
_LEVEL = ("level", "vertical_distance", "slope", "height")


def says_something(survey: Survey, thing: KnownThing) -> bool:
    """Whether a thing can be an observation: not of what the ground alone says, or forbids.

    Of points on the ground none is above another, or above the ground; on smooth ground all lie in
    its plane, and on that of a free gauge all are level.
    """
    label = list(thing.label)
    if thing.position is not None:
        return survey.gauge == "world"
    if refers_to_ground(thing):
        return bool((survey.is_free[label] | (survey.height_sigma_m[label] > 0)).any())
    if survey.off_ground[label].any():
        return True
    areas = set(survey.area[label].tolist())
    smooth = all(
        survey.grounds[a].roughness_sigma_m == 0 and survey.grounds[a].relief is None for a in areas
    )
    silent: tuple[str, ...] = ("vertical",)
    if smooth and len(areas) == 1:
        is_gauge = survey.gauge == "plane" and areas == {0}
        silent += _ONE_PLANE + _LEVEL * is_gauge
    return thing.kind not in silent


def on_ground(survey: Survey, thing: KnownThing) -> bool:
    """Whether all points of a thing lie on the ground."""
    return not survey.off_ground[list(thing.label)].any()

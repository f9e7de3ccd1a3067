"""Known things as observations: residuals by the row, their derivatives by the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.ground_below import ground_below
from uavgram.estimation.survey.known_functions import (
    departures,
    refers_to_ground,
    row_count,
)
from uavgram.estimation.survey.unknowns import Layout, State
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
    """

    thing: Ints
    sigma: Floats
    value: Floats
    gradient: Floats
    columns: Ints
    label: Ints
    by_up: Floats

    def block(self) -> Block:
        """As a group of observations of one number each."""
        weight = 1.0 / self.sigma
        return Block(
            (self.value * weight)[:, None], self.columns, (self.gradient * weight[:, None])[:, None]
        )


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
    found = []
    for i, thing in enumerate(things):
        own = slice(len(thing.label))
        below = ground_below(places.survey, label[i, own], world[i, own], feet[i, own])
        flat = on_ground(places, thing)
        found.append(departures(thing, world[i, own], below, on_ground=flat))
    row = things_of_rows(places, things)
    stated = np.array([things[i].sigma for i in row])
    point, plane = places.layout.point_columns(label.ravel()), places.plane_columns(label.ravel())
    columns = np.concatenate([point, plane], axis=1).reshape(len(things), -1)
    by_point = _together([each.gradient for each in found], most)
    by_foot = _together([each.by_feet for each in found], most)
    gradient = np.einsum("rpi,rpij->rpj", by_point, by_world[row])
    gradient += np.einsum("rpi,rpij->rpj", by_foot, by_feet[row])
    return KnownRows(
        thing=row,
        sigma=np.hypot(stated, np.concatenate([each.rough for each in found])),
        value=np.concatenate([each.value for each in found]),
        gradient=gradient.reshape(len(row), -1),
        columns=columns[row],
        label=label[row],
        by_up=by_point[..., 2] + by_foot[..., 2],
    )


def _located(points: tuple[Floats, Floats, Floats], label: Ints) -> tuple[Floats, Floats]:
    """(N, k, 3) places of labels (N, k), and their derivatives (N, k, 3, j) by all unknowns."""
    world, d_point, d_plane = points
    by_unknowns = np.concatenate([d_point, d_plane], axis=2)
    return world.reshape(*label.shape, 3), by_unknowns.reshape(*label.shape, 3, -1)


def _together(gradients: Sequence[Floats], most: int) -> Floats:
    """(R, most, 3) gradients of all rows, from those of each thing (r, k, 3)."""
    whole = [np.pad(each, ((0, 0), (0, most - each.shape[1]), (0, 0))) for each in gradients]
    return np.concatenate(whole)


def things_of_rows(places: Places, things: Sequence[KnownThing]) -> Ints:
    """(R,) which of some known things each of their rows is of."""
    counts = [row_count(thing, on_ground=on_ground(places, thing)) for thing in things]
    return np.repeat(np.arange(len(things)), counts)


_ONE_PLANE = ("coplanar", "plane_distance")
_LEVEL = ("level", "vertical_distance", "slope", "height")


def says_something(survey: Survey, thing: KnownThing) -> bool:
    """Whether a thing can be an observation: not of what the ground alone says, or forbids.

    Of points on the ground none is above another, or above the ground; on smooth ground all lie in
    its plane, and on that of a free gauge all are level.
    """
    label = list(thing.label)
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


def on_ground(places: Places, thing: KnownThing) -> bool:
    """Whether all points of a thing lie on the ground."""
    return not places.survey.off_ground[list(thing.label)].any()

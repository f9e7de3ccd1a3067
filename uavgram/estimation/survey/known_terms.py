"""Known things as observations: residuals by the row, their derivatives by the unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.known_functions import departures, row_count
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
        (R,) standard deviation of each, in the unit of the thing.
    value
        (R,) departure from what is known, in the same unit.
    gradient
        (R, m) by the unknowns.
    columns
        (R, m) which unknowns.
    """

    thing: Ints
    sigma: Floats
    value: Floats
    gradient: Floats
    columns: Ints

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
    layout = places.layout
    most = max(len(thing.label) for thing in things)
    label = np.array([(*t.label, *t.label[:1] * (most - len(t.label))) for t in things])
    world, d_point, d_plane = places.world_points(state, label.ravel())
    by_point = world.reshape(len(things), most, 3)
    found = [
        departures(thing, by_point[i, : len(thing.label)], on_ground=on_ground(places, thing))
        for i, thing in enumerate(things)
    ]
    row = things_of_rows(places, things)
    gradient = np.zeros((len(row), most, 3))
    first = 0
    for each in found:
        rows, count, _ = each.gradient.shape
        gradient[first : first + rows, :count] = each.gradient
        first += rows
    own, ground = layout.point_columns(label.ravel()), places.plane_columns(label.ravel())
    columns = np.concatenate([own, ground], axis=1).reshape(len(things), -1)
    by_unknowns = np.concatenate([d_point, d_plane], axis=2).reshape(len(things), most, 3, -1)
    chained = np.einsum("rpi,rpij->rpj", gradient, by_unknowns[row])
    return KnownRows(
        thing=row,
        sigma=np.array([things[i].sigma for i in row]),
        value=np.concatenate([each.value for each in found]),
        gradient=chained.reshape(len(row), columns.shape[1]),
        columns=columns[row],
    )


def things_of_rows(places: Places, things: Sequence[KnownThing]) -> Ints:
    """(R,) which of some known things each of their rows is of."""
    counts = [row_count(thing, on_ground=on_ground(places, thing)) for thing in things]
    return np.repeat(np.arange(len(things)), counts)


def on_ground(places: Places, thing: KnownThing) -> bool:
    """Whether all points of a thing lie on the ground."""
    return not places.survey.height_above_m[list(thing.label)].any()

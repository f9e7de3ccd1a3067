"""Known things as observations: residuals by the row, and their derivatives by the unknowns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.known_kinds import ALL_KINDS, AlikeThings
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Misfit,
    Observation,
    Subjects,
)
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State, unstack
from uavgram.geometry.ground.conditions import compute_inverse_root
from uavgram.model.arrays import Floats, Ints
from uavgram.model.naming import format_misfit
from uavgram.model.observations import KnownThing
from uavgram.model.survey import Survey

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem


KNOWN_THINGS = ErrorSource(
    "known things",
    "agreement of the known distances, angles and conditions",
    "More or better known things would help there.",
)


class KnownRows(NamedTuple):
    """Known things in R rows with their derivatives.

    Attributes
    ----------
    thing
        (R,) index of the thing of each row.
    sigma
        (R,) standard deviation of each row, in the unit of the thing, including the roughness of
        the ground below.
    value
        (R,) residual against the known value, in the same unit.
    gradient
        (R, m) derivatives by the unknowns.
    columns
        (R, m) columns of these unknowns.
    label, by_up
        (R, k) points of each row, and derivatives by the height of each, together with that of the
        ground below it.
    joint
        Correlated rows with their covariance: those of points on one line of known position. They
        are of one thing, so their columns are the same.
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
        """Return a group of observations of one number each; correlated ones are decorrelated."""
        return Block(
            self.whiten(self.value)[:, None],
            self.columns,
            self.whiten(self.gradient)[:, None],
        )

    def whiten(self, of_rows: Floats) -> Floats:
        """Divide numbers (R, ...) of the rows by their standard deviations."""
        scaled = of_rows / self.sigma.reshape(-1, *(1,) * (of_rows.ndim - 1))
        # Correlated rows: multiply by the inverse root of their covariance.
        for rows, covariance in self.joint:
            scaled[rows] = compute_inverse_root(covariance) @ of_rows[rows]
        return np.asarray(scaled)

    def covariance(self, rows: Ints) -> Floats:
        """Return the (r, r) covariance of the known values in the rows of one thing."""
        for own, covariance in self.joint:
            if np.array_equal(own, rows):
                return covariance
        return np.diag(self.sigma[rows] ** 2)


class KnownArrangement(NamedTuple):
    """Arrangement of N known things in R rows, which depends on no unknown.

    Attributes
    ----------
    label
        (N, k) points of each. All have as many as the thing with the most: others repeat their
        first point, without a derivative.
    row, sigma, columns
        (R,) thing of each row, (R,) its sigma, and (R, m) the unknowns.
    is_from_ground
        Whether any is measured from the ground straight below its points.
    alike
        Groups of things that are alike: first row and index of each, the things, and whether they
        are on the ground.
    """

    label: Ints
    row: Ints
    sigma: Floats
    columns: Ints
    is_from_ground: bool
    alike: list[tuple[Ints, Ints, tuple[KnownThing, ...], bool]]


def compute_known_rows(
    problem: SurveyProblem, state: State, things: Sequence[KnownThing] | KnownArrangement
) -> KnownRows:
    """Compute the rows of known things.

    Parameters
    ----------
    problem
        Likelihood.
    state
        Values of the unknowns.
    things
        At least one known thing, or the arrangement of such things; their labels are those of the
        likelihood's survey.
    """
    of = things if isinstance(things, KnownArrangement) else arrange_things(problem, things)
    label, row = of.label, of.row
    world, by_world = _locate(problem.world_points(state, label.ravel()), label)
    feet, by_feet = world, by_world
    if of.is_from_ground:
        feet, by_feet = _locate(problem.ground_points(state, label.ravel()), label)
    value, rough = np.zeros((2, len(row)))
    by_point, by_foot = np.zeros((2, *label[row].shape, 3))
    joint: list[tuple[Ints, Floats]] = []
    for first, own, some, flat in of.alike:
        k = len(some[0].label)
        found = ALL_KINDS[some[0].kind].departures(
            AlikeThings(some, world[own, :k], feet[own, :k], flat, problem.survey)
        )
        rows = first[:, None] + np.arange(found.value.shape[1])
        value[rows], by_point[rows, :k] = found.value, found.by_point
        if found.by_foot is not None and found.rough is not None:
            by_foot[rows, :k], rough[rows] = found.by_foot, found.rough
        if found.covariance is not None:
            joint += zip(rows, found.covariance, strict=True)
    sigma = np.hypot(of.sigma, rough)
    for rows, covariance in joint:
        sigma[rows] = np.sqrt(np.diag(covariance))
    # Chain rule: derivatives by points and ground points times theirs by the unknowns.
    gradient = np.einsum("rpi,rpij->rpj", by_point, by_world[row])
    gradient += np.einsum("rpi,rpij->rpj", by_foot, by_feet[row])
    return KnownRows(
        thing=row,
        sigma=sigma,
        value=value,
        gradient=gradient.reshape(len(row), -1),
        columns=of.columns,
        label=label[row],
        by_up=by_point[..., 2] + by_foot[..., 2],
        joint=tuple(joint),
    )


def arrange_things(problem: SurveyProblem, things: Sequence[KnownThing]) -> KnownArrangement:
    """Arrange known things in rows: what is the same at all values of the unknowns."""
    most = max(len(thing.label) for thing in things)
    label = np.array([(*t.label, *t.label[:1] * (most - len(t.label))) for t in things])
    row = find_things_of_rows(problem.survey, things)
    first = np.searchsorted(row, np.arange(len(things)))
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, thing in enumerate(things):
        flat, line = is_on_ground(problem.survey, thing), thing.position
        key = flat, thing.kind, len(thing.label), thing.value == 0.0, line and line.has_height
        groups.setdefault(key, []).append(i)
    point, plane = problem.layout.point_columns(label.ravel()), problem.plane_columns(label.ravel())
    columns = np.concatenate([point, plane], axis=1).reshape(len(things), -1)
    return KnownArrangement(
        label=label,
        row=row,
        sigma=np.array([thing.sigma for thing in things])[row],
        columns=columns[row],
        is_from_ground=any(ALL_KINDS[thing.kind].is_from_ground(thing) for thing in things),
        alike=[
            (first[own], np.array(own), tuple(things[i] for i in own), bool(key[0]))
            for key, own in groups.items()
        ],
    )


def _locate(points: tuple[Floats, Floats, Floats], label: Ints) -> tuple[Floats, Floats]:
    """Return places (N, k, 3) of labels (N, k), and derivatives (N, k, 3, j) by all unknowns."""
    world, d_point, d_plane = points
    by_unknowns = np.concatenate([d_point, d_plane], axis=2)
    return world.reshape(*label.shape, 3), by_unknowns.reshape(*label.shape, 3, -1)


def find_things_of_rows(survey: Survey, things: Sequence[KnownThing]) -> Ints:
    """Return the (R,) index of the known thing of each row."""
    counts = [
        ALL_KINDS[thing.kind].row_count(thing, on_ground=is_on_ground(survey, thing))
        for thing in things
    ]
    return np.repeat(np.arange(len(things)), counts)


def is_on_ground(survey: Survey, thing: KnownThing) -> bool:
    """Return whether all points of a thing are on the ground."""
    return not survey.off_ground[list(thing.label)].any()


class Known(Observation):
    """Known things: distances, angles, conditions, lines of known position."""

    kind = Kind(
        "known",
        KNOWN_THINGS,
        "known things",
        role="reading",
        rank=2,
        plural="known things",
        check="their values and stated errors",
        misfit_code="known-suspect",
        advice="Look at their values, at their points and at their picks.",
        is_core=True,
        has_table=True,
    )

    def is_part(self) -> bool:
        """Return whether a known thing takes part."""
        return bool(self.problem.known)

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the values; conditions and lines of position keep their residuals."""
        known = stated.known
        value, row = known.value.copy(), truth.problem.survey.row_of_label
        seen = (known.get_seen_thing(i, row) for i in range(len(known.name)))
        things = [one for one in seen if one is not None and ALL_KINDS[one.kind].has_value]
        if things:
            rows = compute_known_rows(truth.problem, truth.state, things)
            np.add.at(value, np.array([thing.index for thing in things])[rows.thing], rows.value)
        noise = known.sigma * truth.rng.standard_normal(len(known.name))
        value += np.where(np.isnan(known.value), 0.0, noise)
        return replace(stated, known=replace(known, value=value))

    def rows(self, state: State) -> Block | None:
        """Compute the residuals of all known things."""
        if state.plane.ndim == 1:
            return self._compute_rows(state).block()
        each = [self._compute_rows(one).block() for one in unstack(state)]
        residual, jacobian = np.stack([b.residual for b in each]), [b.jacobian for b in each]
        return Block(residual, each[0].columns, np.stack(jacobian))

    def _compute_rows(self, state: State) -> KnownRows:
        return compute_known_rows(self.problem, state, self._arrangement)

    @cached_property
    def _arrangement(self) -> KnownArrangement:
        return arrange_things(self.problem, self.problem.known)

    def sigma(self, found: Minimum[State]) -> Floats:
        """Return the (R, 1) standard deviations, each in its unit."""
        return self._compute_rows(found.state).sigma[:, None]

    def residuals(self, found: Minimum[State]) -> Floats:
        """Return the (R, 1) residuals, each in its unit; whitening would mix correlated rows."""
        return self._compute_rows(found.state).value[:, None]

    def things(self) -> Ints | None:
        """Return the (R,) thing of each row: several rows may be of one."""
        return self.problem.known_thing

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield the derivatives by the heights of the points of each row, one after the other."""
        rows = self._compute_rows(found.state)
        by_up = rows.whiten(rows.by_up)
        for k in range(rows.label.shape[1]):
            yield rows.label[:, k], by_up[:, [k]]

    def thing(self, row: int) -> KnownThing:
        """Return the known thing of a row."""
        return self.problem.known[int(self.problem.known_thing[row])]

    def _labels(self, row: int) -> tuple[str, ...]:
        return tuple(self.problem.survey.label[k] for k in self.thing(row).label)

    def describe(self, row: int) -> str:
        """Return ``right angle 'corner' ('A', 'B', 'C')``."""
        thing = self.thing(row)
        return describe_thing(thing.kind, thing.name, self._labels(row))

    def title(self, member: Member) -> str:
        """Return ``known right angle 'corner' ('A', 'B', 'C')``."""
        return f"known {self.describe(member.row)}"

    def unit(self, member: Member) -> tuple[str, float]:
        """Return the unit of its value and sigma, which is that of its errors."""
        return ALL_KINDS[self.thing(member.row).kind].unit, 1.0

    def subjects(self, row: int) -> Subjects:
        """Return its labels."""
        return {"labels": self._labels(row)}

    def witness(self) -> Iterator[str]:
        """Yield the sources of evidence for the scale."""
        known = self.problem.known
        if any(thing.position is not None for thing in known):
            yield "the lines of known position"
        others = [thing for thing in known if thing.position is None]
        if any(ALL_KINDS[thing.kind].gives_scale(thing.value) for thing in others):
            yield "the other known distances"

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a known thing that does not fit."""
        thing, what = self.thing(found.member.row), self.describe(found.member.row)
        how = f"{describe_departure(thing, found.off)} ({format_misfit(found.w)})"
        given = "value" if thing.position is None else "coordinates"
        return (
            f"The known {what} does not fit: {how}. Look at its {given}, at its points and at "
            f"their picks.",
            f"{what} {how}",
        )


def describe_departure(thing: KnownThing, off: Floats) -> str:
    """Return ``given 3.500 m, adjusted 3.612 m``, or for a condition ``off by 0.112 m``.

    Parameters
    ----------
    thing
        Known thing.
    off
        (r,) its residuals, in its unit.
    """
    kind = ALL_KINDS[thing.kind]
    size = float(off[0]) if len(off) == 1 else float(np.linalg.norm(off))
    if not kind.has_value:
        return f"off by {abs(size):.3f} {kind.unit}"
    adjusted = kind.compute_adjusted_value(thing, size)
    return f"given {thing.value:.3f} {kind.unit}, adjusted {adjusted:.3f} {kind.unit}"


def describe_thing(kind: str, name: str, points: Sequence[str]) -> str:
    """Return the name of a known thing: ``right angle 'corner' ('A', 'B', 'C')``.

    Parameters
    ----------
    kind, name
        Its kind and its name.
    points
        Labels of its points.
    """
    words = ALL_KINDS[kind].words or kind.replace("_", " ")
    return f"{words} {name!r} ({', '.join(map(repr, points))})"

"""Matches and tie points: sightings of the ground in addition to the picks.

A match repeats the error of the pick that it was found from. So a chain (the picked pixel, and the
places where it was found again) has a ground point of its own, the one under the picked pixel; the
label's point is observed by the pick alone. Both depart from the ground by the same height.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import ErrorSource, Kind, Observation
from uavgram.estimation.survey.observations.sightings import (
    Sightings,
    collect_sightings,
    compute_sighting_rows,
)
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats, Ints
from uavgram.model.survey import TiePicks

PATCH_SIGMA_PX = 0.03
"""Sigma of the picked pixel itself in a chain [px]: the noise of the photo around it, which all
matches found from it share. (matching.md's prototype: matches of exact picks are good to 0.04 to
0.06 px.)"""

WEAK_HEIGHT_SIGMA_M = 100.0
"""Prior sigma of a tie point's height about the ground's [m]: it determines the depth of points
that only photos from nearly one place show."""


MATCHING = ErrorSource(
    "matches",
    "how exactly picked points were found in other photos",
    "Sharper photos, or picks on distinct objects, would help there.",
)
TIE_POINTS = ErrorSource(
    "tie points",
    "how exactly the program measured tie points in the photos",
    "Photos that overlap more would help there.",
)


class Matches(Observation):
    """Places where the program found picked points again."""

    kind = Kind(
        "matches",
        MATCHING,
        "picked points, found in other photos",
        role="untested",
        is_core=True,
    )

    def is_part(self) -> bool:
        """Return whether there are chains of matches."""
        return bool(self.problem.survey.matches.points)

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the places where the image patch around a drawn pick is found, its error included.

        The patch is on the ground as it slopes at the pick's point; the patch that is searched for
        is cut out with an error of its own.
        """
        picks, survey = stated.picks, truth.problem.survey
        found = np.flatnonzero(picks.of_source("match"))
        if not len(found):
            return stated
        frame = {name: i for i, name in enumerate(survey.frame_id)}
        at = {(a, b): i for i, (a, b) in enumerate(zip(picks.image, picks.label, strict=True))}
        origin = np.array([at[picks.from_image[i], picks.label[i]] for i in found])
        first, row = np.unique(origin, return_inverse=True)
        f = np.array([frame[picks.image[i]] for i in first])
        k = np.array([truth.row[picks.label[i]] for i in first])
        cut = picks.pixel_px[first] + PATCH_SIGMA_PX * truth.rng.standard_normal((len(first), 2))
        # Intersect the ray of the patch with the tangent plane of the ground at the label.
        ray = back_project(survey.calibration.model, truth.intrinsics, cut)
        ray = np.einsum("nij,nj->ni", truth.state.rotation[f], ray)
        normal = np.column_stack([-truth.slope[k], np.ones(len(k))])
        center = truth.state.center[f]
        reach = np.sum((truth.place_m[k] - center) * normal, axis=1) / np.sum(ray * normal, axis=1)
        patch = (center + reach[:, None] * ray)[row]
        noise = picks.sigma_px[found, None] * truth.rng.standard_normal((len(found), 2))
        pixel, from_px = picks.pixel_px.copy(), picks.from_px.copy()
        pixel[found] = (
            truth.project_places(np.array([frame[picks.image[i]] for i in found]), patch) + noise
        )
        from_px[found] = picks.pixel_px[origin]
        return replace(stated, picks=replace(picks, pixel_px=pixel, from_px=from_px))

    @cached_property
    def _label(self) -> Ints:
        """(N,) label of the pick that each sighting's chain begins with."""
        survey = self.problem.survey
        return survey.pick_label[survey.matches.pick][survey.matches.point]

    @cached_property
    def _seen(self) -> Sightings:
        matches = self.problem.survey.matches
        own = self.problem.layout.tie_columns(matches.point)
        points = own, self.problem.plane_columns(self._label)
        return collect_sightings(
            self.problem, points, matches.frame, matches.pixel_px, matches.sigma_px
        )

    def rows(self, state: State) -> Block | None:
        """Predict the pixels; None if a point is not in front of its camera."""
        own = state.tie[..., self.problem.survey.matches.point, :]
        placed = self.problem.place_points(state, own, self._label)
        return compute_sighting_rows(self.problem, state, self._seen, placed)

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield the derivatives: the point under a picked pixel is on the same ground."""
        jacobian = found.blocks[self.name].jacobian
        yield self._label, -jacobian[:, :, self.problem.layout.point_size + 2]


class Ties(Observation):
    """Tie points: points that several photos show, which no person picked."""

    kind = Kind("ties", TIE_POINTS, "tie points", role="untested")

    def is_part(self) -> bool:
        """Return whether there are tie points."""
        return bool(self.problem.survey.ties.points)

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the pixels of each tie point in its photos."""
        survey, ties = truth.problem.survey, stated.ties
        row, sigma = survey.ties.row, ties.sigma_px[survey.ties.row]
        place = truth.state.tie[survey.matches.points + survey.ties.point][:, :3]
        pixel = truth.project_places(survey.ties.frame, place.reshape(-1, 3))
        again = TiePicks(
            image=tuple(ties.image[i] for i in row),
            tie=tuple(ties.tie[i] for i in row),
            pixel_px=pixel + sigma[:, None] * truth.rng.standard_normal(pixel.shape),
            sigma_px=sigma,
        )
        return replace(stated, ties=again)

    @cached_property
    def _point(self) -> Ints:
        survey = self.problem.survey
        return survey.matches.points + survey.ties.point

    @cached_property
    def _seen(self) -> Sightings:
        ties = self.problem.survey.ties
        alone = np.zeros((len(self._point), 0), dtype=np.int64)
        points = self.problem.layout.tie_columns(self._point), alone
        return collect_sightings(self.problem, points, ties.frame, ties.pixel_px, ties.sigma_px)

    def rows(self, state: State) -> Block | None:
        """Predict the pixels; None if a point is not in front of its camera."""
        world = state.tie[..., self._point, :]
        n = world.shape[-2]
        placed = world, np.broadcast_to(np.eye(3), (n, 3, 3)), np.zeros((n, 3, 0))
        return compute_sighting_rows(self.problem, state, self._seen, placed)


class TieHeights(Observation):
    """Weak priors of the heights of tie points."""

    kind = Kind("tie heights", TIE_POINTS, "heights of tie points", role="construction")

    def is_part(self) -> bool:
        """Return whether there are tie points."""
        return bool(self.problem.survey.ties.points)

    def rows(self, state: State) -> Block | None:
        """Compare the heights with that of the ground."""
        survey, layout = self.problem.survey, self.problem.layout
        tie = np.arange(survey.matches.points, state.tie.shape[-2])
        ground_m = 0.0 if layout.free_gauge else survey.ground.height_m
        off = (state.tie[..., tie, 2] - ground_m)[..., None]
        weight = np.full((len(tie), 1, 1), 1.0 / WEAK_HEIGHT_SIGMA_M)
        return Block(off / WEAK_HEIGHT_SIGMA_M, layout.tie_columns(tie)[:, 2:], weight)


class InterpolatedHeights(Observation):
    """Heights of labels over the plane as interpolated from ties, minus those of the labels.

    These observations are differences only: as without ties, the plane is fixed by the prior of the
    labels' roughness about it.
    """

    kind = Kind(
        "beside",
        TIE_POINTS,
        "heights of labels, by the tie points around them",
        role="construction",
        by_size=True,
    )

    def is_part(self) -> bool:
        """Return whether ties surround a label on rough ground."""
        return bool(self.problem.layout.ties and len(self._which))

    @cached_property
    def _which(self) -> Ints:
        beside = self.problem.survey.ties.constraints
        is_rough = np.isin(beside.label, self.problem.third.rough)
        return np.flatnonzero(is_rough & np.isfinite(beside.sigma_m))

    def rows(self, state: State) -> Block | None:
        """Compare the heights that ties give for labels with those of the labels."""
        problem, beside, which = self.problem, self.problem.survey.ties.constraints, self._which
        label, weight, sigma = beside.label[which], beside.weight[which], beside.sigma_m[which]
        tie = problem.survey.matches.points + beside.tie[which]
        place = state.tie[..., tie, :]
        flat = place.reshape(*place.shape[:-3], -1, 3)
        own = np.repeat(label, tie.shape[1])
        ground = problem.ground.at(state.plane, state.relief, own, flat[..., :2])
        above = place[..., 2] - ground.height_m.reshape(place.shape[:-1])
        # Weighted mean height of the ties over the plane, minus the departure of the label.
        off = np.sum(weight * above, axis=-1) - state.point[..., label, 2]
        by_tie = np.ones(flat.shape)
        by_tie[..., :2] = -ground.slope
        by_tie = (weight[..., None] * by_tie.reshape(place.shape)).reshape(*off.shape, -1)
        by_ground = ground.by_unknowns.reshape(*place.shape[:-1], -1)
        by_ground = -np.sum(weight[..., None] * by_ground, axis=-2)
        jacobian = np.concatenate([by_tie, -np.ones((*off.shape, 1)), by_ground], axis=-1)
        columns = [
            problem.layout.tie_columns(tie.ravel()).reshape(len(label), -1),
            problem.layout.point_columns(label)[:, 2:],
            problem.plane_columns(label),
        ]
        weighted = jacobian[..., None, :] / sigma[:, None, None]
        return Block((off / sigma)[..., None], np.concatenate(columns, axis=1), weighted)

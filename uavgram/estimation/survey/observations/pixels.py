"""Picked pixels, and the identification error that all picks of a label share.

Lengths, control points and measurements refer to the meant point; clicks show the picked one. More
photos do not average out the offset between the two. Chains of matches also show the picked point,
and give only the height of the meant one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Misfit,
    Observation,
    Subjects,
)
from uavgram.estimation.survey.observations.sightings import (
    Sightings,
    collect_sightings,
    compute_sighting_rows,
)
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Remedy, propose_pick_removal
from uavgram.model.naming import format_misfit

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

LINKED_SIGMA_M = 0.001
"""Sigma of the difference in height above the ground between the picked and the meant point [m]."""


PICKING = ErrorSource(
    "picks",
    "how exactly the points were picked in the photos",
    "Picking them in more photos, or with more care, would help there.",
)
IDENTIFICATION = ErrorSource(
    "identification",
    "how far the picked points are from the intended ones, the same in all photos",
    "Sharp marks or targets would help there; more photos do not.",
)


class Identification(Observation):
    """Offsets, east and north, between the picked and the meant points."""

    kind = Kind(
        "identification",
        IDENTIFICATION,
        "picked points, beside the meant ones",
        role="untested",
        is_core=True,
        by_size=True,
    )

    def __init__(self, problem: SurveyProblem, kind: Kind) -> None:
        super().__init__(problem, kind)
        survey, layout = problem.survey, problem.layout
        self._label = survey.identified
        self._sigma = np.repeat(survey.identification_sigma_m[self._label], 2)
        picked = layout.picked_columns(np.arange(len(self._label)))
        self._level = _columns(picked[:, :2], layout.point_columns(self._label)[:, :2])

    def is_part(self) -> bool:
        """Return whether picked points may differ from the meant ones."""
        return len(self._label) > 0

    def rows(self, state: State) -> Block | None:
        """Compute (2Q, 1) offsets of each picked point, east and then north."""
        off = (state.picked - state.point[..., self._label, :])[..., :2]
        return _make_differences(off.reshape(*off.shape[:-2], -1), self._level, self._sigma)


class LinkedHeights(Observation):
    """Equal heights of picked points and chains of matches, and of the meant points."""

    kind = Kind(
        "linked",
        IDENTIFICATION,
        "heights of picked points, as of the meant ones",
        role="construction",
    )

    def __init__(self, problem: SurveyProblem, kind: Kind) -> None:
        super().__init__(problem, kind)
        survey, layout, matches = problem.survey, problem.layout, problem.survey.matches
        label = survey.identified
        self._chain = np.arange(matches.points if layout.point_size == 3 else 0)
        self._linked = np.append(label, survey.pick_label[matches.pick[self._chain]])
        picked = layout.picked_columns(np.arange(len(label)))
        own = np.concatenate([picked, layout.tie_columns(self._chain)])
        self._upright = _columns(own[:, 2:], layout.point_columns(self._linked)[:, 2:])

    def is_part(self) -> bool:
        """Return whether such a point has a height of its own."""
        return len(self._upright) > 0

    def rows(self, state: State) -> Block | None:
        """Compute (Q + chains, 1) heights over the ground minus that of the meant point."""
        own = np.concatenate([state.picked, state.tie[..., self._chain, :]], axis=-2)
        off = (own - state.point[..., self._linked, :])[..., 2]
        return _make_differences(off, self._upright, np.full(off.shape[-1], LINKED_SIGMA_M))


def _columns(own: Ints, other: Ints) -> Ints:
    """Return (n, 2) pairs of unknowns from (m, k) of two kinds."""
    return np.stack([own.ravel(), other.ravel()], axis=1)


def _make_differences(off: Floats, columns: Ints, sigma: Floats) -> Block:
    """Return rows for (..., n) differences of two unknowns each, over their sigmas (n,)."""
    jacobian = np.stack([1.0 / sigma, -1.0 / sigma], axis=1)[:, None, :]
    return Block((off / sigma)[..., None], columns, jacobian)


class Pixels(Observation):
    """Pixels that people picked, or where a target was found."""

    kind = Kind(
        "pixels",
        PICKING,
        "picked pixels",
        role="reading",
        rank=3,
        units=("px", "px"),
        plural="picks",
        check="their labels, and their stated error",
        misfit_code="pick-suspect",
        advice="Look at their places and at their labels.",
        is_core=True,
        is_whole=True,
        is_joint=True,
        has_table=True,
    )

    def rows(self, state: State) -> Block | None:
        """Predict the pixels; None if a point is not in front, or the ground is seen from below."""
        survey = self.problem.survey
        every = np.concatenate([state.point, state.picked], axis=-2)
        points, label, of_pick = self._points
        placed = self.problem.place_points(state, every[..., points, :], label)
        world, d_point, d_plane = (np.take(one, of_pick, axis=every.ndim - 2) for one in placed)
        to_camera = (state.center[..., survey.pick_frame, :] - world)[..., self._from_above, :]
        # Height of the camera over the tangent plane of the ground at the point.
        slope = d_point[..., self._from_above, 2, :2]
        above = to_camera[..., 2] - np.sum(slope * to_camera[..., :2], axis=-1)
        if above.size and above.min() <= 0:  # the ground is only visible from above
            return None
        return compute_sighting_rows(self.problem, state, self._seen, (world, d_point, d_plane))

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw the pixels at which people see each point, picked with an identification error."""
        picks, survey = stated.picks, truth.problem.survey
        frame = {name: i for i, name in enumerate(survey.frame_id)}
        matches = set(survey.matches.row.tolist())
        kept = [
            i
            for i, (image, label) in enumerate(zip(picks.image, picks.label, strict=True))
            if image in frame
            and label in truth.row
            and (picks.source[i] != "match" or i in matches)
        ]
        again = picks.take(kept)
        f = np.array([frame[name] for name in again.image], dtype=np.int64)
        k = np.array([truth.row[name] for name in again.label], dtype=np.int64)
        sigma = np.where(np.isnan(again.sigma_px), stated.picks_sigma_px, again.sigma_px)
        noise = sigma[:, None] * truth.rng.standard_normal((len(kept), 2))
        off = stated.picks_identification_sigma_m * truth.rng.standard_normal((len(truth.row), 2))
        rise = np.sum(off * truth.slope, axis=1, keepdims=True)
        beside = truth.place_m + np.concatenate([off, rise], axis=1)
        place = np.where(again.of_source("target")[:, None], truth.place_m[k], beside[k])
        again = replace(again, pixel_px=truth.project_places(f, place) + noise, sigma_px=sigma)
        return replace(stated, picks=again)

    @cached_property
    def _from_above(self) -> Ints:
        """Picks of points on the ground; points above it may be seen from below."""
        survey = self.problem.survey
        return np.flatnonzero(~survey.off_ground[survey.pick_label])

    @cached_property
    def _point(self) -> Ints:
        """(P,) index of the point of each pick: the label's own, or K + that of a picked point."""
        survey, found = self.problem.survey, self.problem.survey.pick_label.copy()
        by_hand = np.isin(found, survey.identified) & ~survey.pick_is_target
        found[by_hand] = len(survey.label) + np.searchsorted(survey.identified, found[by_hand])
        return found

    @cached_property
    def _points(self) -> tuple[Ints, Ints, Ints]:
        """Points with picks and their labels, (n,) each; (P,) row of each pick's point in these."""
        points, first, of_pick = np.unique(self._point, return_index=True, return_inverse=True)
        return points, self.problem.survey.pick_label[first], of_pick

    @cached_property
    def _seen(self) -> Sightings:
        problem, survey = self.problem, self.problem.survey
        own = problem.layout.point_columns(self._point), problem.plane_columns(survey.pick_label)
        return collect_sightings(
            problem, own, survey.pick_frame, survey.pixel_px, survey.pick_sigma_px
        )

    def sigma(self, found: Minimum[State]) -> Floats:
        """Return the (P, 1) standard deviations of both coordinates [px]."""
        del found
        return self.problem.survey.pick_sigma_px[:, None]

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield the derivatives: those by a point are minus those by its camera's centre."""
        up = self.problem.layout.point_size + 2
        jacobian = found.blocks[self.name].jacobian
        yield self.problem.survey.pick_label, -jacobian[:, :, up]

    def place(self, row: int) -> tuple[str, str]:
        """Return frame and label of a pick."""
        survey = self.problem.survey
        return survey.frame_id[survey.pick_frame[row]], survey.label[survey.pick_label[row]]

    def title(self, member: Member) -> str:
        """Return ``pick of 'P' in 'img1.jpg'``."""
        frame, label = self.place(member.row)
        return f"pick of {label!r} in {frame!r}"

    def subjects(self, row: int) -> Subjects:
        """Return its frame and its label."""
        frame, label = self.place(row)
        return {"frames": (frame,), "labels": (label,)}

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a pick that does not fit."""
        how = f"({np.hypot(*found.off):.1f} px off, {format_misfit(found.w)})"
        frame, label = self.place(found.member.row)
        what = f"{label!r} in {frame!r}"
        return (
            f"The pick of {what} does not fit: look at the place and at the label {how}.",
            f"{what} {how}",
        )

    def remedy(self, row: int) -> Remedy | None:
        """Return the removal of the pick."""
        return propose_pick_removal([self.place(row)])

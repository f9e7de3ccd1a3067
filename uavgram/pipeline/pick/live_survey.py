"""Repeated adjustment while picks and lengths change, without reading inputs twice.

The parts that depend on photos and log only (times, matching, seed poses) are computed once.
`adjust` then runs every stage in memory; `linearised` returns within milliseconds the first-order
update of the last adjustment when picks move or readings change, with its sigmas unchanged.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.measuring.predicted_pixels import (
    FlightOfPhotos,
    PredictedPixels,
    predict_pixels,
    predict_unpicked,
)
from uavgram.estimation.measuring.propagation import compute_values
from uavgram.estimation.measuring.scale import LineAdvice, find_next_line
from uavgram.estimation.survey.adjustment import Adjustment, compute_heights_at
from uavgram.estimation.survey.observations.lengths import select_taped_known
from uavgram.estimation.survey.unknowns import State, advance_state
from uavgram.io.photos.catalogue import UnusablePhotosError
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownLines, MeasurementRequest, Picks
from uavgram.model.result.result import Result
from uavgram.model.result.tables import ProfileResults
from uavgram.pipeline.match.adjustment import adjust_manual_picks
from uavgram.pipeline.measure.compute import Computation, compute
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.pipeline.measure.observations import append_plate_sides
from uavgram.pipeline.measure.pose import PosedFrames, pose_frames
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.match import Found, Pair
from uavgram.stages.measure import compute_profiles


class FirstOrderStep(NamedTuple):
    """Survey after one step of the linear model.

    Attributes
    ----------
    state
        State of all unknowns.
    residual_px
        (P, 2) of the picks: projection minus the new pick.
    world_m
        (K, 3) points.
    """

    state: State
    residual_px: Floats
    world_m: Floats


def update_linearly(adjustment: Adjustment, pixel_px: Floats, length_m: Floats) -> FirstOrderStep:
    """Update an adjustment to other readings, by its factorised normal equations.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    pixel_px
        (P, 2) its picks after the change.
    length_m
        (n,) its participating lengths after the change.
    """
    survey, blocks, problem = adjustment.survey, adjustment.minimum.blocks, adjustment.problem
    errors = {"pixels": (pixel_px - survey.pixel_px) / survey.pick_sigma_px[:, None]}
    if len(problem.line_index):
        used = problem.line_index
        change = (length_m - survey.length_m[used]) / survey.length_sigma_m[used]
        errors["lengths"] = change[:, None]
    size = problem.layout.size
    # Step = N^-1 J^T e, with the changes e of the whitened readings.
    right = np.zeros(size)
    for name, error in errors.items():
        moved = np.einsum("nr,nrk->nk", error, blocks[name].jacobian)
        right += np.bincount(blocks[name].columns.ravel(), moved.ravel(), size)
    step = adjustment.minimum.factor.solve(right)
    state = advance_state(problem.layout, adjustment.state, step)
    pixels = blocks["pixels"]
    follow = np.einsum("nrk,nk->nr", pixels.jacobian, step[pixels.columns])
    residual = pixels.residual + follow - errors["pixels"]
    world, _, _ = problem.world_points(state, np.arange(problem.layout.points))
    return FirstOrderStep(state, residual * survey.pick_sigma_px[:, None], world)


NOTHING_PICKED = (
    "Nothing is picked yet. Click a point on the ground in a photo; a second one makes a distance, "
    "and lengths that were taped make it exact."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Observations of one adjustment."""

    picks: Picks
    lines: KnownLines
    requests: tuple[MeasurementRequest, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveAdjustment:
    """Full adjustment, with additional results.

    Attributes
    ----------
    observed
        Its observations.
    computed
        Result and adjustment.
    predicted
        Labels in photos in which they are not picked.
    picked_px, picked_covariance_px2
        (n, 2), (n, 2, 2): adjusted points in the photos in which they are picked.
    advice
        The length to tape next.
    seconds
        Duration of the adjustment.
    """

    observed: Observations
    computed: Computation
    predicted: PredictedPixels
    picked_px: Floats
    picked_covariance_px2: Floats
    advice: LineAdvice | None
    seconds: float

    @property
    def result(self) -> Result:
        """Everything that `uavgram run` would write."""
        return self.computed.result

    @property
    def adjustment(self) -> Adjustment:
        """Adjusted survey."""
        return self.computed.refined.adjustment


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearUpdate:
    """First-order update for observations that changed a little; sigmas are those of `base`.

    Attributes
    ----------
    base
        The adjustment from which it starts.
    value
        (M,) measurements, in the order of the result's.
    length_m
        (L,) known lengths as adjusted; NaN where an end is not picked.
    residual_px
        (n, 2) of the adjustment's picks: projection minus pick.
    world_m, height_m
        (K, 3), (K,) the adjustment's points, and their heights over the ground.
    """

    base: LiveAdjustment
    value: Floats
    length_m: Floats
    residual_px: Floats
    world_m: Floats
    height_m: Floats


class LiveSurvey:
    """Project during picking.

    Parameters
    ----------
    inputs
        As read, with the initial picks, lengths and measurements of the session.
    damage
        Error on missing or damaged photos that they lack, for which `uavgram run` refuses the
        project: nothing is adjusted here either. None without any.
    """

    @limit_blas_threads
    def __init__(self, inputs: Inputs, damage: UnusablePhotosError | None = None) -> None:
        self.inputs = inputs
        self.damage = damage
        self.posed: PosedFrames | None = None
        self.unposed_because = ""
        try:
            self.posed = pose_frames(inputs)
        except UavgramError as why:  # the page opens anyway, and reports it
            self.unposed_because = str(why)

    @classmethod
    def open(cls, project: Path) -> LiveSurvey:
        """Read a project that may lack picks, lengths and measurements.

        Missing and damaged photos are left out, and nothing is adjusted then.

        Raises
        ------
        UavgramError
            The project has another problem.
        """
        try:
            return cls(read_inputs(project, unfinished=True))
        except UnusablePhotosError as why:
            names = {photo.path.name for photo in why.photos}
            return cls(read_inputs(project, unfinished=True, without=names), why)

    @limit_blas_threads
    def adjust(self, observed: Observations) -> LiveAdjustment:
        """Adjust and measure in full.

        Raises
        ------
        UavgramError
            Nothing can be adjusted yet; the message names the missing inputs.
        """
        if self.damage is not None:
            raise UavgramError(str(self.damage))
        if self.posed is None:
            raise UavgramError(self.unposed_because)
        if not observed.picks.image:
            raise UavgramError(NOTHING_PICKED)
        started = time.perf_counter()
        computed = compute(self._inputs_with(observed), posed=self.posed, curved=False)
        adjustment = computed.refined.adjustment
        picked, covariance = predict_pixels(
            adjustment, adjustment.survey.pick_frame, adjustment.survey.pick_label
        )
        return LiveAdjustment(
            observed=observed,
            computed=computed,
            predicted=predict_unpicked(adjustment, self.flight()),
            picked_px=picked,
            picked_covariance_px2=covariance,
            advice=find_next_line(adjustment),
            seconds=time.perf_counter() - started,
        )

    @limit_blas_threads
    def adjust_with_finds(
        self, last: LiveAdjustment, found: Mapping[Pair, Found]
    ) -> tuple[LiveAdjustment, dict[Pair, str]]:
        """Adjust with finds that are not accepted yet, without the log.

        These photos have poses in the log that are too uncertain for a search. A log that is wrong
        by more than stated, as for a photo that was rotated, would contradict right finds.

        Parameters
        ----------
        last
            The last adjustment.
        found
            Finds of its picks in other photos.

        Returns
        -------
        adjusted
            The last adjustment, with poses and points from lengths, picks and finds.
        contradicted
            Finds that the others contradict, with the reason.

        Raises
        ------
        UavgramError
            They do not determine poses.
        """
        if self.posed is None:
            raise UavgramError(self.unposed_because)
        posed = replace(self.posed, telemetry=None)
        base = adjust_manual_picks(self._inputs_with(last.observed), posed)
        adjustment, contradicted, _ = base.adjust_finds(found)
        refined = replace(base.refined, adjustment=adjustment)
        return replace(last, computed=last.computed._replace(refined=refined)), contradicted

    def _inputs_with(self, observed: Observations) -> Inputs:
        return replace(
            self.inputs, picks=observed.picks, lines=observed.lines, requests=observed.requests
        )

    @limit_blas_threads
    def update_linearly(self, base: LiveAdjustment, observed: Observations) -> LinearUpdate | None:
        """Update the last adjustment to first order; None if more than numbers changed."""
        if self.posed is None or not _alike(base.observed, observed):
            return None
        survey, picks = base.adjustment.survey, observed.picks
        before = base.observed.picks
        clicks = before.clicks
        rows = []
        for f, k, place in zip(survey.pick_frame, survey.pick_label, survey.pixel_px, strict=True):
            own = clicks[survey.frame_id[f], survey.label[k]]
            away = np.abs(before.pixel_px[own] - place).max(axis=1)
            rows.append(own[int(away.argmin())])
        was, lines = (self._lines(one) for one in (base.observed, observed))
        taken = _project_lines(base.adjustment, was)
        if taken is None:
            return None
        update = update_linearly(base.adjustment, picks.pixel_px[rows], lines.length_m[taken])
        return LinearUpdate(
            base=base,
            value=compute_values(
                base.adjustment.problem, update.state, observed.requests, self.posed.frames
            ),
            length_m=_lengths(base.adjustment, lines, update.state),
            residual_px=update.residual_px,
            world_m=update.world_m,
            height_m=compute_heights_at(base.adjustment, update.state),
        )

    def _lines(self, observed: Observations) -> KnownLines:
        """Return all known lengths, including those of the plates."""
        return append_plate_sides(observed.lines, observed.picks, self.inputs.project.targets)

    def flight(self) -> FlightOfPhotos | None:
        """Return the flight of all photos with telemetry; None without."""
        telemetry = None if self.posed is None else self.posed.telemetry
        if telemetry is None:
            return None
        return telemetry.prior, telemetry.track, telemetry.poses.frame_id


def _alike(before: Observations, now: Observations) -> bool:
    """Return whether only pixels and readings differ."""
    a, b, la, lb = before.picks, now.picks, before.lines, now.lines
    return (
        (a.image, a.label, a.area, a.source) == (b.image, b.label, b.area, b.source)
        and np.array_equal(a.sigma_px, b.sigma_px, equal_nan=True)
        and np.array_equal(a.height_m, b.height_m, equal_nan=True)
        and np.array_equal(a.height_sigma_m, b.height_sigma_m, equal_nan=True)
        and np.array_equal(a.is_free, b.is_free)
        and (la.name, la.start, la.end) == (lb.name, lb.start, lb.end)
        and (la.tape, la.along) == (lb.tape, lb.along)
        and np.array_equal(la.sigma_m, lb.sigma_m)
        and np.array_equal(la.adjust, lb.adjust)
        and before.requests == now.requests
    )


def _project_lines(adjustment: Adjustment, lines: KnownLines) -> list[int] | None:
    """Find each length of the adjustment among all known lengths; None where one is missing.

    An outlier has a larger sigma in the adjustment than stated; a corrected length has another
    reading, or other ends.
    """
    survey, found = adjustment.survey, []
    free: dict[tuple[str, str, float], list[int]] = {}
    for i in np.flatnonzero(lines.adjust).tolist():
        free.setdefault((lines.start[i], lines.end[i], lines.length_m[i]), []).append(i)
    for k in adjustment.problem.line_index:
        ends = survey.label[survey.line_start[k]], survey.label[survey.line_end[k]]
        same = free.get((*ends, survey.length_m[k]))
        if not same:
            return None
        as_stated = [i for i in same if lines.sigma_m[i] == survey.length_sigma_m[k]]
        found.append((as_stated or same)[0])
        same.remove(found[-1])
    return found


def _lengths(adjustment: Adjustment, lines: KnownLines, state: State) -> Floats:
    """Predict the readings of tapes (L,) between adjusted points; NaN where one is not adjusted."""
    start, end = adjustment.label_rows(lines.start), adjustment.label_rows(lines.end)
    seen = np.flatnonzero((start >= 0) & (end >= 0))
    found = np.full(len(lines.name), np.nan)
    taped = select_taped_known(lines, seen, start[seen], end[seen])
    found[seen], _, _ = adjustment.problem.readings(state, taped)
    return found


@limit_blas_threads
def make_side_view(adjusted: LiveAdjustment, name: str) -> ProfileResults | None:
    """Return a measurement's adjusted points, in order along it.

    A profile is viewed across its own line; other measurements across the line from the first point
    to the one furthest from it, seen from above.

    Parameters
    ----------
    adjusted
        A full adjustment.
    name
        Name of the measurement.

    Returns
    -------
    points
        None where it was not requested then, or fewer than two of its points are adjusted.
    """
    request = next((one for one in adjusted.observed.requests if one.name == name), None)
    if request is None:
        return None
    points = adjusted.result.points
    place = dict(zip(points.label, points.position_world_m, strict=True))
    label = [one for one in dict.fromkeys(request.points) if one in place]
    if len(label) < 2:
        return None
    if request.kind != "profile":
        away = np.array([place[one] for one in label])[:, :2] - place[label[0]][:2]
        label.append(label.pop(int(np.argmax(np.hypot(*away.T)))))
    along = MeasurementRequest(name=name, kind="profile", points=tuple(label))
    found = compute_profiles(adjusted.adjustment, (along,))
    return found if found.label else None

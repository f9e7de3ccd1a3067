"""Hypotheses on a survey that is the mirror image of its control points or its log.

All photos were mirrored when they were picked, or east and north of the control points are
exchanged. Distances and areas stay right, coordinates do not. Three control points show it, or else
only a log, by positions and directions of the photos: over a straight flight with a camera that
looks straight down it does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.telemetry import TELEMETRY_PARTS
from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.flight_log import free_places
from uavgram.stages.refine.causes.hypothesis import SURE_LOG_ODDS, Diagnosis, Hypothesis
from uavgram.stages.refine.first_values import find_first_values
from uavgram.stages.refine.minima import TRIAL_ITERATIONS
from uavgram.stages.refine.readjustment import find_used_lines
from uavgram.stages.refine.staged_sigmas import iterate

PRIOR_LOG_ODDS = float(np.log(200.0))
"""Logarithm of the odds against photos that were all mirrored."""

UNDECIDED_DIFFERENCE = 2.0 * float(np.log(20.0))
"""Difference of the sums of squares below which neither solution has odds of 20 to 1."""

MIN_MIRRORED_SHARE = 0.8
"""Share of the triangles of control points with the wrong sense above which the photos were
mirrored: a wrong point spoils some of them."""

TRIANGLE, MOST_STEPS = range(3), 5
"""Corners of a triangle; largest number of picks from one corner to the next."""

MAX_MEAN_SQUARE = 25.0
"""Mean square of the log's residuals in the reflected state, in sigmas, above which no camera mount
and no bias of the log fits the mirror image."""


def propose_all_mirrored(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that all photos were mirrored when they were picked."""
    adjustment, survey = diagnosis.adjustment, diagnosis.survey
    is_shown = shows_mirrored_control(survey)
    if not is_shown and (not adjustment.minimum.converged or _reflect_problem(adjustment) is None):
        return
    blocks = adjustment.minimum.blocks
    strained = sum(
        float(np.sum(blocks[kind].residual ** 2))
        for kind in ("telemetry", *TELEMETRY_PARTS)
        if kind in blocks
    )
    pixel = _mirror_pixels(survey)
    yield Hypothesis(
        message=partial(
            _report_mirrored, by_control=is_shown, or_axes=is_shown and survey.telemetry is None
        ),
        mend=SurveyCorrection(
            pixel_of_pick={k: (float(u), float(v)) for k, (u, v) in enumerate(pixel)}
        ),
        begun=None if is_shown else reflect,
        is_of_all=is_shown,
        # Upper limit: all residuals of the log; with control, of the whole survey.
        promise=diagnosis.cost if is_shown else strained,
        price=PRIOR_LOG_ODDS,
        settles=frozenset(survey.frame_id),
    )


def propose_exchanged_axes(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that east and north of all control points are exchanged.

    Without a log, mirrored photos fit the control points as well.
    """
    survey = diagnosis.survey
    if survey.telemetry is None or not shows_mirrored_control(survey):
        return
    yield Hypothesis(
        message=lambda _: Message(
            "warning",
            "control-axes-exchanged",
            "East and north of all control points seem to be exchanged: the photos and their "
            "places fit only then, up to a common shift. Look at the columns of the list of "
            "control points.",
            labels=tuple(survey.label[k] for k in survey.control_label),
        ),
        freed=_exchange_axes,
        is_of_all=True,
        promise=diagnosis.cost,  # upper limit
        price=PRIOR_LOG_ODDS,
        settles=frozenset(survey.frame_id),
    )


def _exchange_axes(survey: Survey) -> Survey:
    """Exchange east and north of the control points, and shift them to where the log shows them.

    What is known of a common shift is given up.
    """
    exchanged = survey.control_world_m[:, [1, 0, 2]]
    sigma = survey.control_sigma_m[:, [1, 0, 2]]
    shift_m = find_first_values(survey)[0].point_m[survey.control_label] - exchanged[:, :2]
    is_shown = np.isfinite(shift_m).all(axis=1)
    if is_shown.any():
        exchanged[:, :2] += shift_m[is_shown].mean(axis=0)
    return free_places(replace(survey, control_world_m=exchanged, control_sigma_m=sigma))


def shows_mirrored_control(survey: Survey) -> bool:
    """Return whether most triangles of control points have the wrong sense in several photos.

    Seen from above, a triangle that runs counterclockwise on the ground does so in a photo, too,
    however the camera is turned or tilted. The only photo of a survey has hypotheses of its own.
    """
    if len(survey.control_label) < len(TRIANGLE) or len(np.unique(survey.pick_frame)) < 2:
        return False
    camera = survey.calibration
    place = np.full((len(survey.label), 2), np.nan)
    place[survey.control_label] = survey.control_world_m[:, :2]
    ray = back_project(camera.model, camera.parameters, survey.pixel_px)[:, :2]
    there = place[survey.pick_label]
    usable = np.isfinite(there).all(axis=1) & np.isfinite(ray).all(axis=1)
    senses = [np.zeros(0)]
    for frame in np.unique(survey.pick_frame[usable]):
        picks = np.flatnonzero(usable & (survey.pick_frame == frame))
        for step in range(1, MOST_STEPS + 1):
            corner = np.stack([np.roll(picks, -step * k) for k in TRIANGLE], axis=1)
            # Image rows run downwards: right senses are opposite.
            senses.append(-_compute_senses(ray[corner]) * _compute_senses(there[corner]))
    sense = np.concatenate(senses)
    return bool((sense < 0.0).sum() > MIN_MIRRORED_SHARE * (sense != 0.0).sum())


def _compute_senses(corner: Floats) -> Floats:
    """Return 1 (n,) for triangles (n, 3, 2) that run counterclockwise, -1 for the others."""
    (ax, ay), (bx, by) = (corner[:, k].T - corner[:, 0].T for k in (1, 2))
    return np.asarray(np.sign(ax * by - ay * bx))


def find_mirrored_solution(adjustment: Adjustment) -> Adjustment | None:
    """Return the solution of mirrored photos if the log does not exclude it; otherwise None."""
    image = _reflect_problem(adjustment)
    if image is None:
        return None
    problem, state = image
    try:
        blocks = problem.evaluate(state)
        if blocks is None or np.mean(blocks["telemetry"].residual ** 2) > MAX_MEAN_SQUARE:
            return None
        goal = adjustment.minimum.cost + UNDECIDED_DIFFERENCE
        minimum = iterate(problem, state, TRIAL_ITERATIONS, goal=goal)
        if minimum.cost > goal:
            return None
        return Adjustment(problem, minimum, minimum.factor.covariance())
    except (SingularError, ValueError):
        return None


def report_mirror_image(adjustment: Adjustment, mirrored: Adjustment) -> Message:
    """Report that photos and log fit mirrored photos better, or as well.

    Parameters
    ----------
    adjustment, mirrored
        The survey, and its mirror image, adjusted.
    """
    gain = adjustment.minimum.cost - mirrored.minimum.cost
    if gain / 2.0 > PRIOR_LOG_ODDS + SURE_LOG_ODDS:
        return _report_mirrored(None)
    text = (
        "Photos that were all mirrored when they were picked would fit the log as well, as over a "
        "straight flight: coordinates and directions would be mirrored across it, distances and "
        "areas would stay. Look at one photo in the page: writing has to read from left to right."
    )
    return Message("info", "mirrored-undecided", text)


def reflect(state: State) -> State:
    """Reflect a state across a vertical plane through the middle of the cameras.

    The plane is parallel to the columns of most photos, so that the directions of cameras that look
    straight down do not change.
    """
    # Mean axis (modulo 180 degrees) of the image columns, by doubled angles.
    up = -state.rotation[:, :2, 1]
    angle = 0.5 * np.angle(np.sum((up @ np.array([1.0, 1.0j])) ** 2))
    along = np.array([np.cos(angle), np.sin(angle)])
    mirror = np.eye(3)
    mirror[:2, :2] = 2.0 * np.outer(along, along) - np.eye(2)
    middle = state.center[:, :2].mean(axis=0)

    def across(place: Floats) -> Floats:
        image = place.copy()
        image[:, :2] = middle + (place[:, :2] - middle) @ mirror[:2, :2]
        return image

    plane = state.plane.copy().reshape(-1, 3)
    plane[:, 1:] = plane[:, 1:] @ mirror[:2, :2]
    return replace(
        state,
        point=across(state.point),
        tie=across(state.tie),
        center=across(state.center),
        rotation=mirror @ state.rotation @ np.diag([-1.0, 1.0, 1.0]),
        plane=plane.ravel(),
        turning=np.zeros_like(state.turning),
    )


def _reflect_problem(adjustment: Adjustment) -> tuple[SurveyProblem, State] | None:
    """Return the likelihood of mirrored picks, and the reflected state; None without a log."""
    survey, problem = adjustment.survey, adjustment.problem
    if survey.telemetry is None or survey.matches.points or survey.ties.points:
        return None
    if len(survey.control_label):
        return None
    other = replace(survey, pixel_px=_mirror_pixels(survey))
    image = SurveyProblem(other, problem.pivot_m, find_used_lines(adjustment))
    return image, reflect(adjustment.state)


def _mirror_pixels(survey: Survey) -> Floats:
    pixel = survey.pixel_px.copy()
    pixel[:, 0] = survey.calibration.width_px - 1.0 - pixel[:, 0]
    return pixel


def _report_mirrored(
    _: HypothesisTest | None, *, by_control: bool = False, or_axes: bool = False
) -> Message:
    """Report mirrored photos, shown by control or a log; or exchanged axes of control."""
    witness = "the control points fit" if by_control else "the log fits"
    finding, action = "All photos seem to have been mirrored when they were picked", "Pick them"
    if or_axes:
        finding = (
            "East and north of all control points seem to be exchanged, or all photos were "
            "mirrored when they were picked"
        )
        action = "Look at the columns of the list of control points; else pick the photos"
    text = (
        f"{finding}: {witness} only then. {action} again in the original files, as the camera "
        "wrote them. Until then coordinates and directions are mirrored."
    )
    return Message("warning", "photos-mirrored", text, plain=f"{finding}." if or_axes else "")

"""Hypotheses on the flight log: another clock, a rotated camera or compass, jumping positions.

Unknowns common to a whole flight have priors. Where the observations contradict one of them by more
than its sigma explains, it is reported, and freed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest, ObservationChange
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.telemetry import TELEMETRY_PARTS
from uavgram.geometry.motion.camera_motion import HEADING_BIAS, POSITION_BIAS
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import PhotoExposures, TelemetryPrior
from uavgram.model.message import Message
from uavgram.model.naming import format_digits
from uavgram.model.survey import Survey
from uavgram.stages.messages import report_clock_off
from uavgram.stages.refine.causes.hypothesis import GROSS_ERROR_LOG_ODDS, Diagnosis, Hypothesis
from uavgram.stages.refine.causes.turned_photos import find_misplaced_photos

CLOCK_SIGMA_S, ROTATION_SIGMA_RAD = 60.0, float(np.radians(60.0))
"""Prior sigmas of a wrong clock [s], and of a rotated camera or compass [rad]."""

USUAL_S, USUAL_RAD = 20.0, float(np.radians(20.0))
"""Usual size of these errors [s, rad], for their probability, not their limit."""

MAX_MISFIT_SQUARE = 14.0
"""Squared distance of a horizontal shift from zero, in sigmas, below which there is none: exceeded
by chance once in 1,000."""

SHIFT_SIGMA_M, USUAL_SHIFT_M = 1e5, 100.0
"""Prior sigma, and usual size, of a common shift of control points, as by another datum [m]."""

POSITION_SIGMA_M = 50.0
"""Prior sigma of a frame's position beyond a step of the log [m]."""

MAX_STEPS = 8
"""Largest number of moments of a possible step that are tested."""


def propose_wrong_clock(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a larger error of the camera's clock than its prior allows."""
    prior = _telemetry(diagnosis.adjustment)
    if prior is None or isinstance(diagnosis.adjustment.survey.track, PhotoExposures):
        return
    yield Hypothesis(
        message=_clock_message,
        moved=(prior_derivative(diagnosis.adjustment, kind="clock"),),
        settled=partial(_compute_deviation, kind="clock"),
        freed=partial(_replace_prior, clock_sigma_s=CLOCK_SIGMA_S),
        price=widening_price(1, USUAL_S, prior.clock_sigma_s),
    )


def propose_shifted_control(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a common shift of all control points against the log."""
    adjustment = diagnosis.adjustment
    prior = _telemetry(adjustment)
    if prior is None or not len(adjustment.survey.control_label):
        return
    stated = float(np.exp(np.log(prior.position_bias_sigma_m).mean()))
    blocks = (adjustment.minimum.blocks[kind] for kind in ("position_bias", "plane"))
    yield Hypothesis(
        message=partial(_control_message, adjustment.survey),
        moved=(prior_derivative(adjustment, kind="position_bias"),),
        settled=partial(_compute_deviation, kind="position_bias"),
        freed=free_places,
        promise=float(sum(np.sum(one.residual**2) for one in blocks)),  # upper limit
        price=widening_price(3, USUAL_SHIFT_M, stated),
    )


def free_places(survey: Survey) -> Survey:
    """Remove the priors of the log's common error, and of the ground's height above its home."""
    grounds = tuple(replace(one, height_sigma_m=SHIFT_SIGMA_M) for one in survey.grounds)
    freed = replace(survey, grounds=grounds)
    return _replace_prior(freed, position_bias_sigma_m=np.full(3, SHIFT_SIGMA_M))


def _control_message(survey: Survey, found: HypothesisTest | None) -> Message:
    assert found is not None  # noqa: S101
    east, north, up = -found.value
    size = float(np.linalg.norm(found.value))
    toward = found.value / size if size else found.value
    sigma = float(np.sqrt(toward @ found.covariance @ toward))
    shift = (
        f"{size:.1f} ± {format_digits(sigma, 1)} m ({east:+.1f} m east, {north:+.1f} m north, "
        f"{up:+.1f} m up)"
    )
    source = "photos' places" if isinstance(survey.track, PhotoExposures) else "flight log"
    along, prior = found.value[:2], survey.telemetry
    assert prior is not None  # noqa: S101  (the caller asked)
    # In plan, the log may be off by its stated bias.
    usual = found.covariance[:2, :2] + np.diag(prior.position_bias_sigma_m[:2] ** 2)
    if along @ np.linalg.solve(usual, along) < MAX_MISFIT_SQUARE:
        return Message(
            "warning",
            "heights-off",
            f"The heights of all control points differ from those of the {source} by {shift}: they "
            "agree with each other, and in plan with both. One of the two has another reference: "
            "compare the datum of both. Distances do not depend on it.",
        )
    return Message(
        "warning",
        "control-shifted",
        f"All control points are shifted against the {source} by {shift}: they agree with each "
        f"other, but not with the {source}. Look at the coordinate system, the datum and the "
        "heights of the control points.",
        labels=tuple(survey.label[k] for k in survey.control_label),
    )


def propose_shifted_heights(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a common shift of the log's heights, as by another height reference."""
    adjustment = diagnosis.adjustment
    prior = _telemetry(adjustment)
    if prior is None or len(adjustment.survey.control_label):
        return
    every = prior_derivative(adjustment, kind="position_bias")
    up_m, promise = _height_excess(adjustment)
    # Heights in photos may have any reference; those of a log refer to its home.
    is_of_log = not isinstance(adjustment.survey.track, PhotoExposures)
    known = float(np.log(20.0)) if is_of_log else 0.0
    yield Hypothesis(
        message=partial(_heights_message, "log" if is_of_log else "photos"),
        moved=(replace(every, rows=every.rows[2:], along=every.along[2:, :, 2:]),),
        settled=_up,
        freed=partial(_free_heights, up_m),
        is_of_all=True,
        price=known + widening_price(1, USUAL_SHIFT_M, float(prior.position_bias_sigma_m[2])),
        promise=promise,
    )


def _height_excess(adjustment: Adjustment) -> tuple[float, float]:
    """Compute the excess [m] of the log's heights, and its cost as a sum of squares.

    It is also known where the adjustment did not converge, which may be because of it. Cameras keep
    the height above the ground that picks and lengths give; the ground may have followed the log.
    """
    _, off, covariance = _position_differences(adjustment)
    weight = 1.0 / covariance[:, 2, 2]
    mean = float(np.average(off[:, 2], weights=weight))
    # Adjusted bias, mean residual height, and the shift of the ground that followed the log.
    state, ground = adjustment.state, adjustment.survey.ground
    bias = float(adjustment.minimum.blocks["position_bias"].residual[2, 0])
    followed = float(state.plane[0]) - ground.height_m
    up_m = float(state.telemetry[POSITION_BIAS][2]) - mean + followed
    return up_m, bias**2 + mean**2 * float(weight.sum())


class Scale(NamedTuple):
    """Common factor of all lengths, by the heights of the log.

    Attributes
    ----------
    ratio, relative_sigma
        The factor by which they are too large, and its relative sigma.
    gain
        Decrease of the weighted sum of squares.
    """

    ratio: float
    relative_sigma: float
    gain: float


def scale_by_heights(adjustment: Adjustment) -> Scale | None:
    """Compare heights above ground with those of the log; None where either is not positive.

    Lengths that are all too large by a factor put the cameras too high by the same factor.
    """
    prior = _telemetry(adjustment)
    if prior is None:
        return None
    up_m, gain = _height_excess(adjustment)
    center, _, covariance = _position_differences(adjustment)
    height_m = float(center[:, 2].mean() - adjustment.state.plane[0])
    by_log_m = height_m + up_m
    if min(height_m, by_log_m) <= 0.0:
        return None
    variance = float(prior.position_bias_sigma_m[2]) ** 2 + float(covariance[:, 2, 2].mean())
    return Scale(height_m / by_log_m, float(np.sqrt(variance)) / by_log_m, gain)


def _free_heights(up_m: float, survey: Survey) -> Survey:
    """Remove the prior of the log's common height error, and lower the seeds by `up_m`."""
    prior, seeds = survey.telemetry, survey.seeds
    if prior is None or seeds is None:
        return survey
    sigma = np.array([*prior.position_bias_sigma_m[:2], SHIFT_SIGMA_M])
    return replace(
        survey,
        telemetry=replace(prior, position_bias_sigma_m=sigma),
        seeds=replace(seeds, center_world_m=seeds.center_world_m - [0.0, 0.0, up_m]),
    )


def _position_differences(adjustment: Adjustment) -> tuple[Floats, Floats, Floats]:
    """Return camera positions (n, 3), their differences from the log, and its covariance."""
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (only with a log)
    root = np.linalg.inv(adjustment.problem.telemetry_whitening)[:, :3]
    residual = adjustment.minimum.blocks["telemetry"].residual
    off = np.einsum("nij,nj->ni", root, residual)
    return adjustment.state.center[prior.frame_index], off, root @ np.swapaxes(root, 1, 2)


def _up(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Return the excess of the log's heights (1,), and its variance."""
    value, covariance = _compute_deviation(adjustment, kind="position_bias")
    return value[2:], covariance[2:, 2:]


def _heights_message(source: str, found: HypothesisTest | None) -> Message:
    assert found is not None  # noqa: S101
    up, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
    return Message(
        "warning",
        "heights-off",
        f"All heights of the {source} are {abs(up):.1f} ± {format_digits(sigma, 1)} m too "
        f"{'large' if up > 0 else 'small'} "
        "for the height of the ground: check whether both are above the same reference (a geoid "
        "differs from the ellipsoid by up to 100 m), `world.origin` and `ground.height_m`. "
        "Heights in the world depend on it; distances do not.",
    )


def propose_turned_camera(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a rotation of the camera in its mount, or of all headings of the log."""
    adjustment = diagnosis.adjustment
    prior = _telemetry(adjustment)
    if prior is None or adjustment.survey.track is None:
        return
    # A mount is written by hand, or missing; the angles of a gimbal are rarely wrong.
    track = adjustment.survey.track
    if isinstance(track, PhotoExposures):
        is_fixed = bool(track.by_mount.all())
    else:
        is_fixed = not len(track.gimbal_time_s)
    known = 0.0 if is_fixed else float(np.log(20.0))
    yield Hypothesis(
        message=_camera_message,
        moved=(prior_derivative(diagnosis.adjustment, kind="boresight"),),
        settled=partial(_compute_deviation, kind="boresight"),
        freed=partial(_replace_prior, boresight_sigma_rad=ROTATION_SIGMA_RAD),
        is_of_all=not diagnosis.refined.is_log_left_out,
        price=known + widening_price(3, USUAL_RAD, prior.boresight_sigma_rad),
    )
    turn = find_turn_by_places(adjustment)
    heading_rad = float(adjustment.state.telemetry[HEADING_BIAS][0]) + turn.angle_rad
    yield Hypothesis(
        message=partial(_compass_message, "photos" if isinstance(track, PhotoExposures) else "log"),
        moved=(prior_derivative(diagnosis.adjustment, kind="heading_bias"),),
        settled=partial(_heading, prior),
        freed=partial(_free_heading, heading_rad),
        is_of_all=True,
        price=widening_price(1, USUAL_RAD, prior.heading_bias_sigma_rad),
        promise=turn.gain,
    )


class Turn(NamedTuple):
    """Common rotation of all cameras that fits the log's positions.

    Attributes
    ----------
    angle_rad
        Angle about up, counterclockwise.
    gain
        Decrease of the weighted sum of squares of the positions.
    """

    angle_rad: float
    gain: float


def find_turn_by_places(adjustment: Adjustment) -> Turn:
    """Rotate all cameras together about up to the best fit with the log's positions.

    The headings of a log constrain the adjustment, and its positions are known only to metres. A
    rotation of 90 degrees is far outside the linear model, which predicts half of its gain there,
    and none of the gain at 180 degrees. So it is computed in closed form, as for two sets of points
    in the plane.
    """
    prior = _telemetry(adjustment)
    if prior is None or len(prior.frame_index) < 2:
        return Turn(0.0, 0.0)
    center, off, covariance = _position_differences(adjustment)
    # by the axis of largest variance
    weight = 1.0 / np.linalg.eigvalsh(covariance[:, :2, :2])[:, -1]
    seen, place = center[:, :2], (center - off)[:, :2]
    seen, place = (at - np.average(at, axis=0, weights=weight) for at in (seen, place))
    # Plane rotation of weighted point sets: tan(angle) = sum(cross) / sum(dot).
    along = float(np.sum(weight[:, None] * seen * place))
    across = float(np.sum(weight * (seen[:, 0] * place[:, 1] - seen[:, 1] * place[:, 0])))
    return Turn(float(np.arctan2(across, along)), 2.0 * (float(np.hypot(along, across)) - along))


def propose_position_step(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a step of the log's positions at a moment; a steady drift is the competitor."""
    adjustment = diagnosis.adjustment
    prior = _telemetry(adjustment)
    if prior is None or len(prior.time_s) < 4:
        return
    order = np.argsort(prior.time_s, kind="stable")
    by_place = adjustment.problem.telemetry_whitening[:, :, :3]
    since = (prior.time_s - prior.time_s.mean()) / max(float(np.ptp(prior.time_s)), 1e-9)
    everywhere = ObservationChange(
        "telemetry", np.arange(len(order)), by_place * since[:, None, None]
    )
    yield Hypothesis(message=None, moved=(everywhere,), price=3.0 * GROSS_ERROR_LOG_ODDS / 2.0)
    yield from _propose_step_before_lost(diagnosis)
    gaps = _likely_gaps(adjustment, order, by_place)
    for gap in gaps.tolist():
        later = order[gap:]
        few = later if 2 * len(later) <= len(order) else order[:gap]
        yield Hypothesis(
            message=partial(_step_message, *_between(adjustment, order, gap)),
            moved=(ObservationChange("telemetry", later, by_place[later]),),
            freed=partial(_free_positions, _names(adjustment, few)),
            price=3.0 * GROSS_ERROR_LOG_ODDS / 2.0 + float(np.log(len(order) - 1)),
        )


def _between(adjustment: Adjustment, order: Ints, gap: int) -> tuple[str, str]:
    """Return the names of the frames before and after a gap, in order of time."""
    prior, survey = adjustment.survey.telemetry, adjustment.survey
    assert prior is not None  # noqa: S101  (there are rows of it)
    before, after = (survey.frame_id[prior.frame_index[row]] for row in order[gap - 1 : gap + 1])
    return before, after


def _propose_step_before_lost(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose a step of the log where all photos before, or after, were left out."""
    survey, every = diagnosis.survey, diagnosis.survey.telemetry
    lost = find_misplaced_photos(diagnosis)
    if every is None or not len(lost):
        return
    # Left-out photos must all be before, or all after, one moment.
    order = every.frame_index[np.argsort(every.time_s, kind="stable")]
    is_lost = np.isin(order, lost)
    ends = np.flatnonzero(np.diff(is_lost.astype(np.int64)))
    if len(ends) != 1:
        return
    gap = int(ends[0]) + 1
    names = frozenset(survey.frame_id[k] for k in lost)
    picks = diagnosis.spoilt & np.isin(survey.pick_frame, lost)
    yield Hypothesis(
        message=partial(
            _step_message, survey.frame_id[order[gap - 1]], survey.frame_id[order[gap]]
        ),
        back=frozenset(np.flatnonzero(picks).tolist()),
        freed=partial(_free_positions, names),
        settled=partial(_step, names),
        price=3.0 * GROSS_ERROR_LOG_ODDS / 2.0 + float(np.log(len(order) - 1)),
        settles=names,
    )


def _step(names: frozenset[str], adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Compute the mean shift (3,) of some frames in the log, and its covariance."""
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (only with a log)
    some = np.array([adjustment.survey.frame_id[k] in names for k in prior.frame_index])
    white = adjustment.problem.telemetry_whitening
    off = np.linalg.solve(white, adjustment.minimum.blocks["telemetry"].residual[..., None])
    own = adjustment.frame_covariance()[prior.frame_index[some], :3, :3]
    return -off[some, :3, 0].mean(axis=0), own.mean(axis=0)


def prior_derivative(adjustment: Adjustment, *, kind: str) -> ObservationChange:
    """Return the derivative of a group's priors if its mean is wrong by any amount in each row."""
    block = adjustment.minimum.blocks[kind]
    count = len(block.residual)
    return ObservationChange(kind, np.arange(count), -block.jacobian * np.eye(count)[:, None])


def widening_price(count: int, wide: float, stated: float) -> float:
    """Return the price of widening the priors of numbers: by the ratio of both widths.

    Parameters
    ----------
    count
        Count of numbers.
    wide, stated
        Prior sigmas.
    """
    return count * max(float(np.log(wide / max(stated, 1e-9 * wide))), 1.0)


def list_prior_hypotheses(adjustment: Adjustment) -> Iterator[tuple[ObservationChange, ...]]:
    """Yield each prior of a flight and its camera as a hypothesis that it is wrong."""
    names = [*TELEMETRY_PARTS, "calibration"]
    for kind in names:
        block = adjustment.minimum.blocks.get(kind)
        if block is not None and len(block.residual):
            yield (prior_derivative(adjustment, kind=kind),)


def _telemetry(adjustment: Adjustment) -> TelemetryPrior | None:
    return adjustment.survey.telemetry


def _compute_deviation(adjustment: Adjustment, *, kind: str) -> tuple[Floats, Floats]:
    """Return the deviation of a flight's common unknowns from their priors, and its covariance."""
    problem, part = adjustment.problem, TELEMETRY_PARTS[kind]
    value = adjustment.state.telemetry[part] - problem.telemetry_mean[part]
    return value, adjustment.shared_covariance(
        problem.layout.first_telemetry + part.start, len(value)
    )


def _heading(stated: TelemetryPrior, adjustment: Adjustment) -> tuple[Floats, Floats]:
    """Return the heading bias relative to the stated one, and its variance."""
    value, covariance = _compute_deviation(adjustment, kind="heading_bias")
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (a heading bias is an unknown only with a log)
    return value + prior.heading_bias_rad - stated.heading_bias_rad, covariance


def _free_heading(heading_rad: float, survey: Survey) -> Survey:
    """Remove the prior of the common heading error, and rotate the seeds."""
    prior, seeds = survey.telemetry, survey.seeds
    if prior is None or seeds is None:
        return survey
    about_up = matrix_from_ypr(heading_rad - prior.heading_bias_rad, 0.0, 0.0)
    return replace(
        survey,
        telemetry=replace(
            prior, heading_bias_rad=heading_rad, heading_bias_sigma_rad=ROTATION_SIGMA_RAD
        ),
        seeds=replace(seeds, world_from_camera=about_up @ seeds.world_from_camera),
    )


def _replace_prior(survey: Survey, **sigma: float | Floats) -> Survey:
    """Widen priors of the flight's common unknowns."""
    if survey.telemetry is None:
        return survey
    return replace(survey, telemetry=replace(survey.telemetry, **sigma))  # type: ignore[arg-type]


def _likely_gaps(adjustment: Adjustment, order: Ints, by_place: Floats) -> Ints:
    """Find the gaps, by index of the frame after each, in which a step would explain most.

    As if only the log placed the frames: a cheap bound, for a choice.
    """
    residual = adjustment.minimum.blocks["telemetry"].residual
    score = np.einsum("nra,nr->na", by_place, residual)[order].cumsum(axis=0)
    own = np.einsum("nra,nrb->nab", by_place, by_place)[order].cumsum(axis=0)
    # Eliminate the common bias of the flight; a step is the difference of the earlier frames.
    apart = score[:-1] - own[:-1] @ np.linalg.solve(own[-1], score[-1])
    between = own[:-1] - own[:-1] @ np.linalg.solve(own[-1], own[:-1])
    gain = np.einsum("na,nab,nb->n", apart, np.linalg.pinv(between), apart)
    return 1 + np.argsort(-gain, kind="stable")[:MAX_STEPS]


def _names(adjustment: Adjustment, rows: Ints) -> frozenset[str]:
    prior, survey = adjustment.survey.telemetry, adjustment.survey
    assert prior is not None  # noqa: S101  (there are rows of it)
    return frozenset(survey.frame_id[k] for k in prior.frame_index[rows])


def _free_positions(names: Iterable[str], survey: Survey) -> Survey:
    """Remove most of the prior of some frames' positions."""
    prior = survey.telemetry
    if prior is None:
        return survey
    freed = np.array([survey.frame_id[k] in names for k in prior.frame_index])
    covariance = np.array(prior.covariance)
    covariance[freed, :3, :3] += POSITION_SIGMA_M**2 * np.eye(3)
    return replace(survey, telemetry=replace(prior, covariance=covariance))


def _clock_message(found: HypothesisTest | None) -> Message:
    assert found is not None  # noqa: S101  (it is judged by its linear test)
    return report_clock_off(float(found.value[0]), float(np.sqrt(found.covariance[0, 0])))


def _camera_message(found: HypothesisTest | None) -> Message:
    assert found is not None  # noqa: S101
    about = ("the image's x axis", "the image's y axis", "the optical axis")
    angle = np.degrees(found.value)
    sigma = np.degrees(np.sqrt(found.covariance.diagonal()))
    said = ", ".join(
        f"{a:+.1f} ± {format_digits(s)} degrees about {axis}"
        for a, s, axis in zip(angle, sigma, about, strict=True)
        if s < abs(a)
    )
    angles = f" ({said})" if said else ""
    return Message(
        "warning",
        "gimbal-off",
        f"The camera is turned by {np.linalg.norm(angle):.0f} degrees from the direction by mount "
        "and gimbal: check how the camera hung (`mount` in the project), and whether the log has "
        f"the angles of the gimbal that carried the camera{angles}.",
    )


def _compass_message(source: str, found: HypothesisTest | None) -> Message:
    """Report wrong headings of the log, or of the tags of the photos."""
    assert found is not None  # noqa: S101
    angle, sigma = np.degrees([-found.value[0], np.sqrt(found.covariance[0, 0])])
    check = (
        "Check `mount.yaw_deg` in the project and the compass of the vehicle."
        if source == "log"
        else "Another program may have turned the photos: use those of the memory card."
    )
    return Message(
        "warning",
        "gimbal-off",
        f"All headings of the {source} are off by {abs(angle):.1f} ± {format_digits(sigma, 1)} "
        f"degrees. Directions depend on them, lengths hardly. {check}",
    )


def _step_message(before: str, after: str, found: HypothesisTest | None) -> Message:
    assert found is not None  # noqa: S101
    size = float(np.linalg.norm(found.value))
    toward = found.value / size if size else found.value
    sigma = float(np.sqrt(toward @ found.covariance @ toward))
    east, north, up = found.value
    return Message(
        "warning",
        "log-position-jump",
        f"The log's positions jump by {size:.1f} ± {format_digits(sigma, 1)} m between {before!r} "
        f"and "
        f"{after!r} "
        f"({east:+.1f} m east, {north:+.1f} m north, {up:+.1f} m up): the photos show it, the log "
        "does not. Pick points that the photos before share with those behind, or leave out the "
        "fewer ones.",
        frames=(before, after),
    )

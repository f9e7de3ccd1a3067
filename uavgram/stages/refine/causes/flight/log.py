"""What could be wrong with a flight log: another clock, camera or compass turned, places that jump.

What a whole flight has in common has priors; where the observations contradict one of them by more
than its sigma explains, it is told by what it is, and freed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained, Moved
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.telemetry import TELEMETRY_PARTS
from uavgram.geometry.motion.interpolation import SmoothPositions
from uavgram.geometry.motion.rotation import matrix_from_ypr
from uavgram.geometry.motion.telemetry_pose import CLOCK, HEADING_BIAS, POSITION_BIAS
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.pose import PhotoExposures, TelemetryPrior
from uavgram.model.message import Message
from uavgram.model.naming import figures
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing
from uavgram.stages.refine.causes.photos.turned import misplaced_photos

ANY_S, ANY_RAD = 60.0, float(np.radians(60.0))
"""Prior sigmas of a clock that is wrong, and of a camera or a compass that is turned."""

USUAL_S, USUAL_RAD = 20.0, float(np.radians(20.0))
"""By which these are usually wrong: how likely it is, not how far it may go."""

FARTHEST_S, STEP_S = 20.0, 0.5
"""Corrections of the clock that are looked at."""

ANY_SHIFT_M, USUAL_SHIFT_M = 1e5, 100.0
"""The same of control points that are shifted together, as by another datum."""

ANY_M = 50.0
"""Prior sigma of a frame's place beyond a step of the log."""

MOST_STEPS = 8
"""Moments at which the log's places may have jumped, that are looked at."""


def wrong_clock(standing: Standing) -> Iterator[Hypothesis]:
    """The camera's clock is off by more than was thought possible."""
    prior = _telemetry(standing.adjustment)
    if prior is None or isinstance(standing.adjustment.survey.track, PhotoExposures):
        return
    elsewhere_s, promise = _best_clock(standing, prior)
    for shift_s in {0.0, elsewhere_s}:
        yield Hypothesis(
            tell=_clock_off,
            moved=() if shift_s else (prior_moved(standing.adjustment, kind="clock"),),
            settled=partial(_clock, prior),
            freed=partial(_with_clock, shift_s),
            promise=promise if shift_s else 0.0,
            price=widened(1, USUAL_S, prior.clock_sigma_s),
        )


def _best_clock(standing: Standing, prior: TelemetryPrior) -> tuple[float, float]:
    """Clock correction [s] by which the log's places fit the cameras best, and what it brings.

    The adjustment looks for it from where the clock was thought to be, and a way that turns has
    other minima. 0 where nothing lies far from what was found already.
    """
    adjustment, every = standing.adjustment, standing.survey.telemetry
    survey, track = adjustment.survey, standing.survey.track
    if every is None or track is None or isinstance(track, PhotoExposures):
        return 0.0, 0.0
    times = (track.position_time_s, track.attitude_time_s, track.gimbal_time_s)
    known = [time for time in times if len(time)]
    first, last = max(t[0] for t in known), min(t[-1] for t in known)
    now_s = float(adjustment.state.telemetry[CLOCK][0])
    tried = np.append(now_s, np.arange(-FARTHEST_S, FARTHEST_S + STEP_S / 2, STEP_S))
    tried = tried[(tried >= every.time_s.max() - last) & (tried <= every.time_s.min() - first)]
    if len(tried) < 2 or tried[0] != now_s:
        return 0.0, 0.0
    names = [survey.frame_id[k] for k in prior.frame_index]
    path = SmoothPositions(track.position_time_s, track.position_world_m)
    at_s = (prior.time_s[None] - tried[:, None]).ravel()
    place = path.at(at_s)[0].reshape(len(tried), len(names), 3)
    weight = 1.0 / prior.covariance[:, [0, 1, 2], [0, 1, 2]]
    off = adjustment.state.center[prior.frame_index] - place
    off = off - (np.sum(weight * off, axis=1) / weight.sum(axis=0))[:, None]
    cost = np.sum(weight * off**2, axis=(1, 2))
    best = int(cost.argmin())
    is_near = abs(tried[best] - now_s) < STEP_S
    return (0.0, 0.0) if is_near else (float(tried[best]), float(cost[0] - cost[best]))


def shifted_control(standing: Standing) -> Iterator[Hypothesis]:
    """All control points are shifted by the same vector against the log."""
    adjustment = standing.adjustment
    prior = _telemetry(adjustment)
    if prior is None or not len(adjustment.survey.control_label):
        return
    stated = float(np.exp(np.log(prior.position_bias_sigma_m).mean()))
    yield Hypothesis(
        tell=partial(_control_shifted, adjustment.survey),
        moved=(prior_moved(adjustment, kind="position_bias"),),
        settled=partial(_of_flight, kind="position_bias"),
        freed=partial(_with_prior, position_bias_sigma_m=np.full(3, ANY_SHIFT_M)),
        price=widened(3, USUAL_SHIFT_M, stated),
    )


def _control_shifted(survey: Survey, found: Explained | None) -> Message:
    assert found is not None  # noqa: S101
    east, north, up = -found.value
    size = float(np.linalg.norm(found.value))
    toward = found.value / size if size else found.value
    sigma = float(np.sqrt(toward @ found.covariance @ toward))
    return Message(
        "warning",
        "control-shifted",
        f"All control points are shifted against the flight log by {size:.1f} ± "
        f"{figures(sigma, 1)} m "
        f"({east:+.1f} m east, {north:+.1f} m north, {up:+.1f} m up): they agree with each other, "
        "but not with the log. Look at the coordinate system, the datum and the heights of the "
        "control points.",
        labels=tuple(survey.label[k] for k in survey.control_label),
    )


def shifted_heights(standing: Standing) -> Iterator[Hypothesis]:
    """All heights of the log are off against the ground's, as by another reference."""
    adjustment = standing.adjustment
    prior = _telemetry(adjustment)
    if prior is None or len(adjustment.survey.control_label):
        return
    every = prior_moved(adjustment, kind="position_bias")
    up_m, promise = _too_high(adjustment)
    # Heights that come with photos may be above anything; a log's are above the home that it has.
    is_of_log = not isinstance(adjustment.survey.track, PhotoExposures)
    known = float(np.log(20.0)) if is_of_log else 0.0
    yield Hypothesis(
        tell=_heights_shifted,
        moved=(replace(every, rows=every.rows[2:], along=every.along[2:, :, 2:]),),
        settled=_up,
        freed=partial(_with_heights, up_m),
        is_of_all=True,
        price=known + widened(1, USUAL_SHIFT_M, float(prior.position_bias_sigma_m[2])),
        promise=promise,
    )


def _too_high(adjustment: Adjustment) -> tuple[float, float]:
    """By how much the log's heights are too large [m], and what that costs: a sum of squares.

    Known where the adjustment did not come to rest, too, as it may because of them. Cameras keep
    the height above the ground that picks and lengths give; the ground may have followed the log.
    """
    _, off, covariance = _places_off(adjustment)
    weight = 1.0 / covariance[:, 2, 2]
    mean = float(np.average(off[:, 2], weights=weight))
    state, ground = adjustment.state, adjustment.survey.ground
    bias = float(adjustment.minimum.blocks["position_bias"].residual[2, 0])
    followed = float(state.plane[0]) - ground.height_m
    up_m = float(state.telemetry[POSITION_BIAS][2]) - mean + followed
    return up_m, bias**2 + mean**2 * float(weight.sum())


class Scale(NamedTuple):
    """How many times too large all lengths are, by the heights of the log.

    Attributes
    ----------
    ratio, relative_sigma
        The factor, and its sigma as a share of it.
    gain
        Fall of the weighted sum of squares.
    """

    ratio: float
    relative_sigma: float
    gain: float


def scale_by_heights(adjustment: Adjustment) -> Scale | None:
    """Compare heights above the ground with those of the log; None where it has none above it.

    Lengths that are all too large by a factor put the cameras that many times too high.
    """
    prior = _telemetry(adjustment)
    if prior is None:
        return None
    up_m, gain = _too_high(adjustment)
    center, _, covariance = _places_off(adjustment)
    height_m = float(center[:, 2].mean() - adjustment.state.plane[0])
    by_log_m = height_m + up_m
    if min(height_m, by_log_m) <= 0.0:
        return None
    variance = float(prior.position_bias_sigma_m[2]) ** 2 + float(covariance[:, 2, 2].mean())
    return Scale(height_m / by_log_m, float(np.sqrt(variance)) / by_log_m, gain)


def _with_heights(up_m: float, survey: Survey) -> Survey:
    """A survey that knows nothing of the log's heights in common, with seeds lower by that."""
    prior, seeds = survey.telemetry, survey.seeds
    if prior is None or seeds is None:
        return survey
    sigma = np.array([*prior.position_bias_sigma_m[:2], ANY_SHIFT_M])
    return replace(
        survey,
        telemetry=replace(prior, position_bias_sigma_m=sigma),
        seeds=replace(seeds, center_world_m=seeds.center_world_m - [0.0, 0.0, up_m]),
    )


def _places_off(adjustment: Adjustment) -> tuple[Floats, Floats, Floats]:
    """Where cameras are (n, 3), by how much off the log's places, and the covariance of that."""
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (only with a log)
    root = np.linalg.inv(adjustment.problem.telemetry_whitening)[:, :3]
    residual = adjustment.minimum.blocks["telemetry"].residual
    off = np.einsum("nij,nj->ni", root, residual)
    return adjustment.state.center[prior.frame_index], off, root @ np.swapaxes(root, 1, 2)


def _up(adjustment: Adjustment) -> tuple[Floats, Floats]:
    """By how much all heights of the log are too large (1,), and its variance."""
    value, covariance = _of_flight(adjustment, kind="position_bias")
    return value[2:], covariance[2:, 2:]


def _heights_shifted(found: Explained | None) -> Message:
    assert found is not None  # noqa: S101
    up, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
    return Message(
        "warning",
        "heights-off",
        f"All heights of the log are {abs(up):.1f} ± {figures(sigma, 1)} m too "
        f"{'large' if up > 0 else 'small'} "
        "for the height of the ground: look whether both are above the same reference (a geoid "
        "differs from the ellipsoid by up to 100 m), at `world.origin` and at `ground.height_m`. "
        "Heights in the world rest on it; distances do not.",
    )


def turned_camera(standing: Standing) -> Iterator[Hypothesis]:
    """The camera is turned in its mount, or all headings of the log are."""
    adjustment = standing.adjustment
    prior = _telemetry(adjustment)
    if prior is None or adjustment.survey.track is None:
        return
    # How a camera hung that no gimbal turned was written by hand, or not at all; a gimbal's angles
    # are rarely wrong.
    track = adjustment.survey.track
    is_fixed = not isinstance(track, PhotoExposures) and not len(track.gimbal_time_s)
    known = 0.0 if is_fixed else float(np.log(20.0))
    yield Hypothesis(
        tell=_camera_turned,
        moved=(prior_moved(standing.adjustment, kind="boresight"),),
        settled=partial(_of_flight, kind="boresight"),
        freed=partial(_with_prior, boresight_sigma_rad=ANY_RAD),
        is_of_all=True,
        price=known + widened(3, USUAL_RAD, prior.boresight_sigma_rad),
    )
    turn = turn_by_places(adjustment)
    heading_rad = float(adjustment.state.telemetry[HEADING_BIAS][0]) + turn.angle_rad
    yield Hypothesis(
        tell=_compass_turned,
        moved=(prior_moved(standing.adjustment, kind="heading_bias"),),
        settled=partial(_heading, prior),
        freed=partial(_with_heading, heading_rad),
        is_of_all=True,
        price=widened(1, USUAL_RAD, prior.heading_bias_sigma_rad),
        promise=turn.gain,
    )


class Turn(NamedTuple):
    """By how much all cameras together have to turn, for the log's places.

    Attributes
    ----------
    angle_rad
        About up, counterclockwise.
    gain
        Fall of the weighted sum of squares of the places.
    """

    angle_rad: float
    gain: float


def turn_by_places(adjustment: Adjustment) -> Turn:
    """Turn all cameras together about up to where they fit the log's places best.

    The headings of a log hold a survey as it is, and its places are known only to metres. A turn
    as large as a quarter round is far outside the linear model, which sees half of what it brings
    there, and nothing of what half a round does. So it is found in closed form, as of two sets of
    points in the plane.
    """
    prior = _telemetry(adjustment)
    if prior is None or len(prior.frame_index) < 2:
        return Turn(0.0, 0.0)
    center, off, covariance = _places_off(adjustment)
    # by the axis of which least is known
    weight = 1.0 / np.linalg.eigvalsh(covariance[:, :2, :2])[:, -1]
    seen, place = center[:, :2], (center - off)[:, :2]
    seen, place = (at - np.average(at, axis=0, weights=weight) for at in (seen, place))
    along = float(np.sum(weight[:, None] * seen * place))
    across = float(np.sum(weight * (seen[:, 0] * place[:, 1] - seen[:, 1] * place[:, 0])))
    return Turn(float(np.arctan2(across, along)), 2.0 * (float(np.hypot(along, across)) - along))


def stepped_places(standing: Standing) -> Iterator[Hypothesis]:
    """From a moment on, all places of the log are shifted; a steady drift is the competitor."""
    adjustment = standing.adjustment
    prior = _telemetry(adjustment)
    if prior is None or len(prior.time_s) < 4:
        return
    order = np.argsort(prior.time_s, kind="stable")
    by_place = adjustment.problem.telemetry_whitening[:, :, :3]
    since = (prior.time_s - prior.time_s.mean()) / max(float(np.ptp(prior.time_s)), 1e-9)
    everywhere = Moved("telemetry", np.arange(len(order)), by_place * since[:, None, None])
    yield Hypothesis(tell=None, moved=(everywhere,), price=3.0 * PRICE / 2.0)
    yield from _step_before_lost(standing)
    gaps = _likely_gaps(adjustment, order, by_place)
    for gap in gaps.tolist():
        later = order[gap:]
        few = later if 2 * len(later) <= len(order) else order[:gap]
        yield Hypothesis(
            tell=partial(_jumped, *_between(adjustment, order, gap)),
            moved=(Moved("telemetry", later, by_place[later]),),
            freed=partial(_without_places, _names(adjustment, few)),
            price=3.0 * PRICE / 2.0 + float(np.log(len(order) - 1)),
        )


def _between(adjustment: Adjustment, order: Ints, gap: int) -> tuple[str, str]:
    """Names of the frames before and behind a gap, in order of time."""
    prior, survey = adjustment.survey.telemetry, adjustment.survey
    assert prior is not None  # noqa: S101  (there are rows of it)
    before, after = (survey.frame_id[prior.frame_index[row]] for row in order[gap - 1 : gap + 1])
    return before, after


def _step_before_lost(standing: Standing) -> Iterator[Hypothesis]:
    """The log steps where all photos before, or behind, were left out."""
    survey, every = standing.survey, standing.survey.telemetry
    lost = misplaced_photos(standing)
    if every is None or not len(lost):
        return
    order = every.frame_index[np.argsort(every.time_s, kind="stable")]
    is_lost = np.isin(order, lost)
    ends = np.flatnonzero(np.diff(is_lost.astype(np.int64)))
    if len(ends) != 1:
        return
    gap = int(ends[0]) + 1
    names = frozenset(survey.frame_id[k] for k in lost)
    picks = standing.spoilt & np.isin(survey.pick_frame, lost)
    yield Hypothesis(
        tell=partial(_jumped, survey.frame_id[order[gap - 1]], survey.frame_id[order[gap]]),
        back=frozenset(np.flatnonzero(picks).tolist()),
        freed=partial(_without_places, names),
        settled=partial(_step, names),
        price=3.0 * PRICE / 2.0 + float(np.log(len(order) - 1)),
        settles=names,
    )


def _step(names: frozenset[str], adjustment: Adjustment) -> tuple[Floats, Floats]:
    """By how much the log has some frames elsewhere (3,), and the covariance, of their mean."""
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (only with a log)
    some = np.array([adjustment.survey.frame_id[k] in names for k in prior.frame_index])
    white = adjustment.problem.telemetry_whitening
    off = np.linalg.solve(white, adjustment.minimum.blocks["telemetry"].residual[..., None])
    own = adjustment.frame_covariance()[prior.frame_index[some], :3, :3]
    return -off[some, :3, 0].mean(axis=0), own.mean(axis=0)


def prior_moved(adjustment: Adjustment, *, kind: str) -> Moved:
    """How prior knowledge of a group moves, if its mean is wrong by any amount in each row."""
    block = adjustment.minimum.blocks[kind]
    count = len(block.residual)
    return Moved(kind, np.arange(count), -block.jacobian * np.eye(count)[:, None])


def widened(count: int, wide: float, stated: float) -> float:
    """Price of numbers of which less is known than was stated: the widths of both priors.

    Parameters
    ----------
    count
        Of numbers.
    wide, stated
        Prior sigmas.
    """
    return count * max(float(np.log(wide / max(stated, 1e-9 * wide))), 1.0)


def strained_priors(adjustment: Adjustment) -> Iterator[tuple[Moved, ...]]:
    """What is known beforehand of a flight and its camera, each as if it were wrong."""
    names = [*TELEMETRY_PARTS, "calibration"]
    for kind in names:
        block = adjustment.minimum.blocks.get(kind)
        if block is not None and len(block.residual):
            yield (prior_moved(adjustment, kind=kind),)


def _telemetry(adjustment: Adjustment) -> TelemetryPrior | None:
    return adjustment.survey.telemetry


def _of_flight(adjustment: Adjustment, *, kind: str) -> tuple[Floats, Floats]:
    """What a flight has in common, less what was thought of it, and its covariance."""
    problem, part = adjustment.problem, TELEMETRY_PARTS[kind]
    value = adjustment.state.telemetry[part] - problem.telemetry_mean[part]
    return value, adjustment.shared(problem.layout.first_telemetry + part.start, len(value))


def _heading(stated: TelemetryPrior, adjustment: Adjustment) -> tuple[Floats, Floats]:
    """The heading bias, from what was stated."""
    value, covariance = _of_flight(adjustment, kind="heading_bias")
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (a heading bias is an unknown only with a log)
    return value + prior.heading_bias_rad - stated.heading_bias_rad, covariance


def _with_heading(heading_rad: float, survey: Survey) -> Survey:
    """A survey that knows nothing of its headings in common, with seeds turned to others."""
    prior, seeds = survey.telemetry, survey.seeds
    if prior is None or seeds is None:
        return survey
    about_up = matrix_from_ypr(heading_rad - prior.heading_bias_rad, 0.0, 0.0)
    return replace(
        survey,
        telemetry=replace(prior, heading_bias_rad=heading_rad, heading_bias_sigma_rad=ANY_RAD),
        seeds=replace(seeds, world_from_camera=about_up @ seeds.world_from_camera),
    )


def _with_clock(shift_s: float, survey: Survey) -> Survey:
    """A survey that knows nothing of the camera's clock, with another place to begin."""
    prior = survey.telemetry
    if prior is None:
        return survey
    at_s, middle_s = prior.time_s - shift_s, prior.middle_s - shift_s
    moved = replace(prior, time_s=at_s, middle_s=middle_s, clock_sigma_s=ANY_S)
    return replace(survey, telemetry=moved)


def _clock(stated: TelemetryPrior, adjustment: Adjustment) -> tuple[Floats, Floats]:
    """The clock's correction, from what was stated."""
    value, covariance = _of_flight(adjustment, kind="clock")
    prior = adjustment.survey.telemetry
    assert prior is not None  # noqa: S101  (a clock is an unknown only with a log)
    return value + stated.middle_s - prior.middle_s, covariance


def _with_prior(survey: Survey, **sigma: float | Floats) -> Survey:
    """A survey that knows less of what its flight has in common."""
    if survey.telemetry is None:
        return survey
    return replace(survey, telemetry=replace(survey.telemetry, **sigma))  # type: ignore[arg-type]


def _likely_gaps(adjustment: Adjustment, order: Ints, by_place: Floats) -> Ints:
    """The gaps, by the index of the frame behind, in which a jump would explain most.

    As if nothing but the log placed the frames: a cheap bound, for a choice.
    """
    residual = adjustment.minimum.blocks["telemetry"].residual
    score = np.einsum("nra,nr->na", by_place, residual)[order].cumsum(axis=0)
    own = np.einsum("nra,nrb->nab", by_place, by_place)[order].cumsum(axis=0)
    # What all have in common is a bias of the flight: a step is what the earlier ones differ by.
    apart = score[:-1] - own[:-1] @ np.linalg.solve(own[-1], score[-1])
    between = own[:-1] - own[:-1] @ np.linalg.solve(own[-1], own[:-1])
    gain = np.einsum("na,nab,nb->n", apart, np.linalg.pinv(between), apart)
    return 1 + np.argsort(-gain, kind="stable")[:MOST_STEPS]


def _names(adjustment: Adjustment, rows: Ints) -> frozenset[str]:
    prior, survey = adjustment.survey.telemetry, adjustment.survey
    assert prior is not None  # noqa: S101  (there are rows of it)
    return frozenset(survey.frame_id[k] for k in prior.frame_index[rows])


def _without_places(names: Iterable[str], survey: Survey) -> Survey:
    """A survey that knows little of where some of its frames were."""
    prior = survey.telemetry
    if prior is None:
        return survey
    freed = np.array([survey.frame_id[k] in names for k in prior.frame_index])
    covariance = np.array(prior.covariance)
    covariance[freed, :3, :3] += ANY_M**2 * np.eye(3)
    return replace(survey, telemetry=replace(prior, covariance=covariance))


def _clock_off(found: Explained | None) -> Message:
    assert found is not None  # noqa: S101  (it is judged by its linear test)
    off, sigma = float(found.value[0]), float(np.sqrt(found.covariance[0, 0]))
    way = "fast" if off > 0 else "slow"
    return Message(
        "warning",
        "clock-off",
        f"The camera's clock is {abs(off):.1f} ± {figures(sigma, 1)} s off, more than was said to "
        "be "
        f"possible: change `time.offset_s` in the project by {off:+.1f} (the clock is {way}).",
    )


def _camera_turned(found: Explained | None) -> Message:
    assert found is not None  # noqa: S101
    about = ("the image's x axis", "the image's y axis", "the optical axis")
    angle = np.degrees(found.value)
    sigma = np.degrees(np.sqrt(found.covariance.diagonal()))
    said = ", ".join(
        f"{a:+.1f} ± {figures(s)} degrees about {axis}"
        for a, s, axis in zip(angle, sigma, about, strict=True)
        if s < abs(a)
    )
    angles = f" ({said})" if said else ""
    return Message(
        "warning",
        "gimbal-off",
        f"The camera is turned by {np.linalg.norm(angle):.0f} degrees against what mount and "
        "gimbal say: look at `mount` in the project, and whether the log has the angles of the "
        f"gimbal that the camera hung on{angles}.",
    )


def _compass_turned(found: Explained | None) -> Message:
    assert found is not None  # noqa: S101
    angle, sigma = np.degrees([-found.value[0], np.sqrt(found.covariance[0, 0])])
    return Message(
        "warning",
        "gimbal-off",
        f"All headings of the log are off by {abs(angle):.1f} ± {figures(sigma, 1)} degrees: look "
        "at "
        "`mount.yaw_deg` in the project, or at the compass of the vehicle. Directions "
        "rest on it.",
    )


def _jumped(before: str, after: str, found: Explained | None) -> Message:
    assert found is not None  # noqa: S101
    size = float(np.linalg.norm(found.value))
    toward = found.value / size if size else found.value
    sigma = float(np.sqrt(toward @ found.covariance @ toward))
    east, north, up = found.value
    return Message(
        "warning",
        "log-position-jump",
        f"The log's positions jump by {size:.1f} ± {figures(sigma, 1)} m between {before!r} and "
        f"{after!r} "
        f"({east:+.1f} m east, {north:+.1f} m north, {up:+.1f} m up): the photos show it, the log "
        "does not. Pick points that the photos before share with those behind, or leave out the "
        "fewer ones.",
        frames=(before, after),
    )

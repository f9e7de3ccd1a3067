"""Hypotheses on the camera: another zoom or camera, of all photos (the file) or of single ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.estimation.first_poses.resection import MIN_PICKS, sight_adjusted_points
from uavgram.estimation.reliability.hypotheses import (
    HypothesisTest,
    ObservationChange,
    compare_hypotheses,
)
from uavgram.estimation.reliability.redundancy import compute_redundancy
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import Calibration
from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.correction import adjust_with_all
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    Diagnosis,
    Hypothesis,
)
from uavgram.stages.refine.causes.other_poses import MOST_PHOTOS
from uavgram.stages.refine.causes.turned_photos import (
    find_misplaced_photos,
    find_photos_against_log,
    picks_of,
)

MIN_DECREASE, MAX_PHOTOS = 16.0, 4
"""Least decrease of the sum of squares by a zoom of its own, for a photo to be examined; and
largest number of such photos."""

ZOOM_FACTORS = np.exp(np.linspace(-1.0, 1.0, 101))
"""Factors of the focal length that are tried for a photo."""

MIN_DIFFERENCE = 0.03
"""Least relative difference of the focal length from that of all others for another zoom."""

SMALLEST_COPY, LARGEST_COPY = 0.1, 0.8
"""Sizes of a copy of a photo, as shares of the photo's; no pick lies beyond the copy."""

COPY_SIZES = np.exp(np.linspace(np.log(SMALLEST_COPY / 1.1), np.log(LARGEST_COPY * 1.1), 101))
"""Sizes of a copy that are tried for a photo."""

MAX_IMPROVEMENTS, MIN_IMPROVEMENT = 4, 0.1
"""Largest number of adjustments that improve a scale, and the decrease of the sum of squares below
which none follows."""

MIN_EXPLAINED_SHARE = 0.5
"""Share of the cost that another scale has to explain in the linear model, where it is no better
than the present state, for another adjustment."""

CORNER_PX = np.array([-0.5, -0.5])
"""Corner of a photo: (0, 0) is the centre of its first pixel."""


class _Scale(NamedTuple):
    """Factor of a photo's scale about a pixel (2,), and the decrease of the sum of squares."""

    factor: float
    fixed_px: Floats
    gain: float


def propose_other_zoom(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose another focal length for single photos, or picks in a smaller copy of a photo."""
    survey, adjusted = diagnosis.survey, diagnosis.adjustment
    every = np.unique(survey.pick_frame)
    price = GROSS_ERROR_LOG_ODDS + float(np.log(len(survey.frame_id)))
    if diagnosis.cost - min(adjusted.minimum.cost, _expect_squares(adjusted)) < 2.0 * price:
        return  # it would be unlikely even if it explained everything
    is_distorted = len(every) <= MOST_PHOTOS  # either may distort all points
    gains = dict.fromkeys(every.tolist(), 0.0) if is_distorted else _find_strained_photos(diagnosis)
    for frame, gain in gains.items():
        picks = picks_of(diagnosis, frame)
        other = _adjust_others(diagnosis, frame) if is_distorted else diagnosis
        if other is None:
            continue
        found = (
            (_find_zoom(diagnosis, other.adjustment, picks), _report_other_zoom),
            (_find_copy(diagnosis, other.adjustment, picks), _report_copy),
        )
        for rough, report in found:
            scale = _improve_scale(diagnosis, picks, rough) if rough and is_distorted else rough
            if scale is None or abs(scale.factor - 1.0) < MIN_DIFFERENCE:
                continue
            yield Hypothesis(
                message=partial(report, survey.frame_id[frame], scale.factor),
                mend=_enlarge_picks(survey, picks, scale),
                remedy=SurveyCorrection(without_picks=frozenset(picks.tolist())),
                is_of_all=is_distorted,
                promise=max(gain, scale.gain),
                price=price,
                settles=frozenset([survey.frame_id[frame]]),
            )


def _find_zoom(diagnosis: Diagnosis, seen: Adjustment, picks: Ints) -> _Scale | None:
    """Find the zoom of a photo, by its picks (n,); None without a pose."""
    middle = diagnosis.survey.calibration.parameters[2:4]
    factor = _find_factor(diagnosis, seen, picks, ZOOM_FACTORS, middle)
    return None if factor is None else _Scale(factor, middle, 0.0)


def _find_copy(diagnosis: Diagnosis, seen: Adjustment, picks: Ints) -> _Scale | None:
    """Find the size of the copy in which picks (n,) of a photo were made; None without one."""
    size = _find_factor(diagnosis, seen, picks, COPY_SIZES, CORNER_PX)
    if size is None or not _find_reach(diagnosis.survey, picks) < size < LARGEST_COPY:
        return None
    return _Scale(size, CORNER_PX, 0.0)


def _enlarge_picks(survey: Survey, picks: Ints, scale: _Scale) -> SurveyCorrection:
    """Correct picks (n,) that were taken at another scale of the photo, where their errors were."""
    pixel = scale.fixed_px + (survey.pixel_px[picks] - scale.fixed_px) / scale.factor
    places = zip(picks.tolist(), pixel.tolist(), strict=True)
    return SurveyCorrection(
        pixel_of_pick={pick: (u, v) for pick, (u, v) in places},
        enlarged=dict.fromkeys(picks.tolist(), 1.0 / scale.factor),
    )


def _adjust_others(diagnosis: Diagnosis, frame: int) -> Diagnosis | None:
    """Adjust the survey without a photo, with all lengths; None without a result."""
    own = np.flatnonzero(diagnosis.survey.pick_frame == frame)
    return adjust_with_all(diagnosis, SurveyCorrection(without_picks=frozenset(own.tolist())))


def _improve_scale(diagnosis: Diagnosis, picks: Ints, scale: _Scale) -> _Scale | None:
    """Improve the scale of a photo by an adjustment with it, and a linear test.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    picks
        (n,) the photo's picks.
    scale
        Approximate scale.

    Returns
    -------
    None where the adjustment does not converge.
    """
    for _ in range(MAX_IMPROVEMENTS):
        after = adjust_with_all(diagnosis, _enlarge_picks(diagnosis.survey, picks, scale))
        if after is None or not after.adjustment.minimum.converged:
            return None
        small = after.adjustment.survey
        rows = np.flatnonzero(np.isin(after.refined.pick_index, picks))
        away = (small.pixel_px[rows] - scale.fixed_px) / small.pick_sigma_px[rows, None]
        change = (ObservationChange("pixels", rows, away[:, :, None]),)
        (test,) = compare_hypotheses(after.adjustment, [change], MIN_SHARE_OF_CAMERA)
        scale = scale._replace(
            factor=scale.factor * float(np.exp(np.clip(test.value[0], -0.2, 0.2))),
            gain=diagnosis.cost - after.cost + test.gain,
        )
        is_poor = scale.gain < 0.0 and test.gain < MIN_EXPLAINED_SHARE * after.cost
        if test.gain < MIN_IMPROVEMENT or is_poor:
            break
    return scale


def _find_reach(survey: Survey, picks: Ints) -> float:
    """Return the size of the smallest copy that contains some picks, as a share of the photo's."""
    size = [survey.calibration.width_px, survey.calibration.height_px]
    return float(((survey.pixel_px[picks] - CORNER_PX) / size).max())


def _find_strained_photos(diagnosis: Diagnosis) -> dict[int, float]:
    """Find photos of the survey that need a zoom of their own, and the gain."""
    adjustment = diagnosis.adjustment
    found = dict.fromkeys(find_misplaced_photos(diagnosis).tolist(), 0.0) | find_photos_against_log(
        diagnosis
    )
    if adjustment.minimum.converged:
        small = adjustment.survey
        middle = small.calibration.parameters[2:4]
        away = (small.pixel_px - middle) / small.pick_sigma_px[:, None]
        rows = [np.flatnonzero(small.pick_frame == k) for k in range(len(small.frame_id))]
        tests = compare_hypotheses(
            adjustment, [(ObservationChange("pixels", r, away[r, :, None]),) for r in rows]
        )
        index = {name: k for k, name in enumerate(diagnosis.survey.frame_id)}
        gains = {index[n]: t.gain for n, t in zip(small.frame_id, tests, strict=True)}
        found |= {
            k: gain for k, gain in gains.items() if gain > max(MIN_DECREASE, found.get(k, 0.0))
        }
    worst = sorted(found, key=lambda k: -found[k])[:MAX_PHOTOS]
    return {k: found[k] for k in worst}


def _find_factor(
    diagnosis: Diagnosis, seen: Adjustment, picks: Ints, factors: Floats, fixed_px: Floats
) -> float | None:
    """Find the factor of a photo's scale that fits points and log best; None without a pose.

    Parameters
    ----------
    diagnosis, seen
        The survey, and an adjustment with the points of the photo.
    picks
        (n,) the photo's picks.
    factors
        Ascending factors, in equal ratios.
    fixed_px
        (2,) pixel that all scales share.
    """
    survey = diagnosis.survey
    # Scale the pixels before the distortion is removed, as that belongs to the lens.
    pixel = fixed_px + (survey.pixel_px[picks] - fixed_px) / factors[:, None, None]
    sights = sight_adjusted_points(seen, survey, seen.label_rows(survey.label), picks, pixel)
    if len(sights.world_m) <= MIN_PICKS:
        return None
    center, whitening = _by_the_log(diagnosis, int(survey.pick_frame[picks[0]]))
    pose = sights.resect()
    off = sights.offsets(pose) * factors[:, None, None]
    cost = np.sum(off**2, axis=(1, 2)) + np.sum(((pose[0] - center) @ whitening.T) ** 2, axis=1)
    cost = np.where(np.isnan(cost), np.inf, cost)
    best = int(np.argmin(cost))
    if not 0 < best < len(factors) - 1 or not np.isfinite(cost[best - 1 : best + 2]).all():
        return None
    # vertex of the parabola through the three lowest
    low, middle, high = cost[best - 1 : best + 2]
    part = 0.5 * (low - high) / max(low - 2.0 * middle + high, 1e-12)
    return float(np.exp(np.log(factors[best]) + part * np.log(factors[1] / factors[0])))


def _by_the_log(diagnosis: Diagnosis, frame: int) -> tuple[Floats, Floats]:
    """Return a photo's camera position (3,) by the log, and its whitening.

    With the adjusted common biases; of a photo that was left out, with their uncertainty. All zeros
    where there is no log.
    """
    adjustment, survey = diagnosis.adjustment, diagnosis.survey
    names = adjustment.survey.frame_id
    block, telemetry = adjustment.minimum.blocks.get("telemetry"), adjustment.survey.telemetry
    name = survey.frame_id[frame]
    seeds = survey.seeds
    if seeds is not None and name not in names:
        own = np.linalg.inv(np.linalg.cholesky(seeds.covariance[frame, :3, :3]))
        return seeds.center_world_m[frame], np.asarray(own, dtype=np.float64)
    if block is None or telemetry is None or name not in names:
        return np.zeros(3), np.zeros((3, 3))
    at = names.index(name)
    row = int(np.flatnonzero(telemetry.frame_index == at)[0])
    white = adjustment.problem.telemetry_whitening[row]
    off = np.linalg.solve(white, block.residual[row])[:3]
    covariance = np.linalg.inv(white.T @ white)[:3, :3]
    own = np.asarray(np.linalg.inv(np.linalg.cholesky(covariance)), dtype=np.float64)
    stated = own * diagnosis.refined.pose_widened.get(name, 1.0)
    return adjustment.state.center[at] - off, stated


def _report_other_zoom(frame: str, factor: float, _: HypothesisTest | None) -> Message:
    text = (
        f"The photo {frame!r} was taken at another zoom, or with another camera, than the others: "
        "take it out, or give photos of each camera a project of their own. It fits where its "
        f"focal length is {factor:.2f} times the stated one."
    )
    return Message(
        "warning",
        "other-camera",
        text,
        frames=(frame,),
        several=MessagePlural(
            "{count} photos were taken at another zoom, or with another camera, than the others",
            f"{frame!r} ({factor:.2f} times the focal length)",
            ending="Take them out, or give photos of each camera a project of their own.",
        ),
    )


def _report_copy(frame: str, size: float, _: HypothesisTest | None) -> Message:
    text = (
        f"The photo {frame!r} seems to be picked in a copy of {size:.2f} times its size: its "
        "picks fit where they are enlarged. Pick it again in the original photo."
    )
    return Message(
        "warning",
        "photo-picked-in-copy",
        text,
        frames=(frame,),
        several=MessagePlural(
            "{count} photos seem to be picked in smaller copies",
            f"{frame!r} ({size:.2f} times its size)",
            ending="Pick them again in the original photos.",
        ),
    )


FIRST_DISTORTION_INDEX = 4
"""First coefficient of the distortion among the parameters of a camera."""

ZOOM_SIGMA, CENTRE_SIGMA, LENS_SIGMA = 0.4, 0.1, 0.2
"""Prior sigmas of another camera: of the factor of both focal lengths, of the principal
point as a share of the photo's width, and of the first two coefficients of the distortion."""

LARGEST_ZOOM = 4.0
"""Largest ratio of the focal lengths of two cameras of drones, or of two zooms of one."""

MIN_SHARE_OF_CAMERA = 1e-5
"""Least share of another camera that has to show in the residuals, as calibrations are exact."""


def propose_other_zoom_of_all(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose another focal length than the stated one, or picks in smaller copies."""
    yield from _propose_camera(diagnosis, zoom_direction, other_zoom_message)
    if _find_reach(diagnosis.survey, np.flatnonzero(diagnosis.taking.keep)) < LARGEST_COPY:
        yield from _propose_camera(diagnosis, _size_direction, _other_size_message)


def propose_other_camera_file(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose another focal length and principal point than the stated ones."""
    yield from _propose_camera(diagnosis, _frame_directions, _other_camera_message)


def propose_other_lens(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose another focal length and distortion than the stated ones."""
    yield from _propose_camera(diagnosis, _lens_directions, _other_lens_message)


def _propose_camera(
    diagnosis: Diagnosis,
    directions: Callable[[Calibration], Floats],
    describe: Callable[[Survey, HypothesisTest | None], Message],
) -> Iterator[Hypothesis]:
    """Propose another interior orientation for all photos, which may explain all the misfit.

    The linear test does not hold where all readings are bent by it.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    directions
        Function from the camera to (P,) or (P, q) directions of its interior orientation, each of
        the size of a prior sigma.
    describe
        Function from the survey and the result to the message.
    """
    adjustment, stated = diagnosis.adjustment, diagnosis.survey.calibration
    unknowns = directions(stated).reshape(len(stated.parameters), -1)
    if not adjustment.problem.layout.intrinsics or not unknowns.any(axis=0).all():
        return  # an exact camera, or a lens model without distortion
    yield Hypothesis(
        message=partial(describe, adjustment.survey),
        moved=(calibration_derivative(adjustment, unknowns),),
        checked=MIN_SHARE_OF_CAMERA,
        promise=adjustment.minimum.cost - _expect_squares(adjustment),
        settled=partial(_find_deviation, unknowns=unknowns),
        freed=partial(remove_camera_prior, unknowns),
        price=unknowns.shape[1] * GROSS_ERROR_LOG_ODDS,
    )


def _expect_squares(adjustment: Adjustment) -> float:
    """Return the expected sum of squares of an adjustment without mistakes."""
    return sum(compute_redundancy(adjustment, name) for name in adjustment.minimum.blocks)


def calibration_derivative(adjustment: Adjustment, unknowns: Floats) -> ObservationChange:
    """Return the derivative of the interior orientation's prior by unknowns (P, q)."""
    along: Floats = np.linalg.pinv(adjustment.problem.intrinsic_basis) @ unknowns
    return ObservationChange("calibration", np.arange(len(along)), -along[:, None])


def _find_deviation(adjustment: Adjustment, *, unknowns: Floats) -> tuple[Floats, Floats] | None:
    """Compute a camera's deviation from its file in units of unknowns (P, q), and covariance.

    None for a focal length that no other camera or zoom has.
    """
    problem, layout = adjustment.problem, adjustment.problem.layout
    to_unknowns = np.linalg.pinv(unknowns)
    to_state = to_unknowns @ problem.intrinsic_root(adjustment.state)
    covariance = adjustment.shared_covariance(layout.first_intrinsic, layout.intrinsics)
    stated = adjustment.survey.calibration.parameters
    value = to_unknowns @ (problem.intrinsics(adjustment.state) - stated)
    if not 1.0 / LARGEST_ZOOM < 1.0 + ZOOM_SIGMA * value[0] < LARGEST_ZOOM:
        return None
    return value, to_state @ covariance @ to_state.T


def remove_camera_prior(unknowns: Floats, survey: Survey) -> Survey:
    """Remove the prior of some combinations (P, q) of the interior orientation."""
    stated = survey.calibration
    covariance = stated.covariance + unknowns @ unknowns.T
    return replace(survey, calibration=replace(stated, covariance=covariance))


def zoom_direction(camera: Calibration) -> Floats:
    """Return the change (P,) of the interior orientation by a prior sigma of the zoom."""
    change = np.zeros(len(camera.parameters))
    change[:2] = ZOOM_SIGMA * camera.parameters[:2]
    return change


def _size_direction(camera: Calibration) -> Floats:
    """Return the change (P,) of the interior orientation with the size of the photos."""
    change = zoom_direction(camera)
    change[2:4] = ZOOM_SIGMA * camera.parameters[2:4]
    return change


def _lens_directions(camera: Calibration) -> Floats:
    """Return the changes (P, 3) by a prior sigma of the zoom, and of two distortion coefficients.

    The focal length of a calibration belongs to its distortion.
    """
    change = np.zeros((len(camera.parameters), 3))
    change[:, 0] = zoom_direction(camera)
    if len(camera.parameters) > FIRST_DISTORTION_INDEX + 1:
        change[FIRST_DISTORTION_INDEX, 1] = change[FIRST_DISTORTION_INDEX + 1, 2] = LENS_SIGMA
    return change


def _frame_directions(camera: Calibration) -> Floats:
    """Return the changes (P, 3) by a prior sigma of the zoom, and of the principal point."""
    change = np.zeros((len(camera.parameters), 3))
    change[:, 0] = zoom_direction(camera)
    change[2, 1] = change[3, 2] = CENTRE_SIGMA * camera.width_px
    return change


def other_zoom_message(survey: Survey, found: HypothesisTest | None) -> Message:
    """Report photos of another zoom.

    Parameters
    ----------
    survey
        Survey with the camera as stated.
    found
        Difference of its focal length, in units of `ZOOM_SIGMA`.
    """
    assert found is not None  # noqa: S101  (it is judged by its linear test)
    stated = float(survey.calibration.parameters[0])
    factor = 1.0 + ZOOM_SIGMA * float(found.value[0])
    sigma = ZOOM_SIGMA * float(np.sqrt(found.covariance[0, 0]))
    return zoom_message(survey.calibration.name, stated, factor, sigma)


def zoom_message(name: str, stated_px: float, factor: float, sigma: float) -> Message:
    """Report photos of another zoom.

    Parameters
    ----------
    name, stated_px
        Name of the camera; its stated focal length.
    factor, sigma
        Estimated factor of the focal length, and its sigma.
    """
    text = (
        f"These photos were taken at another zoom than is stated for the camera {name!r}: its "
        f"focal length would be {factor * stated_px:.0f} ± {sigma * stated_px:.0f} px, "
        f"{stated_px:.0f} px is stated. Look at zoom, focus and size of the "
        "photos, and calibrate the camera as it was used."
    )
    return Message("warning", "other-zoom", text)


def _describe_zoom(found: HypothesisTest) -> str:
    """Return the factor of the focal length, the first unknown, with its sigma."""
    factor = 1.0 + ZOOM_SIGMA * float(found.value[0])
    return f"{factor:.2f} ± {ZOOM_SIGMA * float(np.sqrt(found.covariance[0, 0])):.2f}"


def _other_size_message(survey: Survey, found: HypothesisTest | None) -> Message:
    """Report picks in copies of another size."""
    assert found is not None  # noqa: S101
    text = (
        f"The photos seem to be picked in copies of {_describe_zoom(found)} times their size: "
        f"focal length and principal point of the camera {survey.calibration.name!r} are of "
        "another size of photo. Pick in the original photos, or calibrate with photos of this size."
    )
    return Message("warning", "camera-contradicted", text)


def _other_lens_message(survey: Survey, _: HypothesisTest | None) -> Message:
    """Report the distortion of another lens."""
    text = (
        f"The values of the camera {survey.calibration.name!r} do not belong to these photos: they "
        "fit with the distortion of another lens. Check whether they are of this camera, and "
        "whether the photos were corrected already; calibrate the camera as it was used."
    )
    return Message("warning", "camera-contradicted", text)


def _other_camera_message(survey: Survey, found: HypothesisTest | None) -> Message:
    """Report another focal length and principal point."""
    assert found is not None  # noqa: S101
    camera = survey.calibration
    sigma = np.sqrt(found.covariance.diagonal())
    size = np.array([ZOOM_SIGMA * camera.parameters[0], *[CENTRE_SIGMA * camera.width_px] * 2])
    names = ("fx", "cx", "cy")
    said = ", ".join(
        f"{name} {stated + one * value:.0f} ± {one * s:.0f} px instead of {stated:.0f}"
        for name, stated, one, value, s in zip(
            names, camera.parameters[[0, 2, 3]], size, found.value, sigma, strict=True
        )
        if np.isfinite(s)
    )
    return Message(
        "warning",
        "camera-contradicted",
        f"The values of the camera {camera.name!r} do not belong to these photos: they fit with "
        f"{said}. Check whether they are of this camera, and whether the "
        "photos were cut, stabilised or made smaller; calibrate the camera as it was used.",
    )

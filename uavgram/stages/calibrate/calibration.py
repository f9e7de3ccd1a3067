"""Calibrate a camera from corners of a board: choose its lens model, and refuse two cameras.

The model has the best number of distortion coefficients that the photos determine, by predictions
of left-out photos (cross-validation) and by information criteria.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import (
    Fit,
    HeldOut,
    UndeterminedError,
    adjust,
    choose_simplest,
    compute_information_criteria,
    cross_validate,
)
from uavgram.estimation.calibration.network import detect_rolling_shutter
from uavgram.estimation.calibration.problem import Corners, State, make_lens, pad
from uavgram.estimation.calibration.projection import compute_length_sigmas
from uavgram.estimation.calibration.reliability import CleanedFit, remove_outliers
from uavgram.estimation.calibration.start import choose_better_pose, estimate_first_values
from uavgram.estimation.calibration.two_cameras import Split, find_best_split
from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.model.arrays import Bools, Floats
from uavgram.model.board import (
    BoardObservations,
    CalibrationOptions,
    CalibrationQuality,
    CalibrationResult,
    ModelScore,
    parameter_count,
)
from uavgram.model.camera import LensModel
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.stages.calibrate import assessment
from uavgram.stages.calibrate.remarks import remarks, shows_rolling_shutter

MODELS: dict[LensModel, tuple[int, ...]] = {"brown": (3, 5, 8), "fisheye": (4,)}
"""Numbers of coefficients, the simplest first."""

USUAL: dict[LensModel, int] = {"brown": 5, "fisheye": 4}


def start_staged(options: CalibrationOptions, corners: Corners, size_px: tuple[int, int]) -> State:
    """Compute first values for the requested options, with a plain lens and a flat board first.

    Rational lenses and bent boards have minima of their own far from the truth.

    Parameters
    ----------
    options
        Requested options.
    corners
        (M, n) corners of all photos.
    size_px
        Width and height of the image [px].
    """
    usual = USUAL[options.model]
    wanted = replace(options, coefficients=options.coefficients or usual)
    plain = replace(wanted, coefficients=min(wanted.coefficients, usual), bow="flat")
    lens = make_lens(plain)
    flat = replace(corners, bow=corners.bow[..., :0])
    known = None
    if plain.prior is not None and (np.diag(plain.prior.information)[:4] > 0).all():
        known = lens.prior_mean
    start = adjust(lens, flat, estimate_first_values(lens, flat, size_px, known)).state
    start = choose_better_pose(lens, flat, start)
    return extended(start, wanted, corners)


def extended(state: State, options: CalibrationOptions, corners: Corners) -> State:
    """Extend a state to the requested parameters and bow, with zeros.

    Parameters
    ----------
    state
        State with any number of coefficients.
    options
        Requested options.
    corners
        (M, n) corners of all photos.
    """
    parameters = np.zeros(parameter_count(options.model, options.coefficients))
    shared = min(len(parameters), len(state.parameters))
    parameters[:shared] = state.parameters[:shared]
    held = np.abs(make_lens(options).basis).sum(axis=1) == 0
    held[:4] = False  # a fixed principal point is unchanged
    parameters[held] = 0.0
    count = corners.bow.shape[2]
    bow = state.bow_m if len(state.bow_m) == count else np.zeros(count)
    return replace(state, parameters=parameters, bow_m=bow)


@dataclass(frozen=True, eq=False)
class Candidate:
    """Lens model with a certain number of coefficients.

    Attributes
    ----------
    coefficients
        Number of distortion coefficients.
    fit, held
        Its adjustment, and its prediction of left-out photos; None where the photos do not
        determine it.
    dropped
        Reason why it cannot be chosen; empty where it can.
    """

    coefficients: int
    fit: Fit | None
    held: HeldOut | None
    dropped: str = ""

    def score(self, sigma_px: float, *, is_chosen: bool) -> ModelScore:
        """Return figures of this model; `sigma_px` converts a whitened residual to pixels."""
        aic, bic = (None, None) if self.fit is None else compute_information_criteria(self.fit)
        known = self.held is not None and np.isfinite(self.held.factor)
        return ModelScore(
            coefficients=self.coefficients,
            aic=aic,
            bic=bic,
            held_out_px=float(np.sqrt(self.held.factor)) * sigma_px
            if known and self.held
            else None,
            is_chosen=is_chosen,
            dropped=self.dropped,
        )


def candidates(options: CalibrationOptions, corners: Corners, state: State) -> list[Candidate]:
    """Adjust every number of coefficients, the simplest first, and predict left-out photos.

    Parameters
    ----------
    options
        All options but the number of coefficients.
    corners
        Corners without outliers.
    state
        State with any number of coefficients.
    """
    found = []
    for coefficients in MODELS[options.model]:
        own = replace(options, coefficients=coefficients)
        try:
            fit = adjust(make_lens(own), corners, extended(state, own, corners))
            found.append(Candidate(coefficients, fit, cross_validate(fit)))
        except UndeterminedError as fault:
            found.append(Candidate(coefficients, None, None, str(fault)))
    return found


def choose(found: list[Candidate]) -> Candidate | None:
    """Return the fewest coefficients with an equally good prediction; None without a candidate."""
    left = [(one, one.held) for one in found if one.held is not None and not one.dropped]
    return left[choose_simplest([held for _, held in left])][0] if left else None


LARGEST_COST = 0.01
"""Largest relative sigma of a usual length due to the lens: ordinary calibrations have 0.0002 to
0.002, rational lenses with interchangeable coefficients 0.01 to 9."""


def choose_and_estimate(
    observations: BoardObservations, options: CalibrationOptions, corners: Corners
) -> tuple[assessment.AssessedCalibration, tuple[ModelScore, ...]]:
    """Estimate with the best number of coefficients that the photos determine.

    Parameters
    ----------
    observations
        Corners found in M photos.
    options
        Requested options.
    corners
        The corners, padded to one size (M, n).

    Raises
    ------
    UndeterminedError
        They determine none.
    """
    photo = observations.photos[0]
    cleaned = _remove_outliers(options, corners, (photo.width_px, photo.height_px))
    kept = cleaned.fit.corners.count > 0
    clean = cleaned.fit.corners.take(kept)
    sigma_px = float(np.sqrt(np.mean(clean.weight[clean.weight > 0] ** -2.0)))
    found = candidates(options, clean, cleaned.fit.state.take(kept))
    estimated: dict[int, assessment.AssessedCalibration] = {}
    best = choose(found)
    while best is not None:
        own = replace(options, coefficients=best.coefficients)
        start = extended(cleaned.fit.state, own, corners)
        try:
            judged = assessment.judge(
                observations, own, corners, remove_outliers(make_lens(own), corners, start, own)
            )
            estimated[own.coefficients], why = judged, _explain_rejection(judged)
        except UndeterminedError as fault:
            why = str(fault)
        if not why:
            break
        found = [replace(one, dropped=why) if one is best else one for one in found]
        best = choose(found)
    if not estimated:
        raise UndeterminedError(found[0].dropped)
    # Where none is good, take the simplest, with the fewest unknowns; the verdict rates it.
    chosen = min(estimated) if best is None else best.coefficients
    scores = (one.score(sigma_px, is_chosen=one.coefficients == chosen) for one in found)
    return estimated[chosen], tuple(scores)


def _remove_outliers(
    options: CalibrationOptions, corners: Corners, size_px: tuple[int, int]
) -> CleanedFit:
    """Remove outliers with the usual number of coefficients, or with as many as are determined."""
    usual = USUAL[options.model]
    *first, last = (usual, *(n for n in reversed(MODELS[options.model]) if n < usual))

    def clean(count: int) -> CleanedFit:
        own = replace(options, coefficients=count, outliers="remove")
        return remove_outliers(make_lens(own), corners, start_staged(own, corners, size_px), own)

    for count in first:
        with suppress(UndeterminedError):
            return clean(count)
    return clean(last)


def _explain_rejection(judged: assessment.AssessedCalibration) -> str:
    """Return the reason against a lens that fits; empty without one."""
    if not judged.fit.converged:
        return "its adjustment did not converge"
    try:
        cost = compute_length_sigmas(judged.camera("camera"), tilt_rad=0.0).medians[0]
    except GeometryError:  # it folds back all over the image
        return "hardly a pixel of it has a ray"
    if cost <= LARGEST_COST:
        return ""
    return f"the photos do not determine its coefficients: it alone would cost a length {cost:.1%}"


class _Level(NamedTuple):
    """Limits for a split into two cameras.

    Attributes
    ----------
    distance, decision
        Limits of the split's properties.
    total
        Distance times photos: few photos form two groups by chance.
    photos
        Photos in the smaller group.
    chance
        Probability of such a wide gap between the groups where one camera drifts evenly from one
        state to another (autofocus): its photos are spread evenly from -2 to 2 in units of
        `decision`, so all N stay farther than g from the middle with the probability (1 - g / 2)^N.
    """

    distance: float
    decision: float
    total: float
    photos: int
    chance: float

    def is_reached(self, split: Split) -> bool:
        """Return whether a split exceeds these limits."""
        count = len(split.group)
        return (
            split.distance >= max(self.distance, self.total / count)
            and split.decision >= max(self.decision, 2 * (1 - self.chance ** (1 / count)))
            and np.bincount(split.group).min() >= self.photos
        )


LIKELY = (_Level(0.8, 0.2, 10.0, 4, 0.05), _Level(6.0, 0.3, 0.0, 3, 1.0))
CERTAIN = (_Level(1.0, 0.3, 20.0, 5, 0.01), _Level(15.0, 0.3, 0.0, 3, 1.0))
"""Alternative limits for likely, and for certain splits. Among 900 simulated sets of 14 or 20
photos of one camera (rolling shutter of 2 px, autofocus within 1 %, stabilisation of 5 px, bent
boards) none reached `CERTAIN`, and one, with autofocus, `LIKELY`: less than one false refusal in
190 sets, at 99 %."""

BENT_SHARE = 0.03
"""Prior sigma of the bow, as a share of the board's length, where it is tested as the reason."""

MOST_NAMES = 20


def refuse_two_cameras(judged: assessment.AssessedCalibration) -> tuple[Message, ...]:
    """Warn of photos of two cameras where these are likely.

    Photos of one camera disagree too, where the board is bent, the camera moved or the lens is not
    of the model; but then they scatter about one camera, and do not form two groups. A bent board
    that was held in two ways would make two groups: its bow is freed first. Where rows drift within
    each group, the camera's motion explains groups that are not quite clear.

    Raises
    ------
    GeometryError
        Two cameras are certain: a common result describes neither.
    """
    if judged.effect.probability > assessment.PHOTO_FACTOR_SIGNIFICANCE:
        return ()
    try:
        fit = _adjust_bow(judged)
        split = find_best_split(fit)
        if split is None or not any(level.is_reached(split) for level in LIKELY):
            return ()
        alone = [_alone(fit, split.group == k) for k in (0, 1)]
    except UndeterminedError:  # a group does not determine a camera
        return ()
    is_certain = any(level.is_reached(split) for level in CERTAIN)
    together, *apart = (
        shows_rolling_shutter(detect_rolling_shutter(one, judged.size_px)) for one in (fit, *alone)
    )
    is_moved = any(apart)
    if not is_certain and (together or is_moved):
        return ()
    text = _words(judged, split, [one.state.parameters for one in alone])
    if is_certain and not is_moved:
        raise GeometryError(
            f"the photos are of two cameras (or two zooms, or focus settings): {text}. Calibrate "
            "each of the two by itself"
        )
    return (
        Message(
            "warning",
            "two-cameras",
            f"The photos may be of two cameras (or two zooms, or focus settings): {text}. If they "
            "are, calibrate each of the two by itself; otherwise hold focus, zoom and camera "
            "still, and switch stabilisation off.",
        ),
    )


def _adjust_bow(judged: assessment.AssessedCalibration) -> Fit:
    """Adjust with a free bow of the board."""
    if judged.options.bow == "paraboloid":
        return judged.fit
    length_m = float(np.ptp(judged.observations.board.corner_board_m, axis=0).max())
    sigma_m = max(judged.options.bow_sigma_m, BENT_SHARE * length_m)
    options = replace(judged.options, bow="paraboloid", bow_sigma_m=sigma_m)
    shape = pad(judged.observations, "paraboloid").bow[_in_fit(judged)]
    corners = replace(judged.fit.corners, bow=shape)
    return adjust(make_lens(options), corners, extended(judged.fit.state, options, corners))


def _in_fit(judged: assessment.AssessedCalibration) -> Bools:
    """Mark the usable photos (M,) in the adjustment."""
    return np.asarray(judged.snooped.fit.corners.count > 0)


def _alone(fit: Fit, photos: Bools) -> Fit:
    """Adjust some of the photos, with the board's shape from all of them."""
    count = len(fit.lens.basis)
    lens = replace(
        fit.lens,
        prior_mean=fit.lens.prior_mean[:count],
        prior_information=fit.lens.prior_information[:count, :count],
    )
    corners = fit.corners.take(photos)
    bent = corners.board_m.copy()
    bent[..., 2] += corners.bow @ fit.state.bow_m
    corners = replace(corners, board_m=bent, bow=corners.bow[..., :0])
    start = replace(fit.state.take(photos), bow_m=np.zeros(0))
    return adjust(lens, corners, start)


def _words(judged: assessment.AssessedCalibration, split: Split, cameras: list[Floats]) -> str:
    files = [photo.file for photo in np.array(judged.observations.photos)[_in_fit(judged)]]
    first, second = (_names(files, split.group == k) for k in (0, 1))
    one, other = cameras
    return (
        f"{first} ask for a focal length of {one[0]:.1f} px and a principal point of "
        f"{one[2]:.1f}, {one[3]:.1f}; {second} for {other[0]:.1f} px and {other[2]:.1f}, "
        f"{other[3]:.1f}"
    )


def _names(files: list[str], chosen: Bools) -> str:
    """List first and last of neighbours; all of others, up to a limit."""
    rows = np.flatnonzero(chosen)
    if np.ptp(rows) == len(rows) - 1:
        return f"{files[rows[0]]} to {files[rows[-1]]} ({len(rows)} photos)"
    return join_names((files[i] for i in rows), MOST_NAMES)


def calibrate(
    observations: BoardObservations, options: CalibrationOptions, name: str = "camera"
) -> CalibrationResult:
    """Estimate a camera from photos of a board.

    Parameters
    ----------
    observations
        Corners found, of one camera.
    options
        Parameters to estimate, and method.
    name
        Name of the camera.

    Raises
    ------
    GeometryError
        The photos do not determine the camera, and the message names the missing ones; or they are
        of two cameras, and it names the photos of each.
    """
    observations, left_out = assessment.usable_photos(observations)
    corners = pad(observations, options.bow)
    judged, models = _estimate(observations, options, corners)
    about_cameras = refuse_two_cameras(judged)
    camera = judged.camera(name)
    p = len(camera.parameters)
    result = CalibrationResult(
        calibration=camera,
        covariance_given_sigma=judged.fit.parameter_covariance(judged.snooped.sigma_scale**-2)[
            :p, :p
        ],
        covariance_corners=judged.fit.parameter_covariance()[:p, :p],
        options=judged.options,
        board=observations.board,
        bow_m=judged.fit.state.bow_m,
        bow_covariance_m2=judged.fit.parameter_covariance(judged.factor)[p:, p:],
        corners=assessment.corner_results(judged),
        photos=assessment.photo_results(judged, left_out),
        quality=_quality(judged),
        models=models,
        maps=assessment.image_maps(judged, camera),
        messages=(),
    )
    return replace(result, messages=(*about_cameras, *remarks(judged, result)))


def _estimate(
    observations: BoardObservations, options: CalibrationOptions, corners: Corners
) -> tuple[assessment.AssessedCalibration, tuple[ModelScore, ...]]:
    """Adjust with the requested number of coefficients, or with the best one."""
    if not options.coefficients:
        return choose_and_estimate(observations, options, corners)
    photo = observations.photos[0]
    start = start_staged(options, corners, (photo.width_px, photo.height_px))
    judged = assessment.judge(
        observations, options, corners, remove_outliers(make_lens(options), corners, start, options)
    )
    own = Candidate(options.coefficients, judged.fit, judged.held)
    return judged, (own.score(judged.sigma_px, is_chosen=True),)


def _quality(judged: assessment.AssessedCalibration) -> CalibrationQuality:
    fit, held = judged.fit, judged.held.factor
    redundancy = max(fit.corner_redundancy, 1.0)
    squares = fit.corner_cost * judged.snooped.sigma_scale**2
    effect = judged.effect
    return CalibrationQuality(
        sigma_scale=judged.snooped.sigma_scale,
        sigma_px=judged.sigma_px,
        variance_factor=squares / redundancy,
        chi2_probability=compute_upper_tail(squares, redundancy),
        degrees_of_freedom=fit.degrees_of_freedom,
        photo_factor=effect.factor if np.isfinite(effect.factor) else None,
        photo_probability=effect.probability,
        held_out_px=float(np.sqrt(held)) * judged.sigma_px if np.isfinite(held) else None,
        iterations=fit.iterations,
        converged=fit.converged,
    )

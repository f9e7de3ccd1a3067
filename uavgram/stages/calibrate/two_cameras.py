"""Detect photos of two cameras (or zooms, or focus settings) in one calibration."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.calibration.adjustment import Fit, UndeterminedError, adjust
from uavgram.estimation.calibration.network import detect_rolling_shutter
from uavgram.estimation.calibration.problem import make_lens, pad
from uavgram.estimation.calibration.two_cameras import Split, find_best_split
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message
from uavgram.model.naming import listed
from uavgram.stages.calibrate.assessment import PHOTO_FACTOR_SIGNIFICANCE, AssessedCalibration
from uavgram.stages.calibrate.model_choice import extended
from uavgram.stages.calibrate.remarks import shows_rolling_shutter


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


def refuse_two_cameras(judged: AssessedCalibration) -> tuple[Message, ...]:
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
    if judged.effect.probability > PHOTO_FACTOR_SIGNIFICANCE:
        return ()
    try:
        fit = _with_bow(judged)
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


def _with_bow(judged: AssessedCalibration) -> Fit:
    """Adjust with a free bow of the board."""
    if judged.options.bow == "paraboloid":
        return judged.fit
    length_m = float(np.ptp(judged.observations.board.corner_board_m, axis=0).max())
    sigma_m = max(judged.options.bow_sigma_m, BENT_SHARE * length_m)
    options = replace(judged.options, bow="paraboloid", bow_sigma_m=sigma_m)
    shape = pad(judged.observations, "paraboloid").bow[_in_fit(judged)]
    corners = replace(judged.fit.corners, bow=shape)
    return adjust(make_lens(options), corners, extended(judged.fit.state, options, corners))


def _in_fit(judged: AssessedCalibration) -> Bools:
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


def _words(judged: AssessedCalibration, split: Split, cameras: list[Floats]) -> str:
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
    return listed((files[i] for i in rows), MOST_NAMES)

"""Hypothesis that several points were moved together between the photos, as those of a car.

The photos before and after show two epochs of the points. As in a congruence test of deformation
analysis (Caspary 1987, "Concepts of network and deformation analysis", ch. 5), points that fit a
common shift and rotation are one object that was moved, and all others keep their places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, gammaln

from uavgram.estimation.reliability.hypotheses import (
    HypothesisTest,
    ObservationChange,
    compare_hypotheses,
    compute_log_probability,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message
from uavgram.model.naming import format_digits, join_names, join_photo_names
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    Diagnosis,
    Hypothesis,
    correct_participants,
    name_moved,
)
from uavgram.stages.refine.minima import FULL, adjust_on_trial

STEP_M = 0.01
"""Step [m] for the derivatives of pixels by the place of a point."""

MOTION_SIZE = 3
"""Number of unknowns of a motion on the ground: a shift to the east and north, and a rotation."""

LEAST_MOVED = 2
"""Least number of points that show a common motion; a single one may as well be a wrong pick."""

LEAST_DECREASE = 2.0 * GROSS_ERROR_LOG_ODDS
"""Decrease of the sum of squares that each point has to add to those that were moved."""

MAX_PHOTOS, MAX_TESTED, MAX_BEGUN = 30, 12, 6
"""Largest number of photos between which a motion is looked for; number of points, those that fit
worst, that are tested to be moved with others; and number of these with which the selection begins.
"""

MAX_PROPOSED = 3
"""Number of photos from which on the points may have been moved, the most promising ones."""

LOG_SIGNIFICANCE, MAX_MISFIT = float(np.log(0.001)), float(chdtri(2, 0.001))
"""Logarithm of the probability below which points were not moved together; and squared misfit of a
point of that probability."""


_Complexes: TypeAlias = NDArray[np.complex128]


class _Moved(NamedTuple):
    """Points that may have been moved together.

    Attributes
    ----------
    label
        Labels (m,) of the adjustment.
    is_later
        (P,) picks of the adjustment in the photos after the motion.
    gain
        Decrease of the sum of squares in the linear model.
    choices
        Number of points that both parts of the photos show.
    """

    label: tuple[int, ...]
    is_later: Bools
    gain: float
    choices: int

    @property
    def price(self) -> float:
        """Logarithm of the odds against this motion of these points."""
        m, n = len(self.label), self.choices
        subsets = gammaln(n + 1) - gammaln(m + 1) - gammaln(n - m + 1)
        return MOTION_SIZE * GROSS_ERROR_LOG_ODDS + float(subsets)


def propose_moved_points(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that several points were moved together between two photos."""
    adjustment, survey = diagnosis.adjustment, diagnosis.survey
    splits = len(adjustment.survey.frame_id) - 1
    if not 0 < splits < MAX_PHOTOS:
        return
    along = _compute_derivatives(adjustment)
    found = (_find_moved(adjustment, along, first) for first in range(1, splits + 1))
    promising = sorted(
        (one for one in found if one is not None and one.gain > 2.0 * one.price),
        key=lambda one: 2.0 * one.price - one.gain,
    )
    for one in promising[:MAX_PROPOSED]:
        names = [adjustment.survey.label[k] for k in one.label]
        names = _choose_by_motion(diagnosis, names, one.is_later)
        if len(names) < LEAST_MOVED:
            continue
        apart, kept = _divide_picks(diagnosis, names, one.is_later)
        yield Hypothesis(
            message=partial(_moved_message, survey, names, apart, kept),
            mend=_set_apart(survey, apart),
            equal=(_set_apart(survey, kept),),
            is_clear=False,
            begun=lambda state: state,
            settled=partial(_fit_motion, names=names),
            promise=one.gain,
            price=one.price + float(np.log(splits)),
            settles=frozenset(survey.frame_id[k] for k in survey.pick_frame[apart]),
        )


def _divide_picks(diagnosis: Diagnosis, names: Sequence[str], is_later: Bools) -> tuple[Ints, Ints]:
    """Divide the picks of points by their two places: the fewer, and the others.

    The part with more picks shows the points better; nothing shows which one is asked for.
    """
    survey = diagnosis.adjustment.survey
    own = np.isin(survey.pick_label, diagnosis.adjustment.label_rows(names))
    parts = (diagnosis.refined.pick_index[own & part] for part in (is_later, ~is_later))
    fewer, more = sorted(parts, key=len)
    return fewer, more


def _choose_by_motion(diagnosis: Diagnosis, names: Sequence[str], is_later: Bools) -> list[str]:
    """Choose those of some points that were moved together, by an adjustment with two places each.

    In a scene that is distorted by the motion the linear model selects others with them.
    """
    apart, _ = _divide_picks(diagnosis, names, is_later)
    taking = correct_participants(diagnosis, _set_apart(diagnosis.survey, apart))
    refined = adjust_on_trial(taking, FULL)
    if refined is None:
        return []
    pairs = _pair_places(refined.adjustment, names)
    if len(pairs.names) < LEAST_MOVED:
        return []
    best: list[int] = []
    for pair in combinations(range(len(pairs.names)), 2):
        turn, shift = _fit_rigid(pairs, list(pair))
        off = pairs.compute_misfits(turn, shift)
        agree = np.flatnonzero((off < MAX_MISFIT) & (pairs.compute_misfits(1.0, 0.0) > MAX_MISFIT))
        best = max(best, agree.tolist(), key=len)
    # Points of free height without a second place cannot be tested.
    alike = {pairs.names[k] for k in best}
    return [one for one in names if alike and (one in alike or one not in pairs.names)]


def _set_apart(survey: Survey, picks: Ints) -> SurveyCorrection:
    """Set picks apart that show their points at another place.

    Those of a point of free height in one photo are left out: they do not determine its place.
    """
    label, frame = survey.pick_label[picks], survey.pick_frame[picks]
    photos = {k: len(np.unique(frame[label == k])) for k in np.unique(label).tolist()}
    is_placed = np.array([photos[k] > 1 or not survey.is_free[k] for k in label.tolist()])
    return SurveyCorrection(
        apart=frozenset(picks[is_placed].tolist()),
        without_picks=frozenset(picks[~is_placed].tolist()),
    )


def _compute_derivatives(adjustment: Adjustment) -> Floats:
    """Compute the derivatives (P, 2, 2) of the whitened picks by the points' east and north."""
    survey, state = adjustment.survey, adjustment.state
    frame = survey.pick_frame
    world, _, _ = adjustment.problem.world_points(state, survey.pick_label)
    poses = RowPoses(state.center[frame], state.rotation[frame], adjustment.sweep()[frame])
    lens, camera = adjustment.problem.intrinsics(state), survey.calibration
    steps = STEP_M * np.eye(3)[:2]
    both = [
        project_rows(camera, lens, poses, world + step)
        - project_rows(camera, lens, poses, world - step)
        for step in steps
    ]
    along = np.stack(both, axis=-1) / (2.0 * STEP_M) / survey.pick_sigma_px[:, None, None]
    return np.nan_to_num(along)


def _find_moved(adjustment: Adjustment, along: Floats, first: int) -> _Moved | None:
    """Find the points that were moved before a photo, by stepwise selection in the linear model.

    The photos alone show only a motion of the points against each other: those that moved are fewer
    than those that stayed.

    Parameters
    ----------
    adjustment
        The survey with all points at one place each.
    along
        (P, 2, 2) derivatives of the picks by the places of their points.
    first
        First photo after the motion.
    """
    survey = adjustment.survey
    is_later, count = survey.pick_frame >= first, len(survey.label)
    seen = [np.bincount(survey.pick_label[part], minlength=count) for part in (is_later, ~is_later)]
    in_both = np.flatnonzero((seen[0] > 0) & (seen[1] > 0)).tolist()

    def compute_gains(sets: Sequence[Sequence[int]]) -> list[float]:
        changes = [(_shift(survey, along, labels, is_later),) for labels in sets]
        return [one.gain for one in compare_hypotheses(adjustment, changes)]

    def add_points(moved: list[int]) -> list[int]:
        """Add the point that explains most, until none explains much."""
        (gain,) = compute_gains([moved])
        while 2 * len(moved) < len(in_both):
            others = [label for label in tested if label not in moved][:MAX_TESTED]
            gains = compute_gains([[*moved, label] for label in others])
            best = int(np.argmax(gains))
            if gains[best] < gain + LEAST_DECREASE:
                break
            moved, gain = [*moved, others[best]], gains[best]
        return moved

    def drop_points(moved: list[int]) -> _Moved | None:
        """Drop points that explain little once the others were selected."""
        (gain,) = compute_gains([moved])
        while len(moved) >= LEAST_MOVED:
            without = [[one for one in moved if one != label] for label in moved]
            gains = compute_gains(without)
            best = int(np.argmax(gains))
            if gains[best] < gain - LEAST_DECREASE:
                return _Moved(tuple(moved), is_later, gain, len(in_both))
            moved, gain = without[best], gains[best]
        return None

    alone = dict(zip(in_both, compute_gains([[label] for label in in_both]), strict=True))
    tested = sorted(in_both, key=lambda label: -alone[label])
    # In a distorted scene the point that explains most may not be one of those that were moved.
    begun = [label for label in tested if alone[label] > LEAST_DECREASE][:MAX_BEGUN]
    found = filter(None, (drop_points(add_points([label])) for label in begun))
    return max(found, key=lambda one: one.gain - LEAST_DECREASE * len(one.label), default=None)


def _shift(
    survey: Survey, along: Floats, labels: Sequence[int], is_later: Bools
) -> ObservationChange:
    """Return the effect of a shift of each of some points on the later picks."""
    rows = np.flatnonzero(is_later & np.isin(survey.pick_label, labels))
    column = np.searchsorted(np.sort(labels), survey.pick_label[rows])
    shifted = np.zeros((len(rows), 2, len(labels), 2))
    shifted[np.arange(len(rows)), :, column] = along[rows]
    return ObservationChange("pixels", rows, shifted.reshape(len(rows), 2, -1))


class _Places(NamedTuple):
    """Points with two places, as complex numbers east + i north [m].

    Attributes
    ----------
    names
        (n,) names of the points.
    before, after
        (n,) their two places.
    covariance
        (4n, 4n) of east and north of all first places, then of all second ones.
    """

    names: list[str]
    before: _Complexes
    after: _Complexes
    covariance: Floats

    def compute_difference_covariance(self, turn: complex) -> Floats:
        """Compute the covariance (2n, 2n) of second places minus rotated first ones."""
        rotation = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
        count = len(self.names)
        difference = np.hstack([-np.kron(np.eye(count), rotation), np.eye(2 * count)])
        return np.asarray(difference @ self.covariance @ difference.T)

    def compute_misfits(self, turn: complex, shift: complex) -> Floats:
        """Compute the squared misfits (n,) of a motion at each point, in its own covariance."""
        away = self.after - turn * self.before - shift
        off = np.stack([away.real, away.imag], axis=1)
        count = len(self.names)
        spread = self.compute_difference_covariance(turn).reshape(count, 2, count, 2)
        own = spread[np.arange(count), :, np.arange(count), :]
        return np.asarray(np.einsum("nr,nr->n", off, np.linalg.solve(own, off[..., None])[..., 0]))


def _pair_places(adjustment: Adjustment, names: Sequence[str]) -> _Places:
    """Return both places of points; those of free height may have none by one photo."""
    row = np.array([adjustment.label_rows([one, name_moved(one)]) for one in names])
    is_placed = (row >= 0).all(axis=1)
    own = [one for one, placed in zip(names, is_placed, strict=True) if placed]
    place, covariance = adjustment.joint_points(row[is_placed].T.ravel())
    plane = (3 * np.arange(len(place))[:, None] + np.arange(2)).ravel()
    before, after = np.split(place[:, :2] @ np.array([1.0, 1.0j]), 2)
    return _Places(own, before, after, covariance[np.ix_(plane, plane)])


def _fit_rigid(pairs: _Places, some: Sequence[int]) -> tuple[complex, complex]:
    """Fit the rotation, as a complex number of size one, and the shift of some points."""
    z, w = pairs.before[some], pairs.after[some]
    turn = complex(np.sum((w - w.mean()) * (z - z.mean()).conj()))
    turn /= abs(turn) or 1.0
    return turn, complex(w.mean() - turn * z.mean())


def _fit_motion(adjustment: Adjustment, names: Sequence[str]) -> tuple[Floats, Floats] | None:
    """Fit the motion (3,) of points: shift of their middle [m] and rotation, and its covariance.

    Parameters
    ----------
    adjustment
        Adjustment with two places of each point.
    names
        Names of the points.

    Returns
    -------
    None where the points were not moved together.
    """
    pairs = _pair_places(adjustment, names)
    count = len(pairs.names)
    if count < LEAST_MOVED:
        return None
    turn, shift = _fit_rigid(pairs, range(count))
    away = pairs.after - turn * pairs.before - shift
    turned = turn * (pairs.before - pairs.before.mean())
    # One Gauss-Newton step from there, with the covariance of the places.
    design = np.zeros((2 * count, MOTION_SIZE))
    design[0::2, 0] = design[1::2, 1] = 1.0
    design[0::2, 2], design[1::2, 2] = -turned.imag, turned.real
    misfit = np.stack([away.real, away.imag], axis=1).ravel()
    weight = np.linalg.pinv(pairs.compute_difference_covariance(turn), hermitian=True)
    normal = np.linalg.pinv(design.T @ weight @ design, hermitian=True)
    step = normal @ (design.T @ weight @ misfit)
    rest = misfit - design @ step
    squares, degrees = float(rest @ weight @ rest), 2 * count - MOTION_SIZE
    if compute_log_probability(squares, degrees) < LOG_SIGNIFICANCE:
        return None
    middle = complex((pairs.after - pairs.before).mean())
    return np.array([middle.real, middle.imag, np.angle(turn)]) + step, normal


def _moved_message(
    survey: Survey,
    names: Sequence[str],
    apart: Ints,
    kept: Ints,
    found: HypothesisTest | None,
) -> Message:
    """Report points that were moved together, and the photos that show them at each place."""
    there, here = (
        [survey.frame_id[k] for k in np.unique(survey.pick_frame[part])] for part in (apart, kept)
    )
    size = ""
    if found is not None and len(found.value) == MOTION_SIZE:
        shift_m = float(np.linalg.norm(found.value[:2]))
        toward = found.value[:2] / max(shift_m, STEP_M)
        sigma_m = float(np.sqrt(toward @ found.covariance[:2, :2] @ toward))
        degrees = np.degrees(found.value[2])
        size = f" by {shift_m:.2f} ± {format_digits(sigma_m, 1)} m and {abs(degrees):.0f} degrees"
    return Message(
        "warning",
        "points-moved",
        f"The points {join_names(map(repr, names))} were moved together{size} between the photos, "
        f"as when a car is moved: in {join_photo_names(there)} they are elsewhere than in "
        f"{join_photo_names(here)}. Only their picks in {join_photo_names(here)} are used. Give "
        "them other labels in the other photos, or pick them again if nothing was moved.",
        frames=tuple(there),
        labels=tuple(names),
    )

"""Hypothesis that several points were moved together between the photos, as those of a car.

The photos before and after show two epochs of the points. As in a congruence test of deformation
analysis (Caspary 1987, "Concepts of network and deformation analysis", ch. 5), points that fit a
common shift and rotation are one object that was moved, and all others keep their places.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, gammaln

from uavgram.estimation.reliability.hypotheses import (
    HypothesisTest,
    compute_gains,
    compute_log_probability,
    derive_picks_by_place,
    invert_information,
)
from uavgram.estimation.solver.normal_equations import compute_gradient
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message
from uavgram.model.naming import join_names, join_photo_names
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    Diagnosis,
    Hypothesis,
    correct_participants,
    name_moved,
)
from uavgram.stages.refine.minima import Patience, adjust_on_trial

LEAST_SHIFT_M = 0.01
"""Shift [m] below which the direction of a motion is of no interest."""

MOTION_SIZE = 3
"""Number of unknowns of a motion on the ground: a shift to the east and north, and a rotation."""

LEAST_MOVED, LEAST_PICKS = 2, 3
"""Least number of points that show a common motion, as a single one may as well be a wrong pick;
and of picks that show them elsewhere, as two wrong ones often agree by chance."""

MOVED_LOG_ODDS = float(np.log(20.0))
"""Logarithm of the odds against anything being moved, without other evidence."""

LEAST_DECREASE = 2.0 * GROSS_ERROR_LOG_ODDS
"""Decrease of the sum of squares that each point has to add to those that were moved."""

MAX_PHOTOS, MAX_PICKS = 30, 1000
"""Largest number of photos between which a motion is looked for; and of picks of the points that
fit worst, which are examined."""

MAX_TESTED, MAX_BEGUN = 12, 6
"""Number of points, the likeliest ones, that are tested to be moved with others; and number of
these with which the selection begins."""

MAX_COST_SHARE = 0.5
"""Share of the sum of squares that may remain with two places of each point that was moved."""

MAX_ROUNDS = 4
"""Largest number of adjustments that choose the points that were moved."""

MAX_PROPOSED = 3
"""Number of parts of the photos, the most promising ones, that may show the points elsewhere."""

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
    is_apart
        (F,) photos that show them elsewhere than the other photos do.
    gain
        Decrease of the sum of squares in the linear model.
    choices
        Number of points that both parts of the photos show.
    """

    label: tuple[int, ...]
    is_apart: Bools
    gain: float
    choices: int

    @property
    def key(self) -> tuple[frozenset[int], bytes]:
        """Points and photos."""
        return frozenset(self.label), self.is_apart.tobytes()

    @property
    def surplus(self) -> float:
        """Decrease of the sum of squares beyond the price."""
        price = _compute_price(len(self.label), self.choices, len(self.is_apart))
        return self.gain - 2.0 * price


def propose_moved_points(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that several points were moved together between the photos."""
    adjustment = diagnosis.adjustment
    count = len(adjustment.survey.frame_id)
    if not 1 < count <= MAX_PHOTOS:
        return
    search = begin_search(adjustment)
    # Each photo alone, and all from each photo on. The first photo is always one of the others.
    alone, from_on = np.eye(count, dtype=np.bool_), np.triu(np.ones((count, count), dtype=np.bool_))
    parts = [*alone[1:], ~alone[0], *from_on[2:-1]] if count > 2 else [alone[1]]
    each = (search.divide(is_apart).find_points() for is_apart in parts)
    found = [one for one in each if one is not None]
    found.sort(key=lambda one: -one.surplus)
    improved = {one.key: one for one in map(search.improve_photos, found[:MAX_PROPOSED])}
    goal = MAX_COST_SHARE * adjustment.minimum.cost
    for one in improved.values():
        if one.gain > adjustment.minimum.cost - goal and one.surplus > 0.0:
            names = [adjustment.survey.label[k] for k in one.label]
            photos = frozenset(np.array(adjustment.survey.frame_id)[one.is_apart].tolist())
            yield from _propose(diagnosis, names, photos, goal, one.gain)


def propose_moved_left_out(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that picks were left out because they show points that were moved."""
    survey, refined = diagnosis.survey, diagnosis.refined
    left = [k for k, why in refined.pick_reason.items() if why.cause is LeftOutCause.GROSS]
    label = np.intersect1d(survey.pick_label[left], survey.pick_label[refined.pick_index])
    photos = frozenset(survey.frame_id[k] for k in survey.pick_frame[left])
    if len(label) >= LEAST_MOVED and 1 < len(survey.frame_id) <= MAX_PHOTOS:
        names = [survey.label[k] for k in label]
        yield from _propose(diagnosis, names, photos, diagnosis.cost, 0.0)


def _propose(
    diagnosis: Diagnosis, names: Sequence[str], photos: frozenset[str], goal: float, gain: float
) -> Iterator[Hypothesis]:
    """Propose that those of some points that show one motion were moved before some photos.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    names, photos
        The points; and the photos that may show them elsewhere than the others do.
    goal
        Sum of squares that an adjustment with two places of each point has to reach.
    gain
        Expected decrease of the sum of squares.
    """
    survey = diagnosis.survey
    names = _choose_by_motion(diagnosis, names, photos, goal)
    if len(names) < LEAST_MOVED:
        return
    names.sort(key=survey.row_of_label.__getitem__)
    fewer, more = _divide_picks(diagnosis, names, photos)
    if len(fewer) < LEAST_PICKS:
        return
    apart, kept = (SurveyCorrection(apart=frozenset(one.tolist())) for one in (fewer, more))
    yield Hypothesis(
        message=partial(_moved_message, survey, names, fewer, more),
        mend=apart,
        equal=(kept,),
        is_clear=False,
        back=kept.apart,
        begun=lambda state: state,
        settled=partial(_fit_motion, names=names),
        promise=gain,
        price=_compute_price(len(names), len(survey.label), len(survey.frame_id)),
        settles=frozenset(survey.frame_id[k] for k in survey.pick_frame[fewer]),
    )


def _compute_price(moved: int, points: int, photos: int) -> float:
    """Compute the logarithm of the odds against a motion of some points between some photos."""
    subsets = gammaln(points + 1) - gammaln(moved + 1) - gammaln(points - moved + 1)
    # The photos may be in any order.
    parts = (photos - 1) * np.log(2.0)
    return MOVED_LOG_ODDS + MOTION_SIZE * GROSS_ERROR_LOG_ODDS + float(subsets + parts)


def _divide_picks(
    diagnosis: Diagnosis, names: Sequence[str], photos: frozenset[str]
) -> tuple[Ints, Ints]:
    """Divide the picks of points by their two places: the fewer, and the others.

    The part with more picks shows the points better; nothing shows which one is asked for.
    """
    survey, some = diagnosis.survey, diagnosis.spoilt
    some[diagnosis.refined.pick_index] = True
    some &= np.isin(survey.pick_label, [survey.row_of_label[name] for name in names])
    is_apart = np.isin(survey.frame_id, list(photos))[survey.pick_frame]
    fewer, more = sorted((np.flatnonzero(some & part) for part in (is_apart, ~is_apart)), key=len)
    return fewer, more


def _choose_by_motion(
    diagnosis: Diagnosis, names: Sequence[str], photos: frozenset[str], goal: float
) -> list[str]:
    """Choose those of some points that were moved together, by adjustments with two places each.

    In a scene that is distorted by the motion the linear model selects others with them; without
    these, the next adjustment is nearer to the truth.
    """
    chosen, alike = list(names), list[str]()
    for _ in range(MAX_ROUNDS):
        fewer, more = (frozenset(one.tolist()) for one in _divide_picks(diagnosis, chosen, photos))
        taking = correct_participants(diagnosis, SurveyCorrection(apart=fewer), more)
        refined = adjust_on_trial(taking, Patience(goal=goal))
        if refined is None or refined.adjustment.minimum.cost > goal:
            return []
        adjusted = refined.adjustment
        alike = _find_common_motion(adjusted, chosen)
        parts = begin_search(adjusted).divide(np.isin(adjusted.survey.frame_id, list(photos)))
        order, gains = parts.rank_points()
        likely = parts.label[order[gains > LEAST_DECREASE][:MAX_BEGUN]]
        others = [adjusted.survey.label[k] for k in likely.tolist()]
        if len(alike) < LEAST_MOVED or set(chosen) == {*alike, *others}:
            break
        chosen = [*alike, *others]
    return alike


def _find_common_motion(adjustment: Adjustment, names: Sequence[str]) -> list[str]:
    """Find the most points with one motion other than none, by the motions of all pairs."""
    pairs = _pair_places(adjustment, names)
    has_moved = pairs.compute_misfits(1.0, 0.0) > MAX_MISFIT
    best: list[int] = []
    for pair in combinations(range(len(pairs.names)), 2):
        off = pairs.compute_misfits(*_fit_rigid(pairs, list(pair)))
        best = max(best, np.flatnonzero((off < MAX_MISFIT) & has_moved).tolist(), key=len)
    return [pairs.names[k] for k in best]


@dataclass(frozen=True, eq=False)
class _Search:
    """Search for moved points, by stepwise selection in the linear model.

    The photos alone show only a motion of the points against each other: those that moved are fewer
    than those that stayed.

    Attributes
    ----------
    label, frame
        (P,) labels and photos of the picks of the points that fit worst.
    score, information
        (P, 2), (P, 2, P, 2): the test of a shift east and north of the point of each pick in that
        pick alone (see `compare_hypotheses`); of several, their sums.
    plain
        (P, 2) squares of the derivatives of each pick.
    """

    label: Ints
    frame: Ints
    score: Floats
    information: Floats
    plain: Floats

    def divide(self, is_apart: Bools) -> _Parts:
        """Sum the tests of each point's picks in some (F,) photos, if others show it, too."""
        there, count = is_apart[self.frame], int(self.label.max(initial=-1)) + 1
        seen = [np.bincount(self.label[part], minlength=count) for part in (there, ~there)]
        both = np.flatnonzero((seen[0] > 0) & (seen[1] > 0))
        member = ((self.label == both[:, None]) & there).astype(np.float64)
        half = np.tensordot(member, self.information, axes=(1, 0))
        information = np.tensordot(half, member, axes=(2, 1)).transpose(0, 1, 3, 2)
        return _Parts(is_apart, both, member @ self.score, information, member @ self.plain)

    def improve_photos(self, found: _Moved) -> _Moved:
        """Move photos between the two parts as long as that explains more."""
        while True:
            # The first photo stays, as the parts may as well be exchanged.
            turned = found.is_apart ^ np.eye(len(found.is_apart), dtype=np.bool_)[1:]
            each = (self.divide(one).find_points() for one in turned)
            others = [one for one in each if one is not None]
            best = max(others, key=lambda one: one.surplus, default=found)
            if best.surplus <= found.surplus:
                return found
            found = best


def begin_search(adjustment: Adjustment) -> _Search:
    """Compute the tests of all picks of the points that fit worst, in the linear model."""
    survey, block = adjustment.survey, adjustment.minimum.blocks["pixels"]
    misfit = np.bincount(
        survey.pick_label, np.sum(block.residual**2, axis=1), minlength=len(survey.label)
    )
    picks = np.bincount(survey.pick_label, minlength=len(survey.label))
    worst = np.argsort(-misfit, kind="stable")
    chosen = worst[np.cumsum(picks[worst]) <= MAX_PICKS]
    rows = np.flatnonzero(np.isin(survey.pick_label, chosen))
    along = np.nan_to_num(derive_picks_by_place(adjustment, rows, np.eye(3)[:2]))
    # A^T C, with two columns for each pick, and R = C^T C - C^T A N^-1 A^T C.
    size, number = adjustment.problem.layout.size, 2 * len(rows)
    right = np.zeros((size, number))
    by_unknown = np.einsum("prq,prk->pkq", along, block.jacobian[rows])
    columns = np.arange(number).reshape(-1, 1, 2)
    np.add.at(right, (block.columns[rows][:, :, None], columns), by_unknown)
    solved = adjustment.minimum.factor.solve(right)
    information = -(right.T @ solved).reshape(len(rows), 2, len(rows), 2)
    own = np.arange(len(rows))
    squares = np.einsum("prq,prs->pqs", along, along)
    information[own, :, own, :] += squares
    gradient = compute_gradient(adjustment.minimum.blocks.values(), size)
    score = np.einsum("prq,pr->pq", along, block.residual[rows])
    score -= (solved.T @ gradient).reshape(-1, 2)
    return _Search(
        survey.pick_label[rows],
        survey.pick_frame[rows],
        score,
        information,
        np.einsum("pqq->pq", squares),
    )


@dataclass(frozen=True, eq=False)
class _Parts:
    """Points that two parts of the photos show, and the tests of their motions between these.

    Attributes
    ----------
    is_apart
        (F,) photos of one part.
    label
        (K,) points.
    score, information, plain
        (K, 2), (K, 2, K, 2), (K, 2): the tests, summed over the picks in that part.
    """

    is_apart: Bools
    label: Ints
    score: Floats
    information: Floats
    plain: Floats

    def rank_points(self) -> tuple[Ints, Floats]:
        """Rank the points (K,) by the decreases (K,) of the sum of squares by a motion of each."""
        gains = self.compute_gains(np.arange(len(self.label))[:, None])
        order = np.argsort(-gains, kind="stable")
        return order, gains[order]

    def find_points(self) -> _Moved | None:
        """Find the points that were moved; None for less than two."""
        order, gains = self.rank_points()
        # In a distorted scene the point that explains most may not be one of those that were moved.
        begun = order[gains > LEAST_DECREASE][:MAX_BEGUN]
        selected = (self._add_points([first], order) for first in begun.tolist())
        found = filter(None, map(self._drop_points, selected))
        return max(found, key=lambda one: one.gain - LEAST_DECREASE * len(one.label), default=None)

    def _add_points(self, moved: list[int], order: Ints) -> list[int]:
        """Add the point that explains most, until none explains much."""
        while 2 * len(moved) < len(order):
            others = np.array([k for k in order.tolist() if k not in moved][:MAX_TESTED])
            gains = self._compute_additional_gains(moved, others)
            best = int(np.argmax(gains))
            if gains[best] < LEAST_DECREASE:
                break
            moved = [*moved, int(others[best])]
        return moved

    def _drop_points(self, moved: list[int]) -> _Moved | None:
        """Drop points that explain little once the others were selected."""
        while len(moved) >= LEAST_MOVED:
            losses = self._compute_losses(moved)
            least = int(np.argmin(losses))
            if losses[least] > LEAST_DECREASE:
                (gain,) = self.compute_gains(np.array([moved]))
                label = tuple(self.label[moved].tolist())
                return _Moved(label, self.is_apart, float(gain), len(self.label))
            moved = [k for k in moved if k != moved[least]]
        return None

    def _compute_additional_gains(self, moved: list[int], others: Ints) -> Floats:
        """Compute the further decrease of the sum of squares by each of n other points (n,).

        With the points S that are selected, the test of another point k has the information R_kk -
        R_kS R_SS^-1 R_Sk (Schur's complement), and its score is reduced alike.
        """
        inverse, value = self._solve(moved)
        joint = self.information[others[:, None], :, moved, :]  # (n, m, 2, 2)
        joint = joint.transpose(0, 2, 1, 3).reshape(len(others), 2, -1)
        score = self.score[others] - joint @ value
        own = self.information[others, :, others, :]
        own = own - joint @ inverse @ joint.transpose(0, 2, 1)
        return compute_gains(score, self.plain[others], own)

    def _compute_losses(self, moved: list[int]) -> Floats:
        """Compute the increases (m,) of the sum of squares without each of m points.

        With values x and covariance Q of all of them, x_k^T Q_kk^-1 x_k.
        """
        inverse, value = self._solve(moved)
        row = 2 * np.arange(len(moved))[:, None] + np.arange(2)
        own = inverse[row[:, :, None], row[:, None, :]]
        weight = np.linalg.pinv(own, hermitian=True)
        return np.asarray(np.einsum("nq,nqp,np->n", value[row], weight, value[row]))

    def _solve(self, moved: list[int]) -> tuple[Floats, Floats]:
        """Return R^-1 (2m, 2m) of some points, and R^-1 times their score (2m,)."""
        size = 2 * len(moved)
        joint = self.information[np.array(moved)[:, None], :, moved, :]  # (m, m, 2, 2)
        information = joint.transpose(0, 2, 1, 3).reshape(size, size)
        inverse = invert_information(self.plain[moved].ravel(), information)
        return inverse, inverse @ self.score[moved].ravel()

    def compute_gains(self, sets: Ints) -> Floats:
        """Compute the decrease of the sum of squares for each of n sets (n, m) of moved points."""
        count, size = len(sets), 2 * sets.shape[1]
        joint = self.information[sets[:, :, None], :, sets[:, None, :], :]
        return compute_gains(
            self.score[sets].reshape(count, size),
            self.plain[sets].reshape(count, size),
            joint.transpose(0, 1, 3, 2, 4).reshape(count, size, size),
        )


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
    """Return both places of points; those without one by few photos are missing."""
    row = np.array([adjustment.label_rows([one, name_moved(one)]) for one in names])
    is_placed: Bools = np.all(row >= 0, axis=1)
    own = [names[k] for k in np.flatnonzero(is_placed).tolist()]
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
    return np.array([middle.real, middle.imag, np.angle(turn)]) + step, np.asarray(normal)


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
        toward = found.value[:2] / max(shift_m, LEAST_SHIFT_M)
        sigma_m = float(np.sqrt(toward @ found.covariance[:2, :2] @ toward))
        degrees = np.degrees(found.value[2])
        size = f" by {shift_m:.2f} ± {sigma_m:.2f} m and {abs(degrees):.0f} degrees"
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

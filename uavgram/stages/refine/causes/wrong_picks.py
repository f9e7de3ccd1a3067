"""Hypotheses on picks of a photo under wrong labels, and on single wrong picks."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import HypothesisTest
from uavgram.model.arrays import Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import photo_name
from uavgram.model.survey import SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import (
    GROSS_ERROR_LOG_ODDS,
    Diagnosis,
    Hypothesis,
    find_usable_picks,
)
from uavgram.stages.refine.causes.stray_picks import (
    StrayPicks,
    find_stray_picks,
    frames_of,
    labels_of,
)

MAX_WRONG_PICKS = 4
"""Largest number of single wrong picks that are proposed."""

MAX_DISTANCE_RATIO = 0.4
"""Largest ratio of the distance of a pick from the place of another label to that of the label's
own pick, at which the label may belong there."""


class _Exchange(NamedTuple):
    """Labels of one photo that seem to be exchanged.

    Attributes
    ----------
    label
        Pick -> the label that belongs there.
    gain
        Expected decrease of the sum of squares.
    back
        Picks of other photos that were left out because of one of these, which now alone shows its
        point.
    """

    label: dict[int, int]
    gain: float
    back: frozenset[int]


def propose_wrong_picks(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that a pick of large misfit is wrong, for each of the worst."""
    found = find_stray_picks(diagnosis)
    number = len(diagnosis.refined.pick_index)
    label = diagnosis.survey.pick_label
    seen = np.bincount(label[diagnosis.refined.pick_index], minlength=len(diagnosis.survey.label))
    # Without its only pick a point disappears with its observations: no test.
    tested = found.taking & (seen[label[found.pick]] > 1)
    taking = list(zip(found.pick[tested], found.fall[tested], strict=True))
    for pick, fall in taking[:MAX_WRONG_PICKS]:
        yield Hypothesis(
            message=None,
            mend=SurveyCorrection(without_picks=frozenset([int(pick)])),
            promise=float(fall),
            price=2.0 * GROSS_ERROR_LOG_ODDS + float(np.log(number)),
        )


def propose_swapped_in_photo(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose cyclic exchanges of labels within one photo.

    Where one other photo alone shows two labels, they may as well be swapped in that one.
    """
    found = find_stray_picks(diagnosis)
    frames = frames_of(diagnosis)[diagnosis.survey.pick_frame]
    frames_taking = len(diagnosis.adjustment.survey.frame_id)
    for frame in np.unique(found.frame):
        own = np.flatnonzero(found.frame == frame)
        picks = np.flatnonzero(frames == frame)
        number = len(picks)
        exchanges = [
            *_exchanges(diagnosis, found, own, picks),
            *_exchanges_of_left_out(diagnosis, picks),
        ]
        for exchange in exchanges:
            count = len(exchange.label)
            # Picks that were left out are known to be wrong.
            known = int(diagnosis.spoilt[list(exchange.label)].sum())
            choices = np.log(np.arange(number - count + 1, number + 1)).sum() - np.log(count)
            choices += np.log(frames_taking) if known < count else 0.0
            choices -= known * np.log(number)
            for right in (exchange.label, _exchange_elsewhere(diagnosis, exchange.label)):
                if right:
                    yield Hypothesis(
                        message=partial(swapped_message, diagnosis, right),
                        mend=SurveyCorrection(label_of_pick=right),
                        back=exchange.back | (exchange.label.keys() - right.keys()),
                        promise=exchange.gain,
                        price=float(max(choices, 0.0)),
                        settles=frozenset([diagnosis.adjustment.survey.frame_id[frame]]),
                    )


def _exchanges(
    diagnosis: Diagnosis, found: StrayPicks, own: Ints, picks: Ints
) -> Iterator[_Exchange]:
    """Yield cycles of labels of a photo, each once.

    Parameters
    ----------
    diagnosis, found
        The survey, and all picks that do not fit.
    own, picks
        Rows of the photo's picks in `found`, and all picks of the photo in the survey.
    """
    survey = diagnosis.survey
    belongs = _find_own_places(diagnosis, found, own, picks)
    fall = dict(zip(found.pick.tolist(), found.fall.tolist(), strict=True))
    anywhere, told = _are_single_picks(diagnosis, picks), set[frozenset[int]]()
    for first in belongs:
        chain = [first]
        while belongs.get(chain[-1], first) not in chain:
            chain.append(belongs[chain[-1]])
        # A pick that alone shows its point may belong where the chain began.
        closed = belongs.get(chain[-1]) == first or chain[-1] in anywhere
        if len(chain) < 2 or not closed or frozenset(chain) in told:
            continue
        told.add(frozenset(chain))
        label = {
            there: int(survey.pick_label[pick])
            for pick, there in zip(chain, [*chain[1:], first], strict=True)
        }
        if len(set(label.values())) == len(label):
            gain = sum(fall.get(pick, 0.0) for pick in chain)
            yield _Exchange(label, gain, _left_out_for(diagnosis, anywhere.intersection(chain)))


def _exchanges_of_left_out(diagnosis: Diagnosis, picks: Ints) -> Iterator[_Exchange]:
    """Yield pairs of a photo's labels that both have left-out picks, here or in other photos.

    The place of a point is unknown where its only pick was left out.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    picks
        All picks of the photo.
    """
    label, single = diagnosis.survey.pick_label, _are_single_picks(diagnosis, picks)
    doubtful = picks[np.isin(label[picks], label[diagnosis.spoilt])]
    for one, other in combinations(doubtful.tolist(), 2):
        if label[one] != label[other] and single.issuperset((one, other)):
            right = {one: int(label[other]), other: int(label[one])}
            yield _Exchange(right, 0.0, _left_out_for(diagnosis, (one, other)))


def _exchange_elsewhere(diagnosis: Diagnosis, right: Mapping[int, int]) -> dict[int, int]:
    """Exchange two labels in the only other photo that shows both; empty without one."""
    survey, usable = diagnosis.survey, find_usable_picks(diagnosis.taking)
    usable &= np.isin(survey.pick_label, list(right.values()))
    usable &= survey.pick_frame != survey.pick_frame[next(iter(right))]
    picks = np.flatnonzero(usable)
    own = survey.pick_label[picks]
    if len(set(right.values())) != 2 or len(np.unique(own)) != 2:
        return {}
    if len(np.unique(survey.pick_frame[picks])) != 1:
        return {}
    first, second = np.unique(own).tolist()
    return {int(k): second if survey.pick_label[k] == first else first for k in picks}


def _left_out_for(diagnosis: Diagnosis, picks: Collection[int]) -> frozenset[int]:
    """Return left-out picks of the same points in photos that take part."""
    survey = diagnosis.survey
    names = diagnosis.adjustment.survey.frame_id
    stayed = [k for k, name in enumerate(survey.frame_id) if name in names]
    out = diagnosis.spoilt & np.isin(survey.pick_frame, stayed)
    out &= np.isin(survey.pick_label, survey.pick_label[list(picks)])
    return frozenset(np.flatnonzero(out).tolist()) - frozenset(picks)


def _are_single_picks(diagnosis: Diagnosis, picks: Ints) -> set[int]:
    """Return picks of points without any other pick: they may belong anywhere."""
    survey = diagnosis.survey
    others = np.bincount(
        survey.pick_label[diagnosis.refined.pick_index], minlength=len(survey.label)
    )
    others[survey.pick_label[picks]] -= np.isin(picks, diagnosis.refined.pick_index)
    return set(picks[others[survey.pick_label[picks]] == 0].tolist())


def _find_own_places(
    diagnosis: Diagnosis, found: StrayPicks, own: Ints, picks: Ints
) -> dict[int, int]:
    """Map each pick that does not fit to the pick of the photo at its label's place."""
    pixel = diagnosis.survey.pixel_px
    belongs = {}
    for row in own[np.isfinite(found.place_px[own, 0])].tolist():
        pick = int(found.pick[row])
        away = np.linalg.norm(pixel[picks] - found.place_px[row], axis=1)
        there = int(picks[np.argmin(away)])
        if there != pick and away.min() < MAX_DISTANCE_RATIO * float(away[picks == pick][0]):
            belongs[pick] = there
    return belongs


def swapped_message(
    diagnosis: Diagnosis, right: Mapping[int, int], _: HypothesisTest | None
) -> Message:
    """Report picks of one photo, and the labels that belong there.

    Parameters
    ----------
    diagnosis
        The survey.
    right
        Pick -> the label that belongs there.
    _
        Result of the linear test, not used.
    """
    survey = diagnosis.survey
    frame = survey.frame_id[survey.pick_frame[next(iter(right))]]
    names = {survey.label[survey.pick_label[k]]: survey.label[v] for k, v in right.items()}
    labels = tuple(names)
    if len(labels) == 2:
        what = f"{labels[0]!r} and {labels[1]!r}"
        text = (
            f"The labels {what} seem to be swapped in {frame!r}: look at both, and swap the labels "
            "in this photo. Each pick is at the place of the other."
        )
    else:
        what = f"{', '.join(map(repr, labels[:-1]))} and {labels[-1]!r}"
        each = ", ".join(f"{old!r} should be {new!r}" for old, new in names.items())
        text = (
            f"The labels {what} seem to have changed places in {frame!r}: look at them, and change "
            f"the labels in this photo. By their places {each}."
        )
    return Message(
        "warning",
        "labels-swapped",
        text,
        frames=(frame,),
        labels=labels,
        several=MessagePlural(
            "Labels seem to be swapped in {count} photos or groups of picks",
            f"{what} in {frame!r}",
            ending="Each pick is at the place of another of them: look, and change the labels "
            "there.",
        ),
    )


SAME_PLACE_SIGMAS = 8.0
"""Distance of two picks of a photo, in sigmas of one, up to which they are of the same point."""

MAX_DISTANCE_RATIO_UNPICKED = 0.1
"""Largest ratio of the distance of a pick from the place of a label without a pick in the photo to
that from its own place, at which it may belong there. A wrong pick pulls that place along."""


def propose_other_places(diagnosis: Diagnosis) -> Iterator[Hypothesis]:
    """Propose that a pick is at another label's place: picked twice, or under a wrong label."""
    found, survey = find_stray_picks(diagnosis), diagnosis.survey
    picks, labels = len(diagnosis.refined.pick_index), len(diagnosis.adjustment.survey.label)
    for row, pick in enumerate(found.pick.tolist()):
        own = float(np.linalg.norm(survey.pixel_px[pick] - found.place_px[row]))
        of_which = np.log(picks) * found.taking[row]  # known for a pick that was left out
        for other, sigmas in _labels_there(diagnosis, pick, int(found.frame[row]), own):
            free = not _picks_of(diagnosis, int(survey.pick_frame[pick]), other).size
            out, change = frozenset([pick]), {pick: other}
            yield Hypothesis(
                message=partial(_other_place_message, diagnosis, pick, other),
                mend=SurveyCorrection(label_of_pick=change)
                if free
                else SurveyCorrection(without_picks=out),
                promise=float(found.fall[row]),
                # A removed pick still has to agree with the place of the other one.
                price=float(np.log(labels) + of_which + (0.0 if free else sigmas**2 / 4.0)),
                settles=frozenset([survey.frame_id[survey.pick_frame[pick]]]),
            )


def _labels_there(
    diagnosis: Diagnosis, pick: int, frame: int, own_px: float
) -> Iterator[tuple[int, float]]:
    """Yield labels that belong at a pick, and their distances in its sigmas; at most two.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    pick, frame
        Pick of the survey; frame of the adjustment.
    own_px
        Distance of the pick from its own place.
    """
    survey, sigma = diagnosis.survey, float(diagnosis.survey.pick_sigma_px[pick])
    beside = np.flatnonzero((survey.pick_frame == survey.pick_frame[pick]) & ~diagnosis.spoilt)
    beside = beside[survey.pick_label[beside] != survey.pick_label[pick]]
    away = np.linalg.norm(survey.pixel_px[beside] - survey.pixel_px[pick], axis=1) / sigma
    if len(away) and away.min() < SAME_PLACE_SIGMAS:
        yield int(survey.pick_label[beside[away.argmin()]]), float(away.min())
    at = labels_of(diagnosis)
    at[survey.pick_label[beside]] = -1
    at[survey.pick_label[pick]] = -1
    label = np.flatnonzero(at >= 0)
    if not len(label):
        return
    place = diagnosis.adjustment.pixels(np.full(len(label), frame), at[label])
    away = np.nan_to_num(np.linalg.norm(survey.pixel_px[pick] - place, axis=1), nan=np.inf)
    if away.min() < max(SAME_PLACE_SIGMAS * sigma, MAX_DISTANCE_RATIO_UNPICKED * own_px):
        yield int(label[away.argmin()]), float(away.min()) / sigma


def _picks_of(diagnosis: Diagnosis, frame: int, label: int) -> Ints:
    """Return picks of a label in a photo that were not left out."""
    survey = diagnosis.survey
    same = (survey.pick_frame == frame) & (survey.pick_label == label)
    return np.flatnonzero(same & ~diagnosis.spoilt)


def _other_place_message(
    diagnosis: Diagnosis, pick: int, other: int, _: HypothesisTest | None
) -> Message:
    """Report a pick at the place of another label.

    Parameters
    ----------
    diagnosis
        The survey under diagnosis.
    pick, other
        The pick, and the label that belongs there.
    """
    survey = diagnosis.survey
    label, there = survey.label[survey.pick_label[pick]], survey.label[other]
    frame = survey.frame_id[survey.pick_frame[pick]]
    free = not _picks_of(diagnosis, int(survey.pick_frame[pick]), other).size
    todo = f"change its label to {there!r} there" if free else "pick it again, or take it out there"
    return Message(
        "warning",
        "label-elsewhere",
        f"The pick of {label!r} in {frame!r} is at the place of {there!r}: look, and {todo}.",
        frames=(frame,),
        labels=(label, there),
        plain=f"{label} is picked where {there} belongs, in {photo_name(frame)}.",
        several=MessagePlural(
            "{count} picks are at the place of another label",
            f"{label!r} in {frame!r} at the place of {there!r}",
            ending="Look, and change their labels there, or pick them again.",
        ),
    )

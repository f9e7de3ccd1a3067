"""Hypotheses on picks of a photo under wrong labels, and on single wrong picks."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained
from uavgram.model.arrays import Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.survey.corrections import SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing
from uavgram.stages.refine.causes.labels.places import Strays, frames_of, strays

MOST_WRONG = 4
"""Largest number of single wrong picks that are proposed."""

NEARER = 0.4
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


def wrong_picks(standing: Standing) -> Iterator[Hypothesis]:
    """Propose that a pick of large misfit is wrong, for each of the worst."""
    found = strays(standing)
    number = len(standing.refined.pick_index)
    label = standing.survey.pick_label
    seen = np.bincount(label[standing.refined.pick_index], minlength=len(standing.survey.label))
    # Without its only pick a point disappears with its observations: no test.
    tested = found.taking & (seen[label[found.pick]] > 1)
    taking = list(zip(found.pick[tested], found.fall[tested], strict=True))
    for pick, fall in taking[:MOST_WRONG]:
        yield Hypothesis(
            tell=None,
            mend=SurveyCorrection(without_picks=frozenset([int(pick)])),
            promise=float(fall),
            price=2.0 * PRICE + float(np.log(number)),
        )


def swapped_in_a_photo(standing: Standing) -> Iterator[Hypothesis]:
    """Propose cyclic exchanges of labels within one photo."""
    found = strays(standing)
    frames = frames_of(standing)[standing.survey.pick_frame]
    frames_taking = len(standing.adjustment.survey.frame_id)
    for frame in np.unique(found.frame):
        own = np.flatnonzero(found.frame == frame)
        picks = np.flatnonzero(frames == frame)
        number = len(picks)
        for exchange in _exchanges(standing, found, own, picks):
            count = len(exchange.label)
            # Picks that were left out are known to be wrong.
            known = int(standing.spoilt[list(exchange.label)].sum())
            choices = np.log(np.arange(number - count + 1, number + 1)).sum() - np.log(count)
            choices += np.log(frames_taking) if known < count else 0.0
            choices -= known * np.log(number)
            yield Hypothesis(
                tell=partial(swapped_message, standing, exchange.label),
                mend=SurveyCorrection(label_of_pick=exchange.label),
                back=exchange.back,
                promise=exchange.gain,
                price=float(max(choices, 0.0)),
                settles=frozenset([standing.adjustment.survey.frame_id[frame]]),
            )


def _exchanges(standing: Standing, found: Strays, own: Ints, picks: Ints) -> Iterator[_Exchange]:
    """Yield cycles of labels of a photo, each once.

    Parameters
    ----------
    standing, found
        The survey, and all picks that do not fit.
    own, picks
        Rows of the photo's picks in `found`, and all picks of the photo in the survey.
    """
    survey = standing.survey
    belongs = _where_they_belong(standing, found, own, picks)
    fall = dict(zip(found.pick.tolist(), found.fall.tolist(), strict=True))
    anywhere, told = _only_one(standing, picks), set[frozenset[int]]()
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
            yield _Exchange(label, gain, _left_out_for(standing, anywhere.intersection(chain)))


def _left_out_for(standing: Standing, picks: Collection[int]) -> frozenset[int]:
    """Return left-out picks of the same points in photos that take part."""
    survey = standing.survey
    names = standing.adjustment.survey.frame_id
    stayed = [k for k, name in enumerate(survey.frame_id) if name in names]
    out = standing.spoilt & np.isin(survey.pick_frame, stayed)
    out &= np.isin(survey.pick_label, survey.pick_label[list(picks)])
    return frozenset(np.flatnonzero(out).tolist()) - frozenset(picks)


def _only_one(standing: Standing, picks: Ints) -> set[int]:
    """Return picks of points without any other pick: they may belong anywhere."""
    survey = standing.survey
    others = np.bincount(
        survey.pick_label[standing.refined.pick_index], minlength=len(survey.label)
    )
    others[survey.pick_label[picks]] -= np.isin(picks, standing.refined.pick_index)
    return set(picks[others[survey.pick_label[picks]] == 0].tolist())


def _where_they_belong(standing: Standing, found: Strays, own: Ints, picks: Ints) -> dict[int, int]:
    """Map each pick that does not fit to the pick of the photo at its label's place."""
    pixel = standing.survey.pixel_px
    belongs = {}
    for row in own[np.isfinite(found.place_px[own, 0])].tolist():
        pick = int(found.pick[row])
        away = np.linalg.norm(pixel[picks] - found.place_px[row], axis=1)
        there = int(picks[np.argmin(away)])
        if there != pick and away.min() < NEARER * float(away[picks == pick][0]):
            belongs[pick] = there
    return belongs


def swapped_message(standing: Standing, right: Mapping[int, int], _: Explained | None) -> Message:
    """Report picks of one photo, and the labels that belong there.

    Parameters
    ----------
    standing
        The survey.
    right
        Pick -> the label that belongs there.
    _
        Result of the linear test, not used.
    """
    survey = standing.survey
    frame = survey.frame_id[survey.pick_frame[next(iter(right))]]
    names = {survey.label[survey.pick_label[k]]: survey.label[v] for k, v in right.items()}
    labels = tuple(names)
    if len(labels) == 2:
        what = f"{labels[0]!r} and {labels[1]!r}"
        text = (
            f"The labels {what} seem to be swapped in {frame!r}: look at both, and swap the labels "
            "in this photo. Each pick lies where the other belongs."
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
            ending="Each pick lies where another of them belongs: look, and change the labels "
            "there.",
        ),
    )

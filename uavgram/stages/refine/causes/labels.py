"""Picks and labels that could be wrong in a photo."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message, Several
from uavgram.model.survey.mend import Mend
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing

STRAYS = 16.0
"""Fall of the sum of squares without a pick, from which on it is looked at."""

MOST_PICKS = 60
"""Picks that are looked at: those that stray farthest, and those that were left out."""

MOST_WRONG = 4
"""Single wrong picks that are proposed."""

NEARER = 0.5
"""Distance of a pick from the place of another label over that from its own, up to which it may
belong there. A pick that takes part pulls its own place along."""


class Strays(NamedTuple):
    """Picks of adjusted frames that do not fit, or were left out for it.

    Attributes
    ----------
    pick
        (n,) of the survey.
    fall
        (n,) of the sum of squares without each; of those left out, by its distance from its place.
    frame
        (n,) of the adjustment.
    place
        (n, K) columns and rows [px] where each label of the adjustment appears in its frame.
    own
        (n,) its label among those of the adjustment; -1 where that has no other pick.
    """

    pick: Ints
    fall: Floats
    frame: Ints
    place: Floats
    own: Ints


def strays(standing: Standing) -> Strays:
    """The picks that do not fit, worst first."""
    adjustment, refined, survey = standing.adjustment, standing.refined, standing.survey
    fall = np.zeros(len(survey.pick_frame))
    block = adjustment.minimum.blocks["pixels"]
    fall[refined.pick_index] = falls_without(block, adjustment.covariance)
    known = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    frame = np.array([known.get(name, -1) for name in survey.frame_id], dtype=np.int64)
    looked_at = (fall > STRAYS) | standing.spoilt
    fall[standing.spoilt] = np.inf
    picks = np.flatnonzero(looked_at & (frame[survey.pick_frame] >= 0))
    picks = picks[np.argsort(-fall[picks], kind="stable")][:MOST_PICKS]
    own = adjustment.label_rows(survey.label[k] for k in survey.pick_label[picks])
    labels = len(adjustment.survey.label)
    at = np.repeat(frame[survey.pick_frame[picks]], labels)
    place = adjustment.pixels(at, np.tile(np.arange(labels), len(picks)))
    place = place.reshape(len(picks), labels, 2)
    left_out = np.flatnonzero(np.isinf(fall[picks]))
    away = np.full(len(picks), np.nan)
    there = left_out[own[left_out] >= 0]
    away[there] = np.linalg.norm(survey.pixel_px[picks[there]] - place[there, own[there]], axis=1)
    squares = (away / survey.pick_sigma_px[picks]) ** 2
    size = np.where(np.isinf(fall[picks]), np.nan_to_num(squares), fall[picks])
    return Strays(picks, size, frame[survey.pick_frame[picks]], place, own)


def wrong_picks(standing: Standing) -> Iterator[Hypothesis]:
    """The picks that stray farthest: each is somewhere else."""
    found = strays(standing)
    number = len(standing.refined.pick_index)
    taking = ~standing.spoilt[found.pick]
    for pick, fall in list(zip(found.pick[taking], found.fall[taking], strict=True))[:MOST_WRONG]:
        yield Hypothesis(
            tell=None,
            mend=Mend(without_picks=frozenset([int(pick)])),
            promise=float(fall),
            unknowns=2,
            price=2.0 * PRICE + float(np.log(number)),
        )


def swapped_in_a_photo(standing: Standing) -> Iterator[Hypothesis]:
    """Pairs of picks of one photo of which each lies nearer to the other's place."""
    found, survey = strays(standing), standing.survey
    pairs = _pairs_of_labels(standing)
    for i, j in combinations(range(len(found.pick)), 2):
        a, b = int(found.pick[i]), int(found.pick[j])
        if found.frame[i] != found.frame[j] or min(found.own[i], found.own[j]) < 0:
            continue
        if survey.pick_label[a] == survey.pick_label[b]:
            continue
        own = _away(survey.pixel_px, found, (i, j), (i, j))
        other = _away(survey.pixel_px, found, (i, j), (j, i))
        if not (other < NEARER * own).all():
            continue
        yield Hypothesis(
            tell=partial(_swapped, standing, (a, b), own),
            mend=Mend(label_of_pick={a: int(survey.pick_label[b]), b: int(survey.pick_label[a])}),
            promise=float(found.fall[i] + found.fall[j]),
            price=float(np.log(pairs)),
        )


def _away(pixel: Floats, found: Strays, pick: tuple[int, int], of: tuple[int, int]) -> Floats:
    """(2,) distances [px] of two picks from where the labels of two picks appear."""
    places = [found.place[p, found.own[q]] for p, q in zip(pick, of, strict=True)]
    return np.asarray(np.linalg.norm(pixel[found.pick[list(pick)]] - places, axis=1))


def _pairs_of_labels(standing: Standing) -> float:
    """How many pairs of picks of one photo there are."""
    count = np.bincount(standing.survey.pick_frame[standing.refined.pick_index])
    return max(1.0, float((count * (count - 1)).sum()) / 2.0)


def _swapped(
    standing: Standing, picks: tuple[int, int], own_px: Floats, _: Explained | None
) -> Message:
    """The message on two swapped picks, so far from their own places."""
    survey = standing.survey
    first, second = (survey.label[survey.pick_label[k]] for k in picks)
    frame = survey.frame_id[survey.pick_frame[picks[0]]]
    several = Several(
        "Labels seem to be swapped in {count} photos or pairs of picks",
        f"{first!r} and {second!r} in {frame!r}",
        ending="Each pick lies where the other belongs: look, and swap the labels there.",
    )
    return Message(
        "warning",
        "labels-swapped",
        f"The labels {first!r} and {second!r} seem to be swapped in {frame!r}: look at both, and "
        "swap the labels in this photo. Each pick lies where the other belongs, "
        f"{own_px[0]:.0f} and {own_px[1]:.0f} px from its own place.",
        frames=(frame,),
        labels=(first, second),
        several=several,
    )

"""Hypotheses on single picks of a photo at the place of another label."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained
from uavgram.model.arrays import Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import photo_name
from uavgram.model.survey.corrections import SurveyCorrection
from uavgram.stages.refine.causes.hypothesis import Hypothesis, Standing
from uavgram.stages.refine.causes.labels.places import labels_of, strays

SAME = 8.0
"""Distance of two picks of a photo, in sigmas of one, up to which they are of the same point."""

NEARER = 0.1
"""Largest ratio of the distance of a pick from the place of a label without a pick in the photo to
that from its own place, at which it may belong there. A wrong pick pulls that place along."""


def elsewhere_in_a_photo(standing: Standing) -> Iterator[Hypothesis]:
    """Propose that a pick is at another label's place: picked twice, or under a wrong label."""
    found, survey = strays(standing), standing.survey
    picks, labels = len(standing.refined.pick_index), len(standing.adjustment.survey.label)
    for row, pick in enumerate(found.pick.tolist()):
        own = float(np.linalg.norm(survey.pixel_px[pick] - found.place_px[row]))
        of_which = np.log(picks) * found.taking[row]  # known for a pick that was left out
        for other, sigmas in _labels_there(standing, pick, int(found.frame[row]), own):
            free = not _picks_of(standing, int(survey.pick_frame[pick]), other).size
            out, change = frozenset([pick]), {pick: other}
            yield Hypothesis(
                tell=partial(_elsewhere, standing, pick, other),
                mend=SurveyCorrection(label_of_pick=change)
                if free
                else SurveyCorrection(without_picks=out),
                promise=float(found.fall[row]),
                # A removed pick still has to agree with the place of the other one.
                price=float(np.log(labels) + of_which + (0.0 if free else sigmas**2 / 4.0)),
                settles=frozenset([survey.frame_id[survey.pick_frame[pick]]]),
            )


def _labels_there(
    standing: Standing, pick: int, frame: int, own_px: float
) -> Iterator[tuple[int, float]]:
    """Yield labels that belong at a pick, and their distances in its sigmas; at most two.

    Parameters
    ----------
    standing
        The survey under diagnosis.
    pick, frame
        Pick of the survey; frame of the adjustment.
    own_px
        Distance of the pick from its own place.
    """
    survey, sigma = standing.survey, float(standing.survey.pick_sigma_px[pick])
    beside = np.flatnonzero((survey.pick_frame == survey.pick_frame[pick]) & ~standing.spoilt)
    beside = beside[survey.pick_label[beside] != survey.pick_label[pick]]
    away = np.linalg.norm(survey.pixel_px[beside] - survey.pixel_px[pick], axis=1) / sigma
    if len(away) and away.min() < SAME:
        yield int(survey.pick_label[beside[away.argmin()]]), float(away.min())
    at = labels_of(standing)
    at[survey.pick_label[beside]] = -1
    at[survey.pick_label[pick]] = -1
    label = np.flatnonzero(at >= 0)
    if not len(label):
        return
    place = standing.adjustment.pixels(np.full(len(label), frame), at[label])
    away = np.nan_to_num(np.linalg.norm(survey.pixel_px[pick] - place, axis=1), nan=np.inf)
    if away.min() < max(SAME * sigma, NEARER * own_px):
        yield int(label[away.argmin()]), float(away.min()) / sigma


def _picks_of(standing: Standing, frame: int, label: int) -> Ints:
    """Return picks of a label in a photo that were not left out."""
    survey = standing.survey
    same = (survey.pick_frame == frame) & (survey.pick_label == label)
    return np.flatnonzero(same & ~standing.spoilt)


def _elsewhere(standing: Standing, pick: int, other: int, _: Explained | None) -> Message:
    """Report a pick at the place of another label.

    Parameters
    ----------
    standing
        The survey under diagnosis.
    pick, other
        The pick, and the label that belongs there.
    """
    survey = standing.survey
    label, there = survey.label[survey.pick_label[pick]], survey.label[other]
    frame = survey.frame_id[survey.pick_frame[pick]]
    free = not _picks_of(standing, int(survey.pick_frame[pick]), other).size
    todo = f"change its label to {there!r} there" if free else "pick it anew, or take it out there"
    return Message(
        "warning",
        "label-elsewhere",
        f"The pick of {label!r} in {frame!r} lies where {there!r} belongs: look, and {todo}.",
        frames=(frame,),
        labels=(label, there),
        plain=f"{label} is picked where {there} belongs, in {photo_name(frame)}.",
        several=MessagePlural(
            "{count} picks lie where another label belongs",
            f"{label!r} in {frame!r} where {there!r} belongs",
            ending="Look, and change their labels there, or pick them anew.",
        ),
    )

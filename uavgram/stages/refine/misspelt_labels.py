"""Report labels that seem to be misspelt: one letter off one that belongs at that place.

Names of numbered series, `P1` and `P10`, are one letter apart as well. Therefore the place decides:
the pick is where the other label is expected in that photo, and that one is not picked there.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import chdtri

from uavgram.estimation.measuring.predicted_pixels import predict_pixels
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message
from uavgram.model.survey import Survey, SurveyCorrection
from uavgram.stages.duplicates import list_looks
from uavgram.stages.remedies import add_remedies

PROBABILITY = 0.001
"""Probability of a right label's pick outside the region around its expected place, and largest
probability of any other pick in it, by chance."""


def report_misspelt_labels(survey: Survey, adjustment: Adjustment) -> Iterator[Message]:
    """Report picks of labels that occur once, at the expected place of a label one letter off.

    Parameters
    ----------
    survey
        All observations as stated.
    adjustment
        Adjusted survey, which predicts where the other labels are expected.
    """
    pick, label = _pair_labels(survey)
    where = [survey.frame_id[k] for k in survey.pick_frame[pick]]
    frame_of = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    frame = np.array([frame_of.get(name, -1) for name in where], dtype=np.int64)
    row = adjustment.label_rows(survey.label[k] for k in label)
    known = np.flatnonzero((frame >= 0) & (row >= 0))
    # Without those behind the camera.
    known = known[np.isfinite(adjustment.pixels(frame[known], row[known])).all(axis=1)]
    if not len(known):
        return
    place, covariance = predict_pixels(adjustment, frame[known], row[known])
    covariance = covariance + survey.pick_sigma_px[pick[known], None, None] ** 2 * np.eye(2)
    at_place = _are_at_place(survey, survey.pixel_px[pick[known]] - place, covariance)
    for k in known[at_place].tolist():
        written, right = survey.label[survey.pick_label[pick[k]]], survey.label[label[k]]
        text = (
            f"The label {written!r} is picked once, in {where[k]}, where {right!r} is expected and "
            f"not picked: if that is the same point, change {written!r} to {right!r} there."
        )
        message = Message(
            "warning", "label-resembles", text, frames=(where[k],), labels=(written, right)
        )
        yield add_remedies(
            message, survey, [SurveyCorrection(label_of_pick={int(pick[k]): int(label[k])})]
        )


def _pair_labels(survey: Survey) -> tuple[Ints, Ints]:
    """Pair picks (n,) of labels that occur once with labels (n,) one letter off in other photos."""
    count = np.bincount(survey.pick_label, minlength=len(survey.label))
    picked = set(zip(survey.pick_frame.tolist(), survey.pick_label.tolist(), strict=True))
    of_spelling: dict[str, list[int]] = {}
    for label in np.flatnonzero(count).tolist():
        for spelling in _list_spellings(survey.label[label]):
            of_spelling.setdefault(spelling, []).append(label)
    pairs = [
        (pick, label)
        for pick in np.flatnonzero(count[survey.pick_label] == 1).tolist()
        for label in _find_alike(survey, int(survey.pick_label[pick]), of_spelling)
        if (int(survey.pick_frame[pick]), label) not in picked
    ]
    both = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _list_spellings(label: str) -> set[str]:
    """Return a label, and what remains of it without one letter.

    Labels with a common spelling differ by one letter that was changed, added, lost or moved.
    """
    return {label, *(label[:k] + label[k + 1 :] for k in range(len(label)))}


def _find_alike(survey: Survey, label: int, of_spelling: dict[str, list[int]]) -> list[int]:
    """Find labels one letter off another; not those that look alike, which are reported before."""
    name = survey.label[label]
    alike = {other for one in _list_spellings(name) for other in of_spelling[one]}
    looks = set(list_looks(name))
    return sorted(k for k in alike if looks.isdisjoint(list_looks(survey.label[k])))


def _are_at_place(survey: Survey, off_px: Floats, covariance: Floats) -> Bools:
    """Mark picks (n,) within a region around an expected place that no other pick hits by chance.

    Parameters
    ----------
    survey
        Survey with the size of its photos.
    off_px, covariance
        (n, 2), (n, 2, 2) their distances from it [px].
    """
    square = np.einsum("ni,nij,nj->n", off_px, np.linalg.inv(covariance), off_px)
    limit = float(chdtri(2, PROBABILITY))
    area = np.pi * limit * np.sqrt(np.linalg.det(covariance))
    photo = survey.calibration.width_px * survey.calibration.height_px
    return np.asarray((square < limit) & (area < PROBABILITY * photo))

"""Heights of labels as the photos show them, and predicted places of picks in other photos."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import (
    PickedPixels,
    TransferredPixels,
    transfer_between_picks,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.imaging.matching.least_squares import REASON_TEXTS, RefusalReason, SoughtPoints
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.observations import Picks
from uavgram.pipeline.match.selection import find_sources, list_labels_without_height
from uavgram.stages.match import REGION_SQUARED, Candidates, HeightEvidence, Missed, Record

MIN_PX = 0.5
"""Sigma that is added to every prediction [px], for errors outside the model, such as a remaining
distortion."""

UNSEARCHED = {REASON_TEXTS[why] for why in (RefusalReason.OUTSIDE, RefusalReason.TOO_FAR)}
"""Reasons of searches that did not look at the whole region."""


class _Seen(NamedTuple):
    """Row of `HeightEvidence`."""

    label: str
    off_px: Floats
    covariance_px2: Floats
    rise: Floats
    is_picked: bool


def collect_height_evidence(
    adjustment: Adjustment, picks: Picks, candidates: Candidates, record: Record, sigma_px: float
) -> HeightEvidence:
    """Collect the evidence on the heights of labels that are neither stated nor free.

    Parameters
    ----------
    adjustment, candidates
        The adjustment that predicted the places, and all of them.
    picks
        Picks of the project.
    record
        The search so far; finds of earlier searches are among the picks.
    sigma_px
        Sigma of picks that do not state one [px].
    """
    blank = set(list_labels_without_height(picks, zip(picks.image, picks.label, strict=True)))
    seen = _compare_picks(adjustment, picks, sigma_px)
    places = candidates.places
    found = {pair: (one.pick, one.pixel_px) for pair, one in record.found.items()}
    for row, source in find_sources(picks).items():
        found[picks.image[row], picks.label[row]] = source, picks.pixel_px[row]
    for row, (pair, pick) in enumerate(zip(candidates.pair, candidates.pick.tolist(), strict=True)):
        tried = [one for one in record.missed.get(pair, ()) if one.pick == pick]
        if pair in found and found[pair][0] == pick:
            off = np.array(found[pair][1]) - places.pixel_px[row]
        elif pair not in found and any(is_informative(candidates, row, one) for one in tried):
            off = np.full(2, np.nan)
        else:
            continue
        spread = places.covariance_px2[row] + MIN_PX**2 * np.eye(2)
        seen.append(_Seen(pair[1], off, spread, places.rise[row], is_picked=False))
    seen = [one for one in seen if one.label in blank]
    return HeightEvidence(
        tuple(one.label for one in seen),
        np.array([one.off_px for one in seen]).reshape(-1, 2),
        np.array([one.covariance_px2 for one in seen]).reshape(-1, 2, 2),
        np.array([one.rise for one in seen]).reshape(-1, 2),
        np.array([one.is_picked for one in seen], dtype=np.bool_),
    )


def _compare_picks(adjustment: Adjustment, picks: Picks, sigma_px: float) -> list[_Seen]:
    """Compare the hand picks of each label with the places that its first one has on the ground."""
    clicked, rows = locate_picks(adjustment, picks)
    places = transfer_between_picks(adjustment, clicked)
    first: dict[str, int] = {}
    other = {(picks.image[i], picks.label[i]): i for i in rows}
    sigma = np.where(np.isnan(picks.sigma_px), sigma_px, picks.sigma_px)
    seen = []
    for k, (click, photo) in enumerate(zip(places.click.tolist(), places.frame_id, strict=True)):
        i, label = rows[click], picks.label[rows[click]]
        if first.setdefault(label, i) == i and photo != picks.image[i]:
            there, turn = other[photo, label], places.affine[k]
            noise = sigma[i] ** 2 * turn @ turn.T + (sigma[there] ** 2 + MIN_PX**2) * np.eye(2)
            off = picks.pixel_px[there] - places.pixel_px[k]
            spread = places.covariance_px2[k] + noise
            seen.append(_Seen(label, off, spread, places.rise[k], is_picked=True))
    return seen


def locate_picks(adjustment: Adjustment, picks: Picks) -> tuple[PickedPixels, list[int]]:
    """Return the hand picks whose photo and label are adjusted, and their numbers."""
    survey = adjustment.survey
    frame = {name: k for k, name in enumerate(survey.frame_id)}
    label = {name: k for k, name in enumerate(survey.label)}
    rows = [
        i
        for i in np.flatnonzero(picks.of_source("hand")).tolist()
        if picks.image[i] in frame and picks.label[i] in label
    ]
    clicked = PickedPixels(
        np.array([frame[picks.image[i]] for i in rows], dtype=np.int64),
        np.array([label[picks.label[i]] for i in rows], dtype=np.int64),
        picks.pixel_px[rows].reshape(-1, 2),
    )
    return clicked, rows


def is_informative(candidates: Candidates, row: int, missed: Missed) -> bool:
    """Return whether an unsuccessful search contains information on the height.

    Where nothing was searched there is none. A look-alike beside the line of sight has moved; one
    along it may be at another height.

    Parameters
    ----------
    candidates, row
        Predicted places, and the number of the searched one.
    missed
        The search there.
    """
    if missed.pixel_px is None:
        return missed.why not in UNSEARCHED
    places = candidates.places
    across = np.array([-1.0, 1.0]) * places.rise[row, ::-1]
    off = across @ (np.array(missed.pixel_px) - places.pixel_px[row])
    spread = places.covariance_px2[row] + MIN_PX**2 * np.eye(2)
    return bool(off**2 <= REGION_SQUARED * (across @ spread @ across))


def make_search_places(
    places: TransferredPixels, rows: Ints, picks: Picks, pick: Ints
) -> SoughtPoints:
    """Convert predicted places to the input of the matching.

    Parameters
    ----------
    places, rows
        Predicted places, and numbers (m,) of those to search for.
    picks, pick
        All picks, and (m,) rows of those whose points are searched for.
    """
    by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
    photos = Counter(label for _, label in {(picks.image[i], picks.label[i]) for i in by_hand})
    return SoughtPoints(
        is_confirmed=np.array([photos[picks.label[i]] > 1 for i in pick], dtype=np.bool_),
        source_px=picks.pixel_px[pick],
        target_px=places.pixel_px[rows],
        covariance_px2=places.covariance_px2[rows] + MIN_PX**2 * np.eye(2),
        affine=places.affine[rows],
        rise=places.rise[rows],
    )


@dataclass(frozen=True, eq=False)
class PredictedPlaces:
    """Set of n predicted places of picks in other photos.

    Attributes
    ----------
    pick
        (n,) number of the pick that each is predicted from.
    image, label
        (n,) the photo, and the label.
    radius_px
        (n,) half lengths of the regions that hold 99.9 %.
    is_raised
        (n,) whether the point is off the ground.
    row, predicted
        (n,) row of each among the predictions, and all of these.
    """

    pick: Ints
    image: tuple[str, ...]
    label: tuple[str, ...]
    radius_px: Floats
    is_raised: Bools
    row: Ints
    predicted: TransferredPixels

    def __len__(self) -> int:
        return len(self.image)

    @property
    def affine(self) -> Floats:
        """Affine maps (n, 2, 2): d pixel there / d pixel of the pick."""
        return self.predicted.affine[self.row]

    def holds(self, row: int, pixel_px: tuple[float, float]) -> bool:
        """Return whether a pixel is within the region of a place."""
        at = self.row[row]
        off = np.array(pixel_px) - self.predicted.pixel_px[at]
        covariance = self.predicted.covariance_px2[at] + MIN_PX**2 * np.eye(2)
        return bool(off @ np.linalg.solve(covariance, off) <= REGION_SQUARED)

    def sought(self, picks: Picks, rows: Ints) -> SoughtPoints:
        """Convert places to the input of the matching."""
        return make_search_places(self.predicted, self.row[rows], picks, self.pick[rows])

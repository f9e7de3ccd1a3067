"""Heights of labels as the photos show them, and predicted places of picks in other photos."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import (
    FlightOfPhotos,
    PickedPixels,
    transfer_between_picks,
    transfer_pixels,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.imaging.matching.least_squares import REASON_TEXTS, RefusalReason
from uavgram.model.arrays import Bools, Floats
from uavgram.model.observations import Picks
from uavgram.pipeline.match.selection import find_sources, list_labels_without_height
from uavgram.stages.match import (
    MIN_PX,
    REGION_SQUARED,
    Candidates,
    HeightEvidence,
    Missed,
    Record,
)

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
    survey = adjustment.survey
    rows = [
        i
        for i in np.flatnonzero(picks.of_source("hand")).tolist()
        if picks.image[i] in survey.frame_id and picks.label[i] in survey.label
    ]
    places = transfer_between_picks(adjustment, _locate_picks(adjustment, picks, rows))
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


def _locate_picks(adjustment: Adjustment, picks: Picks, rows: Sequence[int]) -> PickedPixels:
    """Return picks, by their numbers, whose photo and label are adjusted."""
    frame = {name: k for k, name in enumerate(adjustment.survey.frame_id)}
    label = {name: k for k, name in enumerate(adjustment.survey.label)}
    return PickedPixels(
        np.array([frame[picks.image[i]] for i in rows], dtype=np.int64),
        np.array([label[picks.label[i]] for i in rows], dtype=np.int64),
        picks.pixel_px[np.array(rows, dtype=np.int64)].reshape(-1, 2),
    )


def predict_candidates(
    adjustment: Adjustment,
    flight: FlightOfPhotos | None,
    picks: Picks,
    rows: Sequence[int],
    is_alone: Bools,
) -> Candidates:
    """Predict the places of picks in all other photos that should show them.

    Parameters
    ----------
    adjustment, flight
        The adjusted survey, and the flight of all photos with telemetry.
    picks, rows
        All picks, and numbers of those to predict: their photo and label are adjusted.
    is_alone
        (K,) adjusted labels off the ground of unknown height.
    """
    clicked = _locate_picks(adjustment, picks, rows)
    places = transfer_pixels(adjustment, flight, clicked)
    pick, label = np.array(rows, dtype=np.int64)[places.click], clicked.label[places.click]
    return Candidates(
        places,
        tuple((name, picks.label[i]) for name, i in zip(places.frame_id, pick, strict=True)),
        pick,
        adjustment.survey.off_ground[label],
        is_alone[label],
        adjustment,
    )


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

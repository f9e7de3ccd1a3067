"""Requested labels and photos of a project, their checks, and finds as rows of picks.csv."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.model.arrays import Bools
from uavgram.model.naming import join_names
from uavgram.model.observations import SAME_PLACE_PX, Picks, Source, append_rows
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.stages.match import Found, Pair


@dataclass(frozen=True)
class Selection:
    """Requested labels and photos by name; without names: all."""

    labels: tuple[str, ...] = ()
    photos: tuple[str, ...] = ()

    def has(self, pair: Pair) -> bool:
        """Return whether a label in a photo is requested."""
        image, label = pair
        return (not self.photos or image in self.photos) and (
            not self.labels or label in self.labels
        )


def mark_existing_matches(picks: Picks, asked: Selection) -> Bools:
    """Mark existing matches (P,) among the requested ones."""
    pairs = zip(picks.image, picks.label, strict=True)
    again = np.array([asked.has(pair) for pair in pairs], dtype=np.bool_)
    return picks.of_source("match") & again


def list_labels_without_height(picks: Picks, pairs: Iterable[Pair]) -> list[str]:
    """List the labels of pairs whose height is neither stated nor free."""
    stated = set(np.array(picks.label)[picks.is_free | ~np.isnan(picks.height_m)].tolist())
    return [label for _, label in pairs if label not in stated]


def find_sources(picks: Picks) -> dict[int, int]:
    """Return the pick that each match was found from, by row; none where that pick was moved."""
    clicks = picks.clicks
    sources: dict[int, int] = {}
    for i in np.flatnonzero(picks.of_source("match")).tolist():
        for own in clicks.get((picks.from_image[i], picks.label[i]), []):
            if np.linalg.norm(picks.pixel_px[own] - picks.from_px[i]) <= SAME_PLACE_PX:
                sources[i] = own
    return sources


def mark_valid_matches(picks: Picks) -> Bools:
    """Mark matches (P,) whose pick is where they were found from."""
    return np.isin(np.arange(len(picks.image)), list(find_sources(picks)))


def check_selection(inputs: Inputs, asked: Selection) -> None:
    """Refuse labels without a pick, and photos that the project does not have."""
    by_hand = list_manual_labels(inputs.picks)
    _check_names(inputs, asked, by_hand)
    if not by_hand:
        raise InputError(
            inputs.project.picks,
            "holds no pick made by a person, and only these are looked for in other photos: pick "
            "points with `uavgram pick`",
        )
    if len(inputs.photos.frame_id) < 2:
        raise InputError(
            inputs.project_path, "has one photo: there is no other one to find points in"
        )


def check_matches_exist(inputs: Inputs, asked: Selection) -> None:
    """Refuse labels and photos without a match."""
    _check_names(inputs, asked, tuple(dict.fromkeys(inputs.picks.label)))


_MAX_NAMED = 8


def _check_names(inputs: Inputs, asked: Selection, labels: tuple[str, ...]) -> None:
    """Refuse labels not among these, and photos that the project does not have."""
    for label in asked.labels:
        if label not in labels:
            hint = suggest_spelling(label, labels) or f"picked are {join_names(labels, _MAX_NAMED)}"
            raise InputError(inputs.project.picks, f"no label {label!r} is picked: {hint}")
    for photo in asked.photos:
        if photo not in inputs.photos.frame_id:
            names = inputs.photos.frame_id
            hint = suggest_spelling(photo, names) or f"it has {join_names(names, _MAX_NAMED)}"
            raise InputError(inputs.project_path, f"the project has no photo {photo!r}: {hint}")


def list_manual_labels(picks: Picks) -> tuple[str, ...]:
    """Return labels with a pick by a person."""
    by_hand = np.flatnonzero(picks.of_source("hand")).tolist()
    return tuple(dict.fromkeys(picks.label[i] for i in by_hand))


def append_matches(picks: Picks, found: Mapping[Pair, Found]) -> Picks:
    """Append finds to picks.

    Parameters
    ----------
    picks
        All picks.
    found
        By photo and label, each from one of these picks.
    """
    origin, news = [one.pick for one in found.values()], list(found.values())
    match: Source = "match"
    matches = Picks(
        image=tuple(image for image, _ in found),
        label=tuple(label for _, label in found),
        pixel_px=np.reshape([one.pixel_px for one in news], (len(news), 2)),
        sigma_px=np.array([one.sigma_px for one in news]),
        height_m=np.full(len(news), np.nan),
        source=(match,) * len(news),
        score=np.array([one.score for one in news]),
        from_image=tuple(picks.image[i] for i in origin),
        from_px=picks.pixel_px[origin],
    )
    return Picks(**append_rows(picks, matches) | {"line": ()})

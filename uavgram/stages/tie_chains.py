"""Chains of matches, and tie points, by index."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from uavgram.estimation.survey.observations.tied import PATCH_SIGMA_PX
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.observations import Picks
from uavgram.model.survey import NO_SIGHTINGS, Sightings, TiePicks

SAME_PICK_PX = 0.01
"""Largest distance between a pick and the place from which a match was found."""


def find_matches(
    picks: Picks, sigma_px: Floats, pick_index: Ints, frame_at: Mapping[str, int]
) -> tuple[Sightings, list[Message]]:
    """Build the chains of matches of a survey.

    Parameters
    ----------
    picks
        All P picks.
    sigma_px
        (P,) their sigmas, the default filled in.
    pick_index
        (P,) into the survey's picks; -1 for matches and for picks that take no part.
    frame_at
        Index of each frame that takes part.

    Returns
    -------
    matches
        One chain for each pick with matches.
    messages
        Messages on matches whose pick was moved or deleted.
    """
    # Assign each match to the pick at the place from which it was found.
    found = np.flatnonzero(picks.of_source("match"))
    if not len(found):
        return NO_SIGHTINGS, []
    at = picks.clicks
    chains: dict[int, list[int]] = {}
    stale: list[int] = []
    for i in found.tolist():
        clicks = at.get((picks.from_image[i], picks.label[i]), [])
        near = np.abs(picks.pixel_px[clicks] - picks.from_px[i]).max(axis=1) <= SAME_PICK_PX
        origin = clicks[int(near.argmax())] if near.any() else -1
        if origin < 0:
            stale.append(i)
        elif pick_index[origin] >= 0 and picks.image[i] in frame_at:
            chains.setdefault(origin, []).append(i)
    # Each chain begins with its pick, whose sigma is the noise of the photo around it.
    rows = [(origin, i) for origin, own in chains.items() for i in (origin, *own)]
    pick = np.array([i for _, i in rows], dtype=np.int64)
    place = {origin: k for k, origin in enumerate(chains)}
    is_first = np.array([origin == i for origin, i in rows], dtype=np.bool_)
    sightings = Sightings(
        frame=np.array([frame_at[picks.image[i]] for i in pick], dtype=np.int64),
        point=np.array([place[origin] for origin, _ in rows], dtype=np.int64),
        pixel_px=picks.pixel_px[pick],
        sigma_px=np.where(is_first, PATCH_SIGMA_PX, sigma_px[pick]),
        row=pick,
        pick=pick_index[list(chains)] if chains else np.zeros(0, dtype=np.int64),
    )
    return sightings, [_stale(picks, i) for i in stale]


def _stale(picks: Picks, i: int) -> Message:
    image, label = picks.image[i], picks.label[i]
    return Message(
        "warning",
        "match-stale",
        f"{label} in {image} is not used: it was found from a pick of {label} that was moved or "
        "deleted. Run `uavgram picks match` again, or delete the match.",
        frames=(image,),
        labels=(label,),
        several=MessagePlural(
            "{count} matches are not used: the picks that they were found from were moved or "
            "deleted",
            f"{label} in {image}",
            ending="Run `uavgram picks match` again, or delete these matches.",
        ),
    )


def find_ties(ties: TiePicks, frame_at: Mapping[str, int]) -> Sightings:
    """Return the tie points in two frames or more.

    Parameters
    ----------
    ties
        Tie points by name.
    frame_at
        Index of each frame that takes part.
    """
    rows = np.array([i for i, image in enumerate(ties.image) if image in frame_at], dtype=np.int64)
    if not len(rows):
        return NO_SIGHTINGS
    names = {name: k for k, name in enumerate(dict.fromkeys(ties.tie[i] for i in rows))}
    sightings = Sightings(
        frame=np.array([frame_at[ties.image[i]] for i in rows], dtype=np.int64),
        point=np.array([names[ties.tie[i]] for i in rows], dtype=np.int64),
        pixel_px=ties.pixel_px[rows],
        sigma_px=ties.sigma_px[rows],
        row=rows,
        pick=np.full(len(names), -1),
    )
    some, _ = sightings.remove(np.zeros(len(rows), dtype=np.bool_))
    return some

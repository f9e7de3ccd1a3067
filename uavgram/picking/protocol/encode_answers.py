"""Answers to questions and proposed picks as JSON."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.snapping import Region, Snapped, UnclearRegion, snap_corner, snap_within
from uavgram.model.arrays import Floats
from uavgram.model.survey import TiePicks
from uavgram.picking.document.commands import Place, SameGround, SideView, Snap, Ties
from uavgram.picking.document.proposals import Outcomes, select_certain
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_quantities import number, quantity_words, table_words
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, make_side_view
from uavgram.pipeline.pick.places import ExpectedPlace, project_ground

_DIGITS = 5


MATCHED_PX = 2.0
"""Standard deviation of a target's distance from its matched place [px]: that of the click.

On rendered streets seen at 45 degrees, with an expected place 25 px off, 55 of 81 matched targets
were snapped to, 18 were left to the person and 8 were confused with another one; with the matched
place all 81 were snapped to.
"""


def snap_json(
    photo: Pixels, asked: Snap, expected: ExpectedPlace | None, match: Place | None = None
) -> m.Snapped | m.NotSnapped:
    """Return the exact place, its sigma and its kind; or the reason for none, and the candidates.

    Parameters
    ----------
    photo
        (height, width, 3) BGR.
    asked
        Kind of target, and the pixel.
    expected
        Expected place, if known; else the search is near the pixel.
    match
        Match there of a pick in another photo: it decides between several targets.

    Returns
    -------
    answer
        `is_sure` where a person pointed at it, or the match decides; else it only looks like it.
    """
    pointer = np.array([asked.u_px, asked.v_px])
    any_thing = asked.target == "any"
    if match is not None:
        there = np.array([match.u_px, match.v_px]), MATCHED_PX**2 * np.eye(2)
        found = snap_within(photo, Region(*there, pointer), corners=any_thing)
    elif expected is not None:
        found = snap_within(photo, Region(*expected, pointer), corners=any_thing)
    else:
        found = snap_within(photo, Region.near(pointer), corners=False)
        if any_thing and isinstance(found, UnclearRegion) and not len(found.place_px):
            under = snap_corner(photo, asked.u_px, asked.v_px)
            found = under if isinstance(under, Snapped) else replace(found, why=under)
    if isinstance(found, UnclearRegion):
        return {"t": "snapped", "why": found.why, "places_px": found.place_px.tolist()}
    return {
        "t": "snapped",
        "u_px": found.u_px,
        "v_px": found.v_px,
        "sigma_px": round(found.sigma_px, 3),
        "what": found.what,
        "is_sure": match is not None or expected is None,
    }


def same_ground_json(
    survey: LiveSurvey, last: LiveAdjustment | None, asked: SameGround, index: Mapping[str, int]
) -> m.Ground:
    """Return the places of the same ground in other photos: u, v [px] and scale by photo number.

    Parameters
    ----------
    survey, last
        Project, and its last full adjustment, if there is one.
    asked
        Photo and pixel.
    index
        Numbers of the photos by name.
    """
    found = project_ground(survey, last, asked.image, (asked.u_px, asked.v_px))
    return {"t": "ground", "places": {str(index[name]): place for name, place in found.items()}}


def ties_json(ties: TiePicks, asked: Ties) -> m.TiePlaces:
    """Return the tie points in a photo, to a tenth of a pixel."""
    own = np.array([name == asked.image for name in ties.image], dtype=np.bool_)
    return {"t": "ties", "places_px": np.round(ties.pixel_px[own], 1).tolist()}


def side_json(last: LiveAdjustment | None, asked: SideView) -> m.Side:
    """Return a measurement's points along it: station, height and ground below [m] with sigmas.

    Parameters
    ----------
    last
        Last full adjustment, if there is one.
    asked
        Name of the measurement.
    """
    found = None if last is None else make_side_view(last, asked.name)
    if found is None:
        return {"t": "side", "points": []}
    rows = zip(found.label, found.place_m, found.sigma_m, strict=True)
    return {"t": "side", "points": [_side_point(*row) for row in rows]}


def _side_point(label: str, place: Floats, sigma: Floats) -> m.SidePoint:
    pairs = zip(place, sigma, strict=True)
    station, offset, height, ground = [
        (number(value, _DIGITS), number(spread, _DIGITS)) for value, spread in pairs
    ]
    return {
        "label": label,
        "station_m": station,
        "offset_m": offset,
        "height_m": height,
        "ground_m": ground,
        "station": table_words(float(place[0]), 2),
        "height": quantity_words(float(place[2]), float(sigma[2] or np.nan), "m"),
        "ground": table_words(float(place[3]), 2),
    }


def proposals_json(
    outcomes: Outcomes, index: Mapping[str, int], labels: Collection[str], searched: int
) -> m.Proposals:
    """Return all search results of some labels.

    Parameters
    ----------
    outcomes
        Search results.
    index
        Numbers of the photos by name.
    labels
        Labels whose results are wanted.
    searched
        Number of the last state for which all picks were searched.
    """
    found: list[m.Proposal] = []
    asked: list[m.Asked] = []
    sure = select_certain(outcomes)
    for (image, label), one in outcomes.items():
        if label not in labels:
            continue
        key: m.PhotoLabel = {"image": index[image], "label": label}
        if one.found is not None:
            place = one.found
            found.append(
                {
                    **key,
                    "u_px": place.u_px,
                    "v_px": place.v_px,
                    "sigma_px": place.sigma_px,
                    "score": place.score,
                    "source": place.source,
                    "from_image": index.get(place.from_image),
                    "is_sure": (image, label) in sure,
                }
            )
        elif one.is_asked:
            asked.append({**key, "why": one.why})
    return {"labels": sorted(labels), "found": found, "asked": asked, "searched": searched}

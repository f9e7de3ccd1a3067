"""Proposed picks in other photos, and labels to be picked by hand, as JSON."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from uavgram.picking.document.proposals import Outcomes, surely_found
from uavgram.picking.protocol.encode_survey import Json


def proposals_json(
    outcomes: Outcomes, index: Mapping[str, int], labels: Collection[str], left: int
) -> Json:
    """Return all search results of some labels.

    Parameters
    ----------
    outcomes
        Search results.
    index
        Numbers of the photos by name.
    labels
        Labels whose results are wanted.
    left
        Number of places still to be searched.
    """
    found, asked, sure = [], [], surely_found(outcomes)
    for (image, label), one in outcomes.items():
        if label not in labels:
            continue
        key = {"image": index[image], "label": label}
        if one.found is not None:
            place = one.found
            found.append(
                key
                | {"u_px": place.u_px, "v_px": place.v_px, "sigma_px": place.sigma_px}
                | {"score": place.score, "source": place.source}
                | {"from_image": index.get(place.from_image), "is_sure": (image, label) in sure}
            )
        elif one.is_asked:
            asked.append(key | {"why": one.why})
    return {"labels": sorted(labels), "found": found, "asked": asked, "left": left}

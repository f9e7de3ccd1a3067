"""Messages on the size of the errors that a survey shows."""

from __future__ import annotations

from collections.abc import Iterator

from uavgram.model.message import Message
from uavgram.model.naming import figures
from uavgram.model.result.reliability import AreaNoise, Noise, PickNoise

CARELESS = 2.5
"""Factor of the stated identification beyond which tape and picks no longer mean the same point."""

WORSE, BETTER = 1.3, 0.75
"""Factors of the stated sigma of picks beyond which a message is issued."""

BY_CHANCE = 0.001
"""Significance level for a whole survey: frequency of a plane ground being reported as uneven."""

SURE = 3.0
"""Least difference of the factor from one, in sigmas."""

LOOK = {
    "hand": "Look whether each label is at the same place in all photos.",
    "target": "Look whether the plates lay flat and still.",
    "match": "Look at those with the largest residuals.",
    "tie": "Something may have moved between the photos.",
}
"""Where to look for the reason of larger errors than stated."""


def noise_remarks(noise: Noise | None) -> Iterator[Message]:
    """Report uneven ground, and readings that are more or less exact than stated."""
    if noise is None:
        return
    for area in noise.roughness:
        yield from _ground(area, several=len(noise.roughness) > 1)
    for picks in noise.picks:
        if abs(picks.factor - 1.0) > SURE * picks.sigma:
            yield from _picks(picks, noise.called(picks))
    lengths = noise.lengths
    if lengths is not None and lengths.factor > max(WORSE, 1.0 + lengths.sigma):
        text = (
            f"The taped lengths fit less well than stated: {figures(lengths.stated_m)} m stated, "
            f"{figures(lengths.stated_m * lengths.factor)} m found. All uncertainties are wider "
            "for "
            "that. State in sigma_m how finely the tape was read."
        )
        yield Message("warning", "lengths-less-exact", text)
    beside = noise.identification
    if beside is not None and beside.factor > max(CARELESS, 1.0 + beside.sigma):
        text = (
            "Picks and lengths fit each other less well than stated: points were picked within "
            f"{_length(beside.stated_m)} of what was meant as stated, within "
            f"{_length(beside.stated_m * beside.factor)} as found. All uncertainties are wider for "
            "that, but several wrong lengths would look alike. Look whether tape and picks mean "
            "the same place of each mark, and whether each length was read right."
        )
        yield Message("warning", "identification-less-exact", text)


def _ground(area: AreaNoise, *, several: bool) -> Iterator[Message]:
    size = area.size_m
    if size <= area.stated_m * WORSE or area.probability > BY_CHANCE:
        return
    where = f"The ground of area {area.area!r}" if several else "This ground"
    shape = {
        "plane": "each point by itself",
        "quadratic": "as a crown or a hollow does",
        "correlated": "in smooth rises and hollows",
    }[area.shape]
    text = (
        f"{where} is not a plane: its points lie about {_length(size)} off it, {shape}; the "
        "drawing in the report shows where. The uncertainties contain that. Where they must be "
        "smaller: pick the points in more photos, or give other ground an area of its own."
    )
    yield Message("warning", "ground-not-plane", text)


def _length(size_m: float) -> str:
    return f"{figures(100 * size_m)} cm" if size_m < 1.0 else f"{figures(size_m)} m"


def _picks(picks: PickNoise, what: str) -> Iterator[Message]:
    """Report picks with other errors than stated; not matches that are merely more exact."""
    by_likeness = picks.source in ("match", "tie")
    stated = f"{figures(picks.stated_px)} px stated"
    found = (
        f"{figures(picks.stated_px * picks.factor)} ± {figures(picks.stated_px * picks.sigma, 1)} "
        "px found"
    )
    if picks.factor > WORSE:
        text = (
            f"The {what} are less exact than stated: {stated}, {found}. {LOOK[picks.source]} All "
            "uncertainties are wider for that."
        )
        if by_likeness:
            yield Message("info", "found-less-exact", text)
        else:
            yield Message("warning", "picks-less-exact", text)
    if picks.factor < BETTER and not by_likeness:
        text = (
            f"The {what} are more exact than stated: {stated}, {found}. "
            "All uncertainties are smaller for that."
        )
        yield Message("info", "picks-more-exact", text)

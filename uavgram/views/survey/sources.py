"""Origin of the picks in words: people, matching, targets, tie points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from uavgram.model.observations import Source
from uavgram.model.result.result import Result
from uavgram.model.result.tables import SOURCES, count_picks_by_source, is_only_by_program
from uavgram.views.formatting import number

SOURCE_WORDS: dict[Source, str] = {"hand": "by hand", "match": "matched", "target": "target"}

ONLY_PROGRAM = "only the program's picks"
"""Note beside a value that depends on no pick of a person."""


def has_automatic_picks(result: Result) -> bool:
    """Return whether the program made any of the picks."""
    return not result.picks.by_hand.all()


def counts_text(counts: Mapping[Source, int]) -> str:
    """Count picks by source: ``1 by hand, 4 matched``; empty if a person made all."""
    if not set(counts) - {"hand"}:
        return ""
    return ", ".join(
        f"{counts[source]} {SOURCE_WORDS[source]}"
        + ("s" if source == "target" and counts[source] > 1 else "")
        for source in SOURCES
        if counts.get(source)
    )


def picks_text(result: Result) -> str:
    """Describe the origin of all picks in a sentence; empty if people alone made them."""
    told = counts_text(Counter(result.picks.source))
    return f"Picks: {told}." if told else ""


def point_origins(result: Result) -> tuple[str, ...]:
    """Return the (K,) origins of the picks of points; empty texts if a person made all of them."""
    made = count_picks_by_source(result.picks)
    return tuple(counts_text(made.get(label, {})) for label in result.points.label)


def frame_origins(result: Result) -> tuple[str, ...]:
    """Return the (F,) origins of the picks in photos; empty texts if a person made all of them."""
    made: dict[str, Counter[Source]] = {}
    for image, source in zip(result.picks.image, result.picks.source, strict=True):
        made.setdefault(image, Counter())[source] += 1
    return tuple(counts_text(made.get(name, {})) for name in result.frames.frame_id)


def format_frame_ties(result: Result) -> tuple[str, ...]:
    """Format (F,) the tie points of each photo, and rms of their residuals: ``131 (0.21 px)``."""
    frames = result.frames
    pairs = zip(frames.ties.tolist(), frames.ties_rms_px.tolist(), strict=True)
    return tuple(f"{count} ({number(rms, 2)} px)" if count else "0" for count, rms in pairs)


def note_automatic_values(result: Result) -> tuple[str, ...]:
    """Return (M,) the note on each value's picks; empty if a person made some."""
    rows = result.measurements
    alone = is_only_by_program(result.picks, rows.points) & np.isfinite(rows.value)
    return tuple(ONLY_PROGRAM if one else "" for one in alone.tolist())


def ties_text(result: Result) -> str:
    """Describe all tie points in a sentence; empty if none were used."""
    ties = result.ties
    if ties is None:
        return ""
    return (
        f"{ties.points} tie points found by the program connect the photos: seen "
        f"{ties.sightings} times, residuals {number(ties.rms_px, 2)} px (root mean square of one "
        "coordinate)."
    )

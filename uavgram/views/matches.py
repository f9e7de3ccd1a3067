"""Result of a search for picks in the other photos, as lines for a terminal."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable

from uavgram.model.naming import counted, listed
from uavgram.stages.match import Matches, Pair

MOST_NAMED = 8
"""Largest number of names in a line; the others are counted only."""

ENOUGH = 3
"""Number of points in a photo from which its pose depends on them and not on the log alone."""


def match_lines(done: Matches) -> list[str]:
    """List the matches of each photo, failed searches with reasons, and picks to make by hand."""
    found, missed = done.record.found, done.record.in_vain
    looked = len(found) + len(missed)
    lines = [f"found:     {_found(len(found), looked, done)}"]
    lines += _by_photo(found, missed)
    lines += _reasons(missed)
    if done.not_sought:
        lines.append(
            f"not looked for: {listed(done.not_sought, MOST_NAMED)}: their picks are not used in "
            "the adjustment; `uavgram run` gives the reason"
        )
    if done.turned_rad:
        lines.append(
            f"the camera pointed some {math.degrees(done.turned_rad):.0f} degrees away from its "
            "direction by the flight log and `mount` in the project, so points may have been "
            "looked for in wrong places: if few were found, remove them (`uavgram picks match "
            "--undo`), write `ties: auto` into the project, which orients the photos to each "
            "other, and run this again"
        )
    if done.unplaced:
        lines.append(
            f"not looked in: {listed(done.unplaced, MOST_NAMED)}: its pose is unknown; "
            "pick three points or more there"
        )
    return lines + _to_ask(done)


def _found(found: int, looked: int, done: Matches) -> str:
    if looked:
        return f"{found} of {looked} places, of {counted(len(done.labels), 'label')}"
    if done.kept:
        return "no further search: earlier matches are kept"
    return "nothing was looked for: no other photo should show these labels"


def written_line(done: Matches) -> str:
    """Describe the written table: new matches, and earlier matches that were kept or removed."""
    line = f"written:   {done.path}, new matches: {len(done.record.found)}"
    if done.kept:
        line += f", earlier ones kept: {done.kept}"
    if done.replaced:
        line += f", taken out: {done.replaced} (their pick was moved, or they fit no longer)"
    return line


def _by_photo(found: Iterable[Pair], missed: Iterable[Pair]) -> list[str]:
    good = Counter(image for image, _ in found)
    every = good + Counter(image for image, _ in missed)
    width = max(map(len, every), default=0)
    return [f"  {image:<{width}}  {good[image]:>4} of {every[image]}" for image in sorted(every)]


def _reasons(missed: dict[Pair, str]) -> list[str]:
    by_reason: dict[str, list[str]] = defaultdict(list)
    for (image, label), why in sorted(missed.items()):
        by_reason[why].append(f"{label} in {image}")
    ordered = sorted(by_reason.items(), key=lambda one: -len(one[1]))
    return [
        "not found:",
        *(f"  {len(places):>4}  {why}: {listed(places, MOST_NAMED)}" for why, places in ordered),
    ] * bool(by_reason)


def _to_ask(done: Matches) -> list[str]:
    """List the labels and photos for which a pick by hand would add most information."""
    alone = [label for label, count in done.sightings.items() if count < 2]
    looked = {image for image, _ in (*done.record.found, *done.record.missed)}
    there = Counter(done.picks.image)
    few = sorted(image for image in looked if there[image] < ENOUGH)
    lines = []
    if alone:
        lines.append(f"  labels that one photo alone shows: {listed(alone, MOST_NAMED)}")
    if few:
        lines.append(f"  photos with fewer than {ENOUGH} points: {listed(few, MOST_NAMED)}")
    return ["better picked by you (`uavgram pick`):", *lines] if lines else []

"""What stands in a survey twice and says nothing new: counted twice, it would sharpen sigmas.

A copy of a photo carries the errors of its original (pose, picks, lens), and a length that was
copied the error of its reading; the adjustment takes observations for independent.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from uavgram.model.flight.frames import Photos
from uavgram.model.message import Message
from uavgram.model.naming import listed
from uavgram.model.survey.known import NO_KNOWN, KnownThings
from uavgram.model.survey.observations import KnownLines, Picks

_MOST_NAMED = 10


@dataclass(frozen=True, kw_only=True)
class Duplicates:
    """What is to be counted once.

    Attributes
    ----------
    photos
        Name of each photo that is not counted -> that of the one which is.
    lines
        Index of each known length that is not counted -> that of the one which is.
    messages
        All of it in words.
    known
        Index of each known thing that is not counted -> what is: a length or another known thing.
    """

    photos: Mapping[str, str]
    lines: Mapping[int, int]
    messages: tuple[Message, ...]
    known: Mapping[int, str] = field(default_factory=dict)

    def reason(self, frame_id: str) -> str:
        """Why a photo is not counted; empty where it is."""
        kept = self.photos.get(frame_id)
        return "" if kept is None else f"the same photo as {kept}, which is counted"


def find_duplicates(
    photos: Photos,
    sha256: Mapping[str, str],
    picks: Picks,
    lines: KnownLines,
    known: KnownThings = NO_KNOWN,
) -> Duplicates:
    """Find photos and lengths that are there more than once.

    Parameters
    ----------
    photos
        Of the project.
    sha256
        Of their files, by name.
    picks, lines, known
        Every one of them.
    """
    picked = _picked(photos, picks)
    by_content = [(sha256[name],) if name in sha256 else None for name in photos.frame_id]
    same_file = _copies(photos.frame_id, by_content, picked)
    rest = [name not in same_file for name in photos.frame_id]
    timed = zip(photos.frame_id, rest, photos.file_time_s.tolist(), strict=True)
    by_picks = [
        (time, frozenset(picked[name].items()))
        if is_other and picked[name] and math.isfinite(time)
        else None
        for name, is_other, time in timed
    ]
    saved_anew = _copies(photos.frame_id, by_picks, picked)
    same_lines = _same_lines(lines)
    same_known = _same_known(lines, known)
    return Duplicates(
        photos={**same_file, **saved_anew},
        lines=same_lines,
        messages=(
            *_photo_message("photo-duplicate", "the same file as", same_file, picked),
            *_photo_message(
                "photo-saved-anew", "with the capture time and all the picks of", saved_anew, picked
            ),
            *_pick_message(picks),
            *_line_messages(lines, same_lines),
            *_known_messages(known, same_known),
        ),
        known=same_known,
    )


Places = dict[str, tuple[float, float]]


def _picked(photos: Photos, picks: Picks) -> dict[str, Places]:
    """Photo -> label -> pixel."""
    picked: dict[str, Places] = {name: {} for name in photos.frame_id}
    for image, label, (u, v) in zip(picks.image, picks.label, picks.pixel_px.tolist(), strict=True):
        if image in picked:
            picked[image][label] = u, v
    return picked


def _copies(
    names: Iterable[str],
    keys: Iterable[tuple[object, ...] | None],
    picked: Mapping[str, Places],
) -> dict[str, str]:
    """Copy -> what is kept: of those with one key the one with most picks, then the first."""
    groups: dict[tuple[object, ...], list[str]] = {}
    for name, key in zip(names, keys, strict=True):
        if key is not None:
            groups.setdefault(key, []).append(name)
    copies: dict[str, str] = {}
    for group in groups.values():
        kept = max(group, key=lambda name: len(picked[name]))  # the first of the largest
        copies.update({name: kept for name in group if name != kept})
    return copies


def _same_lines(lines: KnownLines) -> dict[int, int]:
    """Length -> the one between the same labels, of the same tape and value, that is kept."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, ends in enumerate(zip(lines.start, lines.end, strict=True)):
        how = lines.tape_of(i), lines.along_of(i)
        groups.setdefault((frozenset(ends), float(lines.length_m[i]), *how), []).append(i)
    same: dict[int, int] = {}
    for group in groups.values():
        kept = max(group, key=lambda i: bool(lines.adjust[i]))  # the first that is not withheld
        same.update({i: kept for i in group if i != kept})
    return same


def _same_known(lines: KnownLines, known: KnownThings) -> dict[int, str]:
    """Known thing -> the length, or the earlier one, of the same points and value."""
    first: dict[tuple[object, ...], str] = {}
    for i in range(len(lines.name)):
        if lines.adjust[i] and lines.along_of(i) == "slope":
            ends = frozenset((lines.start[i], lines.end[i]))
            own: tuple[object, ...] = ("distance", ends, float(lines.length_m[i]), ())
            first.setdefault(own, f"the length {lines.name[i]!r}")
    same: dict[int, str] = {}
    for i in np.flatnonzero(known.adjust).tolist():
        kind, points, value = known.kind[i], known.points[i], float(known.value[i])
        places = frozenset(points) if kind == "distance" else min(points, points[::-1])
        shown = value if math.isfinite(value) else None
        key = (kind, places, shown, known.parameters[i])
        if key in first:
            same[i] = first[key]
        first.setdefault(key, repr(known.name[i]))
    return same


def _known_messages(known: KnownThings, same: Mapping[int, str]) -> tuple[Message, ...]:
    """One message on all known things that are not counted."""
    if not same:
        return ()
    parts = [f"{known.name[i]!r} is {kept} again" for i, kept in same.items()]
    text = (
        "What is known of the same points, with the same value, was counted once: "
        f"{'; '.join(parts[:_MOST_NAMED])}{_rest(parts)}. Remove the copies."
    )
    labels = dict.fromkeys(label for i in same for label in known.points[i])
    return (Message("warning", "known-duplicate", text, labels=tuple(labels)),)


def _photo_message(
    code: str, what: str, copies: Mapping[str, str], picked: Mapping[str, Places]
) -> tuple[Message, ...]:
    if not copies:
        return ()
    parts = []
    for name, kept in copies.items():
        lost = sorted(picked[name].keys() - picked[kept].keys())
        alone = listed(map(repr, lost), _MOST_NAMED)
        more = f" (picks of {alone} are in the copy alone: pick them in {kept})"
        parts.append(f"{name} is {what} {kept}{more if lost else ''}")
    count = f"{len(copies)} photo{'s are' if len(copies) > 1 else ' is'}"
    text = (
        f"{count} there twice and counted once, as a copy says nothing new: "
        f"{'; '.join(parts[:_MOST_NAMED])}{_rest(parts)}. Take the copies out of `images`."
    )
    return (Message("warning", code, text, frames=tuple(copies)),)


def _pick_message(picks: Picks) -> tuple[Message, ...]:
    """One message on all rows of picks that repeat another one."""
    copies = np.flatnonzero(picks.is_copy).tolist()
    if not copies:
        return ()
    parts = [f"{picks.label[i]!r} in {picks.image[i]}" for i in copies]
    text = (
        "The same click with the same pixel, to the last digit, was counted once: "
        f"{'; '.join(parts[:_MOST_NAMED])}{_rest(parts)}. Remove the copies; a second click checks "
        "the first only where it was made anew."
    )
    return (Message("warning", "pick-duplicate", text),)


def _line_messages(lines: KnownLines, same: Mapping[int, int]) -> tuple[Message, ...]:
    """One message on all lengths that are not counted."""
    if not same:
        return ()
    parts = []
    for kept in dict.fromkeys(same.values()):
        others = listed(
            [repr(lines.name[i]) for i, one in same.items() if one == kept], _MOST_NAMED
        )
        ends = f"{lines.start[kept]!r} to {lines.end[kept]!r}"
        parts.append(
            f"{lines.length_m[kept]:.10g} m from {ends} (counted: {lines.name[kept]!r}; not "
            f"counted: {others})"
        )
    text = (
        "The same length with the same reading, to the last digit, was counted once: "
        f"{'; '.join(parts[:_MOST_NAMED])}{_rest(parts)}. If it was copied, remove the copies. If "
        "it was taped again with this very reading, write down one more digit of each reading."
    )
    lengths = tuple(lines.name[i] for i in same)
    return (Message("warning", "line-duplicate", text, lengths=lengths),)


def _rest(parts: list[str]) -> str:
    more = len(parts) - _MOST_NAMED
    return f" and {more} more" if more > 0 else ""

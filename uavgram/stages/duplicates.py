"""Find duplicates in a survey, which are counted once: counted twice, they would reduce sigmas.

A copy of a photo has the errors of its original (pose, picks, lens), and a copied length the error
of its reading; the adjustment assumes independent observations.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from unicodedata import normalize

import numpy as np

from uavgram.errors import replace_lookalikes
from uavgram.estimation.survey.known_kinds import ALL_KINDS
from uavgram.model.frames import Photos
from uavgram.model.message import Message
from uavgram.model.naming import join_names, photo_name
from uavgram.model.observations import NO_KNOWN, KnownLines, KnownThings, Picks

_MAX_NAMED = 10
_LEADING_ZEROS = re.compile(r"(?<!\d)(?<!\d[.,])0+(?=\d)")  # those of 1.05 are none

MAX_AT_ONCE = 8
"""Largest number of photos with one capture time that are searched for copies: more are from a
stopped clock."""

MAX_SAME_POINT_PX = 5.0
"""Largest distance of two clicks of a person on the same point of one exposure, at a standard
deviation of up to a pixel; in proportion to a larger one."""


@dataclass(frozen=True, kw_only=True)
class Duplicates:
    """Items to be counted once.

    Attributes
    ----------
    photos
        Name of each photo that is not counted -> that of the counted one.
    lines
        Index of each known length that is not counted -> that of the counted one.
    messages
        Messages on all duplicates.
    known
        Index of each known thing that is not counted -> the counted length or known thing.
    contradicting
        Name of each photo with picks that contradict those in another copy of the same file -> that
        copy. Nothing shows which of them are of another photo, so none is an observation.
    """

    photos: Mapping[str, str]
    lines: Mapping[int, int]
    messages: tuple[Message, ...]
    known: Mapping[int, str] = field(default_factory=dict)
    contradicting: Mapping[str, str] = field(default_factory=dict)

    def reason(self, frame_id: str) -> str:
        """Return the reason why a photo or its picks are not counted; empty where they are."""
        if other := self.contradicting.get(frame_id):
            return f"the same file as {other}, which is picked at other places"
        kept = self.photos.get(frame_id)
        return "" if kept is None else f"the same photo as {kept}, which is counted"


def find_duplicates(
    photos: Photos,
    sha256: Mapping[str, str],
    picks: Picks,
    lines: KnownLines,
    known: KnownThings = NO_KNOWN,
    is_same: Callable[[str, str], bool] = lambda _one, _other: False,
    picks_sigma_px: float = 1.0,
) -> Duplicates:
    """Find photos and lengths that occur more than once.

    Parameters
    ----------
    photos
        Photos of the project.
    sha256
        Hashes of their files, by name.
    picks, lines, known
        All picks, lengths and known things.
    is_same
        Function that decides whether two photos, by name, are of one camera and show the same;
        called for those that may be one exposure.
    picks_sigma_px
        Standard deviation of picks that state none.
    """
    clicks = _Clicks(picks, picks_sigma_px)
    same_file, saved_anew = _same_exposures(photos, sha256, clicks, is_same)
    contradicting = _find_contradicting(clicks, same_file)
    repeated = {copy: kept for copy, kept in same_file.items() if copy not in contradicting}
    same_lines = _same_lines(lines)
    same_known = _find_duplicate_things(lines, known)
    return Duplicates(
        photos={**same_file, **saved_anew},
        lines=same_lines,
        messages=(
            *_report_contradicting(clicks, contradicting),
            *_photo_message("photo-duplicate", "the same file as", repeated),
            *_photo_message("photo-saved-anew", "the same exposure as", saved_anew),
            *_pick_message(picks),
            *_line_messages(lines, same_lines),
            *_report_duplicate_things(known, same_known),
            *_alike_messages(picks),
        ),
        known=same_known,
        contradicting=contradicting,
    )


class _Clicks:
    """Picks by photo, to be compared between photos."""

    def __init__(self, picks: Picks, sigma_px: float) -> None:
        self.picks = picks
        self.sigma_px = np.where(np.isnan(picks.sigma_px), sigma_px, picks.sigma_px)
        self.rows: dict[str, list[int]] = {}
        for i, image in enumerate(picks.image):
            self.rows.setdefault(image, []).append(i)

    def list_apart(self, one: str, other: str) -> dict[str, float]:
        """Return the distance of the clicks on each common label, in `MAX_SAME_POINT_PX`."""
        picks, found = self.picks, dict[str, float]()
        for i in self.rows.get(one, ()):
            for k in self.rows.get(other, ()):
                if picks.label[i] == picks.label[k]:
                    apart_px = np.abs(picks.pixel_px[i] - picks.pixel_px[k]).max()
                    sigma_px = max(1.0, self.sigma_px[i], self.sigma_px[k])
                    found[picks.label[i]] = float(apart_px / (MAX_SAME_POINT_PX * sigma_px))
        return found

    def may_be_same(self, one: str, other: str) -> bool:
        """Return whether two photos have most of their common labels at nearly the same pixels."""
        apart = self.list_apart(one, other)
        return not apart or float(np.median(list(apart.values()))) <= 1.0


def _find_contradicting(clicks: _Clicks, same_file: Mapping[str, str]) -> dict[str, str]:
    """Find copies of a file in which most labels are picked at other places, and the other copies.

    A picture is the same in all of its copies, so that the picks of some are of another photo.
    """
    found: dict[str, str] = {}
    for copy, kept in same_file.items():
        if not clicks.may_be_same(kept, copy):
            found |= {kept: copy, copy: kept}
    others = {copy: kept for copy, kept in same_file.items() if kept in found}
    return found | {copy: found.get(copy, kept) for copy, kept in others.items()}


def _report_contradicting(clicks: _Clicks, contradicting: Mapping[str, str]) -> Iterator[Message]:
    """Report each pair of copies with contradicting picks, and the photo that these may be of."""
    for one, other in contradicting.items():
        apart = clicks.list_apart(one, other)
        labels = [label for label, far in apart.items() if far > 1.0]
        if contradicting[other] != one or one > other or not labels:
            continue
        of_others = "".join(
            f" Those in {mine} are at the places of {third}."
            for mine in (one, other)
            for third in clicks.rows
            if third not in contradicting
            and clicks.list_apart(mine, third)
            and clicks.may_be_same(mine, third)
        )
        yield Message(
            "warning",
            "copies-contradict",
            f"{one} and {other} are the same file, but {join_names(map(repr, labels), _MAX_NAMED)} "
            f"{'are' if len(labels) > 1 else 'is'} picked at other places in one than in the "
            "other: the picks of one of the two are of another photo. Neither's are used."
            f"{of_others} Look at both, and delete the wrong picks, or pick them in their own "
            "photo.",
            frames=(one, other),
            labels=tuple(labels),
        )


def _same_exposures(
    photos: Photos, sha256: Mapping[str, str], clicks: _Clicks, is_same: Callable[[str, str], bool]
) -> tuple[dict[str, str], dict[str, str]]:
    """Map copies of a file, and other files of an exposure, to the counted photo.

    The first by name with a capture time is counted of each exposure. A photo without a time is
    compared with those that have a label at nearly the same pixel, and with the one before it where
    its name continues that name, as for a copy (`a (1).jpg` of `a.jpg`). Other files whose common
    labels are at other pixels are no copies, even if they look alike, as photos of plain asphalt
    do.
    """
    time_s = dict(zip(photos.frame_id, photos.file_time_s.tolist(), strict=True))
    picks, rows = clicks.picks, clicks.rows
    counted: dict[str, str] = {}  # by content of the file
    at_time: dict[float, list[str]] = {}
    of_label: dict[str, list[int]] = {}
    files: dict[str, str] = {}
    exposures: dict[str, str] = {}
    before = ""
    for name in sorted(time_s, key=lambda name: (math.isnan(time_s[name]), photo_name(name))):
        content, own = sha256.get(name, name), rows.get(name, [])
        near = at_time.get(time_s[name], [])
        near = near if len(near) < MAX_AT_ONCE else []
        if math.isnan(time_s[name]):
            pairs = [(i, k) for i in own for k in of_label.get(picks.label[i], ())]
            apart = [np.abs(picks.pixel_px[i] - picks.pixel_px[k]).max() for i, k in pairs]
            near = [
                *(
                    picks.image[k]
                    for (_, k), px in zip(pairs, apart, strict=True)
                    if px <= MAX_SAME_POINT_PX
                ),
                *([before] if before and _continues(photo_name(before), photo_name(name)) else []),
            ]
        near = [one for one in dict.fromkeys(near) if clicks.may_be_same(one, name)]
        if content in counted:
            files[name] = counted[content]
        elif same := next((other for other in near if is_same(other, name)), ""):
            counted[content] = exposures[name] = same
        else:
            counted[content] = before = name
            at_time.setdefault(time_s[name], []).append(name)
            for i in own:
                of_label.setdefault(picks.label[i], []).append(i)
    return files, exposures


def _continues(name: str, other: str) -> bool:
    """Return whether a name continues another one; photo10 is no copy of photo1."""
    rest = other.removeprefix(name)
    return rest != other and not (name[-1:].isdigit() and rest[:1].isdigit())


def _same_lines(lines: KnownLines) -> dict[int, int]:
    """Map each duplicate length to the kept one, of equal labels, tape and value."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for i, ends in enumerate(zip(lines.start, lines.end, strict=True)):
        how = lines.tape[i], lines.along_of(i)
        groups.setdefault((frozenset(ends), float(lines.length_m[i]), *how), []).append(i)
    same: dict[int, int] = {}
    for group in groups.values():
        kept = max(group, key=lambda i: bool(lines.adjust[i]))  # the first that is not withheld
        same.update({i: kept for i in group if i != kept})
    return same


def _find_duplicate_things(lines: KnownLines, known: KnownThings) -> dict[int, str]:
    """Map each duplicate known thing to the length, or earlier thing, of equal points and value."""
    first: dict[tuple[object, ...], str] = {}
    for i in range(len(lines.name)):
        if lines.adjust[i] and lines.along_of(i) == "slope":
            ends = frozenset((lines.start[i], lines.end[i]))
            own: tuple[object, ...] = ("distance", ends, float(lines.length_m[i]), ())
            first.setdefault(own, f"the length {lines.name[i]!r}")
    same: dict[int, str] = {}
    for i in np.flatnonzero(known.adjust).tolist():
        kind, points, value = known.kind[i], known.points[i], float(known.value[i])
        backwards = points if ALL_KINDS[kind].is_directed else points[::-1]
        places = frozenset(points) if kind == "distance" else min(points, backwards)
        shown = value if math.isfinite(value) else None
        key = (kind, places, shown, known.parameters[i])
        if key in first:
            same[i] = first[key]
        first.setdefault(key, repr(known.name[i]))
    return same


def _report_duplicate_things(known: KnownThings, same: Mapping[int, str]) -> tuple[Message, ...]:
    """Report all known things that are not counted."""
    if not same:
        return ()
    parts = [f"{known.name[i]!r} is {kept} again" for i, kept in same.items()]
    text = (
        "Repeated known values of the same points were counted once: "
        f"{'; '.join(parts[:_MAX_NAMED])}{_rest(parts)}. Remove the copies."
    )
    labels = dict.fromkeys(label for i in same for label in known.points[i])
    return (Message("warning", "known-duplicate", text, labels=tuple(labels)),)


def _photo_message(code: str, what: str, copies: Mapping[str, str]) -> tuple[Message, ...]:
    if not copies:
        return ()
    parts = [f"{name} is {what} {kept}" for name, kept in copies.items()]
    count = f"{len(copies)} photo{'s are' if len(copies) > 1 else ' is'}"
    text = (
        f"{count} there twice and counted once, as a copy adds no information: "
        f"{'; '.join(parts[:_MAX_NAMED])}{_rest(parts)}. Picks in both are repeats of one "
        "observation. Take the copies out of `images`."
    )
    return (Message("warning", code, text, frames=tuple(copies)),)


def _pick_message(picks: Picks) -> tuple[Message, ...]:
    """Report all rows of picks that repeat another one."""
    copies = np.flatnonzero(picks.is_copy).tolist()
    if not copies:
        return ()
    parts = list(dict.fromkeys(f"{picks.label[i]!r} in {picks.image[i]}" for i in copies))
    text = (
        "The same click with the same pixel, to the last digit, was counted once: "
        f"{'; '.join(parts[:_MAX_NAMED])}{_rest(parts)}. Remove the copies; a second click checks "
        "the first only if you really clicked again."
    )
    return (Message("warning", "pick-duplicate", text),)


def _line_messages(lines: KnownLines, same: Mapping[int, int]) -> tuple[Message, ...]:
    """Report all lengths that are not counted."""
    if not same:
        return ()
    parts = []
    for kept in dict.fromkeys(same.values()):
        others = join_names(
            [repr(lines.name[i]) for i, one in same.items() if one == kept], _MAX_NAMED
        )
        ends = f"{lines.start[kept]!r} to {lines.end[kept]!r}"
        parts.append(
            f"{lines.length_m[kept]:.10g} m from {ends} (counted: {lines.name[kept]!r}; not "
            f"counted: {others})"
        )
    text = (
        "The same length with the same reading, to the last digit, was counted once: "
        f"{'; '.join(parts[:_MAX_NAMED])}{_rest(parts)}. If it was copied, remove the copies. If "
        "it was taped again with this very reading, write down one more digit of each reading."
    )
    lengths = tuple(lines.name[i] for i in same)
    return (Message("warning", "line-duplicate", text, lengths=lengths),)


def _alike_messages(picks: Picks) -> Iterator[Message]:
    """Report labels that are picked once and look like another: one point may have both."""
    count = Counter(picks.label)
    looks = {label: list_looks(label) for label in sorted(count, key=lambda label: count[label])}
    groups: dict[str, list[str]] = {}
    for label, own in looks.items():
        for look in own:
            groups.setdefault(look, []).append(label)
    reported: set[str] = set()
    for label, own in looks.items():
        others = dict.fromkeys(other for look in own for other in groups[look] if other != label)
        if count[label] > 1 or label in reported or not others:
            continue
        reported |= {label, *others}
        image = picks.image[picks.label.index(label)]
        text = (
            f"The label {label!r} is picked once, in {image}, and looks like "
            f"{join_names(map(repr, others))}: if that is the same point, give it one label."
        )
        yield Message("warning", "label-resembles", text, labels=(label, *others))


def list_looks(label: str) -> list[str]:
    """List what a label looks like in print: with its leading zeros, and without them."""
    return sorted(
        {
            replace_lookalikes(label),
            replace_lookalikes(_LEADING_ZEROS.sub("", normalize("NFKC", label))),
        }
    )


def _rest(parts: list[str]) -> str:
    more = len(parts) - _MAX_NAMED
    return f" and {more} more" if more > 0 else ""

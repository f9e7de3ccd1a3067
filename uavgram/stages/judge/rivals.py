"""Messages on left-out readings in whose place others may be wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from uavgram.estimation.survey.adjustment import Reading, Refined
from uavgram.model.message import (
    Message,
    Remedy,
    propose_length_removal,
    propose_pick_removal,
)
from uavgram.model.naming import join_names
from uavgram.stages.judge.tested_survey import is_mount_open
from uavgram.stages.remedies import read_first

AGAIN = {
    "pixels": "click on {} again or in another photo (and look at a stated height)",
    "lengths": "tape {} again",
    "known": "measure {} again",
    "control": "look at the coordinates of {}",
}
"""Advice to check readings, by their kind."""


def list_contested(refined: Refined) -> tuple[Reading, ...]:
    """List the left-out readings in whose place others, or the camera's mount, may be wrong."""
    if not is_mount_open(refined.adjustment):
        return refined.contested
    by_mount = [one for one in refined.left_out if one.kind == "lengths"]
    return tuple(dict.fromkeys((*refined.contested, *by_mount)))


def judge_rivals(refined: Refined) -> Iterator[Message]:
    """Report left-out readings together with the others that may be wrong in their place."""
    settled = refined.settled
    left = tuple(one for one in list_contested(refined) if one.name not in settled)
    # Two clicks of one point in a photo have their own message.
    left = tuple(one for one in left if not _is_repeated(refined, one))
    if not left:
        return
    sets = [left, *(one.readings for one in refined.rivals if set(one.instead_of) & set(left))]
    every = tuple(dict.fromkeys(chain.from_iterable(sets)))
    if len(sets) == 1:  # another mistake, or the mount, explains as much
        sets = [(one,) for one in left]
    suspects = _name_suspects(sets)
    action = _advise(every)
    if is_mount_open(refined.adjustment):
        suspects.append("the camera's direction, straight down, which is only assumed")
        action = f"State the camera's direction in `mount`. {action}"
    clicks = [one for one in every if one.kind == "pixels"]
    others = refined.possible
    either = join_names(suspects, None, link="or")
    finding = f"One of these is wrong: {either}"
    if others:
        mistakes = (one.split_text(": ")[0].removesuffix(".") for one in others)
        finding = f"Either {either} is wrong, or {', or '.join(map(_lower_first, mistakes))}"
        action = f"{action}, or look whether the other mistake was made"
    were = "was" if len(left) == 1 else "were"
    # What a click spoils is at its point; what a reading between points spoils, at each of these.
    labels = [label for one in clicks or every for label in one.labels]
    lengths = [one.name for one in every if one.kind == "lengths"]
    yield Message(
        "warning",
        "blunder-not-located",
        f"{finding}. All the rest fits without any one of them, and nothing shows which. Of these, "
        f"{join_names([one.words for one in left])} {were} left out. {action}.",
        frames=_merge([one.frames for one in every], [one.frames for one in others]),
        labels=_merge([labels], [one.labels for one in others]),
        lengths=_merge([lengths], [one.lengths for one in others]),
        instead=tuple(one for one in read_first(map(_remove, every)) if one is not None),
    )


def _is_repeated(refined: Refined, left: Reading) -> bool:
    """Return whether another click of the same point in a photo is the rival of a click."""
    return any(
        left.kind == one.kind == "pixels" and left.name == one.name
        for rival in refined.rivals
        for one in rival.readings
    )


def _name_suspects(sets: Sequence[tuple[Reading, ...]]) -> list[str]:
    """Name readings that are wrong together or alone; single clicks of a photo in one phrase."""
    clicks: dict[str, list[str]] = {}
    found: list[str] = []
    for some in dict.fromkeys(sets):
        if len(some) == 1 and some[0].kind == "pixels":
            clicks.setdefault(some[0].frames[0], []).append(repr(some[0].name))
        else:
            every = "both" if len(some) == 2 else "all of them"
            words = join_names((one.words for one in some), None)
            found.append(words if len(some) == 1 else f"{words} ({every})")
    for frame, names in clicks.items():
        found.append(f"the click on {join_names(names, None, link='or')} in {frame!r}")
    return found


def _advise(readings: Sequence[Reading]) -> str:
    """Return the advice how to check some readings, as a sentence."""
    names: dict[str, list[str]] = {}
    for one in readings:
        names.setdefault(one.kind, []).append(repr(one.name))
    parts = [AGAIN[kind].format(join_names(some, None)) for kind, some in names.items()]
    advice = ", and ".join(parts)
    return advice[:1].upper() + advice[1:]


def _remove(reading: Reading) -> Remedy | None:
    if reading.kind == "lengths":
        return propose_length_removal([reading.name])
    if reading.kind == "pixels":
        return propose_pick_removal([(reading.frames[0], reading.name)])
    return None


def _merge(*groups: Sequence[Sequence[str]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for group in groups for names in group for name in names))


def _lower_first(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]

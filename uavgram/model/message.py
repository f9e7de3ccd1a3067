"""Messages beside the numbers, and remedies by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from uavgram.model.naming import listed_photos

Action = Literal[
    "swap", "unpick", "move", "length", "ends", "read", "remove-length", "free", "on-ground", "tape"
]
"""``swap`` labels; ``unpick`` or ``move`` a pick; correct a ``length`` or its ``ends``;
``read`` a length again, before ``remove-length`` is done to it, as one that is only withheld still
contradicts; ``free`` a height, or state that
a point is ``on-ground``. ``read`` and ``tape`` are work for a person, and change nothing that was
written."""


@dataclass(frozen=True, kw_only=True)
class Correction:
    """One change of what people wrote.

    Attributes
    ----------
    action
        What is changed; it says which of the rest are there.
    frame, label
        The pick, or the label alone. A swap without a photo is of all photos.
    other
        The label with which it is exchanged.
    pixel_px
        Column and row where a pick should be.
    length, length_m, ends
        Name of a known length; what it should read; the labels between which it is.
    """

    action: Action
    frame: str = ""
    label: str = ""
    other: str = ""
    pixel_px: tuple[float, ...] = ()
    length: str = ""
    length_m: float | None = None
    ends: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """What would put something right.

    Attributes
    ----------
    action
        What it does.
    words
        The same for people, as on a button: ``Swap 'P1' and 'P2' in 'IMG_0046.jpg'``.
    corrections
        Changes, in the order in which they are made; all of them together. None where nothing that
        was written is to be changed.
    """

    action: Action
    words: str
    corrections: tuple[Correction, ...] = ()


PLURAL: dict[Action, str] = {
    "swap": "Swap all of these labels",
    "move": "Put all of these photos back",
    "length": "Correct these {count} lengths",
    "ends": "Correct the ends of these {count} lengths",
    "read": "Read these {count} lengths again",
    "remove-length": "Remove these {count} lengths",
    "free": "Free these {count} heights",
}
"""Words for several at once. Nobody should remove several picks without a look at each."""


def together(remedies: Sequence[Remedy | None]) -> Remedy | None:
    """Remedies of one kind as one; None where one lacks, or they are not to be done together."""
    known = [one for one in remedies if one is not None]
    actions = {one.action for one in known}
    if len(known) < len(remedies) or len(actions) != 1:
        return None
    (action,) = actions
    if action not in PLURAL:
        return None
    every = dict.fromkeys(change for one in known for change in one.corrections)
    words = PLURAL[action].format(count=len(every))
    return Remedy(action=action, words=words, corrections=tuple(every))


def unpicked(pairs: Sequence[tuple[str, str]]) -> Remedy | None:
    """Picks, by photo and label, removed; None without any."""
    if not pairs:
        return None
    frames = list(dict.fromkeys(frame for frame, _ in pairs))
    what = f"the pick of {pairs[0][1]}" if len(pairs) == 1 else f"these {len(pairs)} picks"
    return Remedy(
        action="unpick",
        words=f"Remove {what} in {listed_photos(frames)}",
        corrections=tuple(Correction(action="unpick", frame=f, label=one) for f, one in pairs),
    )


def without_lengths(names: Sequence[str]) -> Remedy | None:
    """Known lengths removed; None without any, or where they have no names."""
    if not all(names) or not names:
        return None
    what = f"the length {names[0]}" if len(names) == 1 else f"these {len(names)} lengths"
    return Remedy(
        action="remove-length",
        words=f"Remove {what}",
        corrections=tuple(Correction(action="remove-length", length=name) for name in names),
    )


Level = Literal["info", "warning", "error"]

SUBJECTS = ("frames", "labels", "lengths", "measurements", "files")
"""Kinds of things that a message may speak of, each a field of `Message`."""

NUMBERS = ("heights_m", "heights_sigma_m")
"""Fields of `Message` with a number for each of its labels."""


@dataclass(frozen=True)
class Several:
    """How a message is told in one sentence with others of its kind.

    Attributes
    ----------
    opening
        What holds of all of them, without a full stop; ``{count}`` stands for their number.
    item
        This one, in a few words.
    why
        The reason, in a few words; those that share it stand together. Empty where there is none.
    ending
        What to do, said once behind the list, as a sentence.
    """

    opening: str
    item: str
    why: str = ""
    ending: str = ""


@dataclass(frozen=True)
class Message:
    """One remark for the user; it goes to results.json, to the report and on screen.

    Attributes
    ----------
    level
        ``info``: a choice that was made; ``warning``: look at this; ``error``: something that was
        asked for could not be computed.
    code
        Stable, machine-readable, kebab-case: ``label-unseen``, ``frame-unmatched``...
    text
        One sentence or two: what, where, and what to do.
    frames, labels, lengths, measurements, files
        Names of what it speaks of.
    heights_m, heights_sigma_m
        Heights above the ground that it tells of, one for each of `labels`; else empty.
    several
        How it is told together with others of its code and opening; None: always alone. No part of
        what is stored.
    plain
        What is wrong, in one sentence, where its code and subjects do not say it all.
    mend, instead
        What would put it right, and what else could where nothing tells which; stored with the
        verdict.
    """

    level: Level
    code: str
    text: str
    frames: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    lengths: tuple[str, ...] = ()
    measurements: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    heights_m: tuple[float, ...] = ()
    heights_sigma_m: tuple[float, ...] = ()
    several: Several | None = field(default=None, compare=False, repr=False)
    plain: str = field(default="", compare=False, repr=False)
    mend: Remedy | None = field(default=None, compare=False, repr=False)
    instead: tuple[Remedy, ...] = field(default=(), compare=False, repr=False)

    def record(self) -> dict[str, str | list[str] | list[float]]:
        """Everything that is stored: level, code, text, the subjects and numbers that it has."""
        more = {what: getattr(self, what) for what in (*SUBJECTS, *NUMBERS)}
        told = {what: list(values) for what, values in more.items() if values}
        return {"level": self.level, "code": self.code, "text": self.text, **told}

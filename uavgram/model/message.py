"""Messages of a result, and the corrections (remedies) that they propose."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

from uavgram.model.naming import OPTIONAL, join_photo_names, photo_name

Action = Literal[
    "swap",
    "unpick",
    "take-back",
    "move",
    "length",
    "ends",
    "read",
    "remove-length",
    "free",
    "on-ground",
    "leave-out",
    "tape",
]
"""Kind of a correction.

``swap`` labels; ``unpick`` or ``move`` a pick, or ``take-back`` the last of several clicks of one
point in a photo; correct a ``length`` or its ``ends``; ``read`` a
length again, before ``remove-length``, since a length that is only withheld still contradicts;
``free`` a height, or state that a point is ``on-ground``; ``leave-out`` a photo. ``read`` and
``tape`` are work for a person and change no input.
"""


@dataclass(frozen=True, kw_only=True)
class Correction:
    """One change of the user's input.

    Attributes
    ----------
    action
        Kind of change; it determines which of the other fields are set.
    frame, label
        Photo and label of a pick, or the label alone. A swap without a photo applies to all photos.
    other
        Label to exchange with `label`.
    pixel_px
        Corrected column and row of the pick.
    length, length_m, ends
        Name of a known length; its corrected value; its corrected end labels.
    """

    action: Action
    frame: Annotated[str, OPTIONAL] = ""
    label: Annotated[str, OPTIONAL] = ""
    other: Annotated[str, OPTIONAL] = ""
    pixel_px: Annotated[tuple[float, ...], OPTIONAL] = ()
    length: Annotated[str, OPTIONAL] = ""
    length_m: Annotated[float | None, OPTIONAL] = None
    ends: Annotated[tuple[str, ...], OPTIONAL] = ()


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """Correction proposed with a message.

    Attributes
    ----------
    action
        Kind of correction.
    words
        Text for people, as on a button: ``Swap 'P1' and 'P2' in 'IMG_0046.jpg'``.
    corrections
        Changes in the order in which they are made, all of them together. Empty where no input is
        to be changed.
    """

    action: Action
    words: str
    corrections: tuple[Correction, ...] = ()


FREE_HEIGHT = "(`free` in the column height_m of picks.csv)"
"""The way, in files, to let the height of a point be found."""

JUST_AS_LIKELY = "Or, just as likely:"
"""Begin a sentence on another cause that explains a misfit as well."""

PLURAL: dict[Action, str] = {
    "swap": "Swap all of these labels",
    "move": "Put all of these photos back",
    "length": "Correct these {count} lengths",
    "ends": "Correct the ends of these {count} lengths",
    "read": "Read these {count} lengths again",
    "remove-length": "Remove these {count} lengths",
    "free": "Free these {count} heights",
    "leave-out": "Leave these {count} photos out",
}
"""Button texts for several corrections at once.

``unpick`` is missing: each pick should be looked at before it is removed.
"""


def merge_remedies(remedies: Sequence[Remedy | None]) -> Remedy | None:
    """Merge remedies of the same kind into one; None if one is missing or they must stay apart."""
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


def propose_pick_removal(pairs: Sequence[tuple[str, str]]) -> Remedy | None:
    """Return the remedy that removes picks, given by photo and label; None without any."""
    if not pairs:
        return None
    what = f"the pick of {pairs[0][1]}" if len(pairs) == 1 else f"these {len(pairs)} picks"
    return _of_picks("unpick", f"Remove {what}", pairs)


def propose_taking_back(pairs: Sequence[tuple[str, str]]) -> Remedy:
    """Return the remedy that takes the second clicks back, given by photo and label."""
    what = f"click of {pairs[0][1]}" if len(pairs) == 1 else f"clicks of these {len(pairs)} picks"
    return _of_picks("take-back", f"Take back the second {what}", pairs)


def _of_picks(action: Action, words: str, pairs: Sequence[tuple[str, str]]) -> Remedy:
    frames = list(dict.fromkeys(frame for frame, _ in pairs))
    return Remedy(
        action=action,
        words=f"{words} in {join_photo_names(frames)}",
        corrections=tuple(Correction(action=action, frame=f, label=one) for f, one in pairs),
    )


def propose_free_heights(labels: Sequence[str]) -> Remedy | None:
    """Return a correction that frees heights of points; None without any."""
    if not labels:
        return None
    what = f"the height of {labels[0]}" if len(labels) == 1 else f"these {len(labels)} heights"
    return Remedy(
        action="free",
        words=f"Free {what}",
        corrections=tuple(Correction(action="free", label=label) for label in labels),
    )


def propose_swap(first: str, second: str) -> Remedy:
    """Return the remedy that exchanges two labels in all photos."""
    return Remedy(
        action="swap",
        words=f"Swap {first} and {second} in all photos",
        corrections=(Correction(action="swap", label=first, other=second),),
    )


def propose_photo_removal(frame: str) -> Remedy:
    """Return the remedy that leaves a photo out; its picks stay in the table."""
    return Remedy(
        action="leave-out",
        words=f"Leave {photo_name(frame)} out",
        corrections=(Correction(action="leave-out", frame=frame),),
    )


def propose_length_removal(names: Sequence[str]) -> Remedy | None:
    """Return the remedy that removes known lengths; None without any, or if one has no name."""
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
"""Kinds of subjects that a message may name, each a field of `Message`."""

NUMBERS = ("heights_m", "heights_sigma_m")
"""Fields of `Message` with a number for each of its labels."""


@dataclass(frozen=True)
class MessagePlural:
    """Parts of a message from which one sentence for several messages of its kind is made.

    Attributes
    ----------
    opening
        Statement that holds for all of them, without a full stop; ``{count}`` is replaced by their
        number.
    item
        This message, in a few words.
    why
        Reason, in a few words; messages with the same reason are grouped. Empty where there is
        none.
    ending
        Sentence with the action, written once after the list.
    """

    opening: str
    item: str
    why: str = ""
    ending: str = ""


@dataclass(frozen=True)
class Message:
    """Message for the user, in results.json, in the report and on screen.

    Attributes
    ----------
    level
        ``info``: a choice that was made; ``warning``: look at this; ``error``: a requested value
        could not be computed.
    code
        Stable, machine-readable, kebab-case: ``label-unseen``, ``frame-unmatched``...
    text
        One or two sentences: the finding, its place, and the action.
    frames, labels, lengths, measurements, files
        Names of its subjects.
    heights_m, heights_sigma_m
        Heights above the ground that it reports, one for each of `labels`; else empty.
    several
        Parts for one sentence with others of the same code and opening; None: always written alone.
        Not stored.
    plain
        Finding in one sentence, where code and subjects do not describe it completely.
    mentions
        Names in the text that are no subjects, as of another cause that explains as much. Not
        stored.
    equals
        Other causes that are just as likely, as sentences; stored with the verdict.
    mend, instead
        Proposed correction, and alternatives where the observations cannot decide; stored with the
        verdict.
    """

    level: Level
    code: str
    text: str
    frames: Annotated[tuple[str, ...], OPTIONAL] = ()
    labels: Annotated[tuple[str, ...], OPTIONAL] = ()
    lengths: Annotated[tuple[str, ...], OPTIONAL] = ()
    measurements: Annotated[tuple[str, ...], OPTIONAL] = ()
    files: Annotated[tuple[str, ...], OPTIONAL] = ()
    heights_m: Annotated[tuple[float, ...], OPTIONAL] = ()
    heights_sigma_m: Annotated[tuple[float, ...], OPTIONAL] = ()
    several: Annotated[MessagePlural | None, OPTIONAL] = field(
        default=None, compare=False, repr=False
    )
    plain: Annotated[str, OPTIONAL] = field(default="", compare=False, repr=False)
    mentions: Annotated[tuple[str, ...], OPTIONAL] = field(default=(), compare=False, repr=False)
    equals: Annotated[tuple[str, ...], OPTIONAL] = field(default=(), compare=False, repr=False)
    mend: Annotated[Remedy | None, OPTIONAL] = field(default=None, compare=False, repr=False)
    instead: Annotated[tuple[Remedy, ...], OPTIONAL] = field(default=(), compare=False, repr=False)

    def names(self) -> tuple[str, ...]:
        """Return all names that the text may contain; those of photos with and without ending."""
        subjects = (name for what in SUBJECTS for name in getattr(self, what))
        return (*subjects, *map(photo_name, self.frames), *self.mentions)

    def split_text(self, separator: str = r"\. ") -> list[str]:
        """Split the text where a pattern matches, but not inside a name; by default in sentences.

        A label or a photo may be called ``St. 1``.
        """
        kept = sorted(filter(re.compile(separator).search, self.names()), key=len, reverse=True)
        pattern = "|".join((*map(re.escape, kept), f"(?P<end>{separator})"))
        parts, begin = [], 0
        for found in re.finditer(pattern, self.text):
            if found["end"]:
                parts.append(self.text[begin : found.start()])
                begin = found.end()
        return [*parts, self.text[begin:]]

    def record(self) -> dict[str, str | list[str] | list[float]]:
        """Return all that is stored: level, code, text, and the subjects and numbers in use."""
        more = {what: getattr(self, what) for what in (*SUBJECTS, *NUMBERS)}
        told = {what: list(values) for what, values in more.items() if values}
        return {"level": self.level, "code": self.code, "text": self.text, **told}

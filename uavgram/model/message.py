"""What the program has to say beside the numbers: never a silent guess."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from uavgram.model.remedy import Remedy

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

"""What the program has to say beside the numbers: never a silent guess."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Level = Literal["info", "warning", "error"]

SUBJECTS = ("frames", "labels", "lengths", "measurements", "files")
"""Kinds of things that a message may speak of, each a field of `Message`."""


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
    values
        Numbers of the text by name, with units in the names; empty where nothing reads them.
    several
        How it is told together with others of its code and opening; None: always alone. No part of
        what is stored.
    """

    level: Level
    code: str
    text: str
    frames: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    lengths: tuple[str, ...] = ()
    measurements: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    values: Mapping[str, float] = field(default_factory=dict, hash=False)
    several: Several | None = field(default=None, compare=False, repr=False)

    def record(self) -> dict[str, str | list[str] | dict[str, float]]:
        """Everything that is stored: level, code, text, the subjects and values that it has."""
        subjects = {what: list(getattr(self, what)) for what in SUBJECTS if getattr(self, what)}
        values = {"values": dict(self.values)} if self.values else {}
        return {"level": self.level, "code": self.code, "text": self.text, **subjects, **values}

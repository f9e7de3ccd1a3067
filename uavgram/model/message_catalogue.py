"""Catalogue of all messages: meaning, order and effect on the verdict of each code.

The texts are in message_catalogue.ini, by subject, with the keys of `Entry`.
"""

from __future__ import annotations

from configparser import RawConfigParser
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from functools import cache
from importlib.resources import files
from typing import get_args

from uavgram.model.message import Level

CAMERA = "The camera"
"""Subject of the messages on the camera of a survey."""


class Order(IntEnum):
    """Position of a message among those of its level: causes first, their consequences last."""

    CAUSE_OF_ALL = auto()
    """Cause that explains misfits of the whole survey; before errors."""
    CAUSE_OF_ONE = auto()
    """Cause that explains the misfit of one photo, label or length; before errors."""
    POSSIBLE_CAUSE = auto()
    LOG_FAULT = auto()
    LOG_GAP = auto()
    LEFT_OUT = auto()
    DUPLICATE = auto()
    REMOVED = auto()
    SUSPECT = auto()
    CONTRADICTION = auto()
    MISFIT = auto()
    NOISE = auto()
    AMBIGUITY = auto()
    UNCHECKED = auto()
    OTHER = auto()
    EXCLUDED = auto()
    """Photos and picks that are not used, for a reason given by another message."""
    GROUP = auto()
    """Totals of findings that other messages list one by one."""
    APPROXIMATION = auto()

    @property
    def is_found_cause(self) -> bool:
        """Return whether a warning of this kind explains errors, and comes before them."""
        return self <= Order.CAUSE_OF_ONE


class Effect(Enum):
    """Effect of a warning or error on the verdict; its value is the text for people."""

    NONE = ""
    AMBER = "At best amber: something does not fit."
    DOUBTFUL = "At best amber. Measurements at the points that the message names are doubtful."
    DISPLACED = (
        "At best amber. Measurements at the points that the message names are doubtful, and, if it "
        "names several photos, all coordinates."
    )
    ALL_DOUBTFUL = "At best amber. All measurements are doubtful."
    UNCHECKED = "Amber, if a measurement depends on it."
    RED = "Red: do not use the numbers."


@dataclass(frozen=True)
class Entry:
    """Fixed properties of the messages of one code.

    Attributes
    ----------
    code
        Code of the message, kebab-case; never renamed.
    subject
        Title of its section.
    levels
        Possible levels. A message that a cause explains may also be ``info``.
    finding
        The finding.
    consequence
        Consequence for the numbers, beside the effect on the verdict; empty where there is none.
    action
        Action for the reader; empty where none is needed.
    effect
        Effect on the verdict.
    order
        Position in the list of messages.
    one, several
        The reason of a verdict in one sentence, for one object and for several (empty: the same
        sentence), with ``{labels}``, ``{frames}``, ``{lengths}``, ``{measurements}`` and
        ``{count}``. Without it, the reason is the beginning of the message's own text.
    labels_of_one
        Number of labels in a message about one object.
    accuses
        Whether it declares an observation suspect. It becomes a note where a cause explains the
        misfit.
    is_of_log
        Whether it is a contradiction between the log and the rest. Without the log, it bends
        nothing.
    part_of
        Code of a message that contains this one as a reason of the verdict.
    is_detail
        Whether the terminal shows it only with ``--verbose``.
    """

    code: str
    subject: str
    levels: tuple[Level, ...]
    finding: str
    consequence: str = ""
    action: str = ""
    effect: Effect = Effect.NONE
    order: Order = Order.OTHER
    one: str = ""
    several: str = ""
    labels_of_one: int = 1
    accuses: bool = False
    is_of_log: bool = False
    part_of: str = ""
    is_detail: bool = False


@dataclass(frozen=True)
class Subject:
    """Entries of one subject.

    Attributes
    ----------
    title
        Title of its section.
    entries
        In the order of the section.
    introduction
        Text before the entries; may be empty.
    """

    title: str
    entries: tuple[Entry, ...]
    introduction: str = ""


LEVELS: dict[str, Level] = {level: level for level in get_args(Level)}


@cache
def list_subjects() -> tuple[Subject, ...]:
    """Read the catalogue, in the order of its file."""
    text = files(__package__).joinpath("message_catalogue.ini").read_text(encoding="utf-8")
    file = RawConfigParser(delimiters=("=",), comment_prefixes=("#",))
    file.read_string(text)
    introductions: dict[str, str] = {}
    entries: dict[str, list[Entry]] = {}
    for name in file.sections():
        fields = {key: value.replace("\n", " ") for key, value in file.items(name)}
        title = name.removeprefix("subject: ")
        if title != name:
            introductions[title], entries[title] = fields.get("introduction", ""), []
            continue
        subject = list(entries)[-1]
        levels = tuple(LEVELS[level] for level in fields.pop("levels").split(", "))
        entries[subject].append(
            Entry(
                name,
                subject,
                levels,
                effect=Effect[_constant(fields.pop("effect", "none"))],
                order=Order[_constant(fields.pop("order", "other"))],
                labels_of_one=int(fields.pop("labels_of_one", "1")),
                accuses=fields.pop("accuses", "") == "yes",
                is_of_log=fields.pop("is_of_log", "") == "yes",
                is_detail=fields.pop("is_detail", "") == "yes",
                **fields,
            )
        )
    return tuple(Subject(title, tuple(entries[title]), introductions[title]) for title in entries)


def _constant(word: str) -> str:
    return word.upper().replace("-", "_")


@cache
def entries_by_code() -> dict[str, Entry]:
    """Return the entry of each code, in the order of the catalogue."""
    return {entry.code: entry for subject in list_subjects() for entry in subject.entries}


def entry_of(code: str) -> Entry:
    """Return the entry of a code; an empty one for an unknown code (from another version)."""
    return entries_by_code().get(code) or Entry(code, "", tuple(LEVELS.values()), finding="")

"""Provenance of a result: program, inputs and options, and the case that it is about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class InputDigest:
    """Chain of custody of one input file."""

    path: str
    sha256: str
    size_bytes: int


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """What made this result: program, inputs, options.

    Attributes
    ----------
    made_by
        Who answers for it; empty where the project names nobody.
    options
        The project as understood, as JSON-ready pairs of dotted key and value.
    packages
        Pairs of package name and version.
    """

    program: str
    version: str
    created_utc: str
    made_by: str = ""
    inputs: tuple[InputDigest, ...]
    options: tuple[tuple[str, object], ...]
    seed: int | None
    packages: tuple[tuple[str, str], ...]


WORDS = {
    "number": "Case number",
    "title": "Case",
    "place": "Place",
    "date": "Date",
    "agency": "Agency",
    "client": "For",
}
"""What each field is called; others are called as they are written."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """The head of a report; a field that is empty is not shown.

    Attributes
    ----------
    number, title, place, date, agency, client
        As people write them.
    more
        Whatever else is to be said, by its name.
    """

    number: str = ""
    title: str = ""
    place: str = ""
    date: str = ""
    agency: str = ""
    client: str = ""
    more: Mapping[str, str] = field(default_factory=dict)


def case_from_options(options: tuple[tuple[str, object], ...]) -> tuple[tuple[str, str], ...]:
    """Names and texts of a case as the options of a result have them; none where nothing is said.

    Parameters
    ----------
    options
        Pairs of dotted key and value.
    """
    named = dict(options)
    rows = [(word, named.get(f"case.{key}")) for key, word in WORDS.items()]
    rows += [
        (key.removeprefix("case.more."), v) for key, v in options if key.startswith("case.more.")
    ]
    return tuple((word, text) for word, text in rows if isinstance(text, str) and text)

"""Provenance of a result: program, inputs and options, and the case that it belongs to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class InputDigest:
    """Digest of one input file, for the chain of custody."""

    path: str
    sha256: str
    size_bytes: int


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Origin of a result: program, inputs, options.

    Attributes
    ----------
    made_by
        Person responsible; empty where the project names none.
    options
        The project as read, as JSON-ready pairs of dotted key and value.
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


CASE_LABELS = {
    "number": "Case number",
    "title": "Case",
    "place": "Place",
    "date": "Date",
    "agency": "Agency",
    "client": "For",
}
"""Displayed name of each field of a case; further fields are shown under their own names."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """Head of a report; empty fields are not shown.

    Attributes
    ----------
    number, title, place, date, agency, client
        Texts as the user wrote them.
    more
        Further texts by their names.
    """

    number: str = ""
    title: str = ""
    place: str = ""
    date: str = ""
    agency: str = ""
    client: str = ""
    more: Mapping[str, str] = field(default_factory=dict)


def case_from_options(options: tuple[tuple[str, object], ...]) -> tuple[tuple[str, str], ...]:
    """Return names and texts of the case in the options of a result; empty without any.

    Parameters
    ----------
    options
        Pairs of dotted key and value.
    """
    named = dict(options)
    rows = [(word, named.get(f"case.{key}")) for key, word in CASE_LABELS.items()]
    rows += [
        (key.removeprefix("case.more."), v) for key, v in options if key.startswith("case.more.")
    ]
    return tuple((word, text) for word, text in rows if isinstance(text, str) and text)

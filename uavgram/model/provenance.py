"""What made a result: program, inputs and options, for the chain of custody."""

from __future__ import annotations

from dataclasses import dataclass


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

"""Versions of the software behind a result."""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from typing import TypedDict


@cache
def package_versions(names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return versions of Python and of these packages, as pairs of name and version."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    return ("python", python), *((name, importlib.metadata.version(name)) for name in names)


class Stamp(TypedDict):
    """Program and time (ISO 8601) of an output, as in every provenance."""

    program: str
    version: str
    created_utc: str


def stamp() -> Stamp:
    """Return the stamp of this program, now."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return Stamp(program="uavgram", version=importlib.metadata.version("uavgram"), created_utc=now)

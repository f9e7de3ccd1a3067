"""Versions of what a result was computed with."""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Sequence
from functools import cache


@cache
def package_versions(names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Versions of Python and of these packages, as pairs of name and version."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    return ("python", python), *((name, importlib.metadata.version(name)) for name in names)

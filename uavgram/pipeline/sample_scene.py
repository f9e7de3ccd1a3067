"""What tells a sample survey from others, and what its scene has; quick to load."""

from __future__ import annotations

from pathlib import Path

from uavgram.model.scenario.scenario import Scenario

MARK = "# The sample survey of `uavgram pick --sample`:"
"""How its project file begins; a person may change all that follows."""

TAPED = "taped.txt"
"""File with the readings of the tape, beside the project file."""

PAINTED = tuple(point.label for point in Scenario().points)
"""Labels that are painted on its ground."""


def is_sample(project: Path) -> bool:
    """Whether a project file is that of a sample."""
    try:
        with project.open(encoding="utf-8") as stream:
            return stream.readline().startswith(MARK)
    except (OSError, UnicodeDecodeError):
        return False

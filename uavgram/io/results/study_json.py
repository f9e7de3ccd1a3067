"""Writer of study.json: every number of studies, cell by cell."""

from __future__ import annotations

import json
import math
from pathlib import Path

from uavgram.io.results.codec import Json, encode
from uavgram.model.simulation import SOURCES, Study

SCHEMA = 1


def write_studies(studies: tuple[Study, ...], path: Path) -> None:
    """Write study.json: metres, seconds and shares; null for missing values.

    Parameters
    ----------
    studies
        Studies to write.
    path
        Output file.
    """
    record = {"schema": SCHEMA, "sources": list(SOURCES), "studies": _finite(encode(studies))}
    path.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _finite(value: Json) -> Json:
    """Replace infinite numbers, of undetermined methods, which JSON cannot hold."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list):
        return [_finite(item) for item in value]
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return value

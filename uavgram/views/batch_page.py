"""batch.html: one self-contained page on many surveys."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from uavgram.model.batch import Batch, Drift, PooledRatio, SurveyRow
from uavgram.views.batch_map import batch_map
from uavgram.views.batch_words import KINDS, drift_words, headline, pooled_words, display_name
from uavgram.views.pages import page
from uavgram.views.formatting import number

REPORT = "report.html"
_ORDER = {"failed": 0, "waiting": 3}
_LEVELS = {"red": 1, "amber": 2, "green": 4}


class Line(NamedTuple):
    """Row of a survey on the page; `why` is its problem or the first reason of its verdict."""

    row: SurveyRow
    name: str
    link: str
    sigma: str
    w: str
    looks: str
    why: str


class Judged(NamedTuple):
    """Row of pooled statistics, or of a camera's drift, with its interpretation."""

    found: PooledRatio | Drift
    words: str
    is_bad: bool


def render_batch_page(batch: Batch, folder: Path) -> str:
    """Render the page as text; it loads nothing from elsewhere."""
    links = {row.project: _link(row, folder) for row in batch.rows if row.output}
    return page(
        "batch.html",
        batch=batch,
        kinds=KINDS,
        verdict=headline(batch),
        map=batch_map(batch, links),
        lines=[_line(row, links) for row in sorted(batch.rows, key=_worst_first)],
        pooled=[Judged(one, pooled_words(one), one.is_small) for one in batch.pooled],
        drifts=[Judged(one, drift_words(one), one.is_off or one.drifts) for one in batch.drifts],
    )


def _line(row: SurveyRow, links: dict[str, str]) -> Line:
    return Line(
        row=row,
        name=display_name(row),
        link=links.get(row.project, ""),
        sigma=number(row.mean_sigma_m),
        w=number(row.worst_w, 1, signed=True),
        looks=row.level or "none",
        why=row.message or row.sentence.partition(". ")[2],
    )


def _worst_first(row: SurveyRow) -> tuple[int, float]:
    rank = _ORDER.get(row.status, _LEVELS.get(row.level or "", 3))
    return rank, -abs(row.worst_w) if math.isfinite(row.worst_w) else 0.0


def _link(row: SurveyRow, folder: Path) -> str:
    """Return the address of a survey's report: relative if both are on one disk."""
    report = Path(row.output) / REPORT
    try:
        return quote(Path(os.path.relpath(report, folder.absolute())).as_posix())
    except ValueError:  # another drive
        return report.as_uri()

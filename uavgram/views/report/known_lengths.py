"""The known lengths and how well they fit."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.report.rows import Row, gauge
from uavgram.views.survey.reliability import SUSPECT_W, effect_words
from uavgram.views.wording import LINE_STATUS_WORDS, number


def length_rows(result: Result) -> list[Row]:
    """Worst fit first; those that were withheld and judged stand among the checks."""
    lines = result.lines
    order = np.argsort(-np.nan_to_num(np.abs(lines.w), nan=-1.0), kind="stable")
    return [_row(result, int(i)) for i in order if lines.status[i] != "checked"]


def _row(result: Result, i: int) -> Row:
    lines, evidence = result.lines, result.evidence
    return Row(
        name=lines.name[i],
        ends=f"{lines.start[i]} – {lines.end[i]}",
        taped=f"{number(lines.length_m[i])} ± {number(lines.sigma_m[i])}",
        found=found_text(result, i),
        difference=number(lines.residual_m[i], signed=True),
        w=number(lines.w[i], 1, signed=True),
        gauge=gauge(float(lines.w[i]), SUSPECT_W),
        redundancy=number(lines.redundancy[i], 2),
        mdb=number(lines.mdb_m[i]),
        effect="–" if evidence is None else effect_words(result, evidence.lines, i),
        status=LINE_STATUS_WORDS.get(lines.status[i], lines.status[i]),
        bad=lines.status[i] in ("suspect", "removed"),
    )


def found_text(result: Result, i: int) -> str:
    """``11.076 ± 0.008``: a known length as the result has it, or an en dash."""
    lines = result.lines
    if not np.isfinite(lines.adjusted_m[i]):
        return "–"
    return f"{number(lines.adjusted_m[i])} ± {number(lines.adjusted_sigma_m[i])}"

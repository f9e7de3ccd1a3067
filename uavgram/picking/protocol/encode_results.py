"""Results of a run as the page shows them: the words of the report's first page."""

from __future__ import annotations

from uavgram.model.provenance import case_from_options
from uavgram.model.result.result import Result
from uavgram.picking.protocol import messages as m
from uavgram.views.formatting import measurement_text, order_shapes_first
from uavgram.views.survey.verdict import (
    reason_sentence,
    status_text,
    summarise_result,
    verdict_words,
)
from uavgram.views.units import convert_sentence, exact_lengths, list_names_like_lengths, units_of


def results_json(result: Result) -> m.Results:
    """Return verdict, measurements and case of a result, in the units of its project."""
    words, units = verdict_words(result), units_of(result)
    keep, exact = list_names_like_lengths(result), exact_lengths(result)

    def in_project_units(text: str) -> str:
        return convert_sentence(text, units, keep, exact)

    rows = result.measurements
    return {
        "level": words.level,
        "headline": in_project_units(summarise_result(result)),
        "first": in_project_units(reason_sentence(words.reasons[0])) if words.reasons else "",
        "others": [in_project_units(reason.text) for reason in words.reasons[1:]],
        "scale": in_project_units(words.scale),
        "counts": words.counts,
        "case": list(case_from_options(result.provenance.options)),
        "made": result.provenance.created_utc,
        "measurements": [
            {
                "name": text.name,
                "kind": text.kind,
                "points": list(text.points),
                "value": text.value,
                "others": text.others,
                "interval": text.interval,
                "status": rows.status[k],
                "words": status_text(rows, k),
            }
            for k in map(int, order_shapes_first(rows))
            for text in [measurement_text(rows, k, units)]
        ],
    }


def extract_plan(report: bytes) -> bytes | None:
    """Extract the plan on a report's first page as a separate drawing; None if there is none."""
    begin = report.find(b'<svg class="drawing"')
    end = report.find(b"</svg>", begin)
    if begin < 0 or end < 0:
        return None
    name = b'<svg xmlns="http://www.w3.org/2000/svg"'
    return name + report[begin + len(b"<svg") : end] + b"</svg>"

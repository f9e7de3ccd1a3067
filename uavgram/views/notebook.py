"""Display of a result in a notebook: the verdict first, then the measurements.

The result itself does not know this module: IPython is given the function that shows it.
"""

from __future__ import annotations

import sys
from html import escape

from uavgram.model.result.result import Result
from uavgram.views.formatting import measurement_text, order_worst_first
from uavgram.views.style import LEVEL_COLOURS, hex_colour
from uavgram.views.survey.verdict import status_text, verdict_words
from uavgram.views.units import convert_sentence, list_names_like_lengths, units_of

COLUMNS = ("measurement", "what", "points", "value ± sigma", "95 % interval", "status")


def register_display() -> None:
    """Register the display of a result with the running IPython, if there is one."""
    module = sys.modules.get("IPython")
    shell = module.get_ipython() if module is not None else None
    if shell is not None:
        html = shell.display_formatter.formatters["text/html"]
        html.for_type_by_name("uavgram.model.result.result", "Result", result_html)


def result_html(result: Result) -> str:
    """Render verdict with reasons, measurements, and the data used, as a piece of HTML."""
    words, units, keep = verdict_words(result), units_of(result), list_names_like_lengths(result)

    def converted(text: str) -> str:
        return escape(convert_sentence(text, units, keep))

    mark = f"border-left:6px solid {hex_colour(LEVEL_COLOURS[words.level])};padding-left:.6em"
    reasons = "".join(f"<li>{converted(one.text)}</li>" for one in words.reasons[1:])
    more = f"<details><summary>{len(words.reasons) - 1} more</summary><ul>{reasons}</ul></details>"
    parts = [
        f"<div><h4>{escape(result.name)}</h4>",
        f'<p style="{mark}"><b>{converted(words.sentence)}</b></p>',
        more if reasons else "",
        _table(result),
        f"<p>{converted(words.counts)} {converted(words.scale)}</p></div>",
    ]
    return "\n".join(filter(None, parts))


def _table(result: Result) -> str:
    rows, units = result.measurements, units_of(result)
    if not rows.name:
        return "<p>Nothing was measured: no measurements were requested.</p>"
    head = "".join(f"<th>{escape(column)}</th>" for column in COLUMNS)
    body = []
    for i in order_worst_first(rows):
        row = measurement_text(rows, int(i), units)
        status = status_text(rows, int(i))
        value = f"{row.value} {row.others}".strip()
        cells = (row.name, row.kind, " ".join(row.points), value, row.interval, status)
        body.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(body)}</tbody></table>"

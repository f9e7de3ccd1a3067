"""Display of a result in a notebook: the verdict first, then the measurements.

The result itself does not know this module: IPython is given the function that shows it.
"""

from __future__ import annotations

import sys
from html import escape

from uavgram.model.result.result import Result
from uavgram.views.formatting import order_worst_first
from uavgram.views.style import LEVEL_COLOURS, hex_colour
from uavgram.views.survey.verdict import verdict_words
from uavgram.views.units import convert_sentence, list_names_like_lengths, units_of


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
    """Return the measurements as in the terminal."""
    from uavgram.views.result_tables import result_table  # noqa: PLC0415 - heavy

    if not result.measurements.name:
        return "<p>Nothing was measured: no measurements were requested.</p>"
    shown = result_table(
        "measured", result, order_worst_first(result.measurements).tolist(), "terminal"
    )
    head = "".join(f"<th>{escape(title)}</th>" for title in shown.titles)
    rows = ("".join(f"<td>{escape(cell.text)}</td>" for cell in row) for row in shown.rows)
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

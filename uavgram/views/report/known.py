"""Known observations other than lengths and their fit: rows of a table, in words."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.units import spread_text, units_of, value_text
from uavgram.views.formatting import (
    KNOWN_STATUS_WORDS,
    KNOWN_WORDS,
    number,
    with_sigma,
    worst_fit_first,
)


class KnownRow(NamedTuple):
    """Known observation: its kind, and numbers as they are shown."""

    name: str
    what: str
    points: tuple[str, ...]
    given: str
    found: str
    difference: str
    w: str
    redundancy: str
    least: str
    status: str
    is_bad: bool


def known_table(result: Result) -> tuple[KnownRow, ...]:
    """Return the rows of all known observations, the worst fit first."""
    return tuple(_row(result, int(i)) for i in worst_fit_first(result.known.w))


def _row(result: Result, i: int) -> KnownRow:
    known, units = result.known, units_of(result)
    unit, sigma = known.unit[i], float(known.sigma[i])
    is_condition = bool(np.isnan(known.value[i]))
    found = value_text(float(known.adjusted[i]), sigma, unit, units)
    if known.adjusted_sigma[i] > 0 and not is_condition:
        found = with_sigma(float(known.adjusted[i]), float(known.adjusted_sigma[i]), unit, units)
    return KnownRow(
        name=known.name[i],
        what=KNOWN_WORDS.get(known.kind[i], known.kind[i]),
        points=known.points[i],
        given=f"± {spread_text(sigma, unit, units)}"
        if is_condition
        else with_sigma(float(known.value[i]), sigma, unit, units),
        found="–" if is_condition else found,
        difference="–"
        if np.isnan(known.residual[i])
        else ("+" if known.residual[i] > 0 else "")
        + value_text(float(known.residual[i]), sigma, unit, units),
        w=number(float(known.w[i]), 1, signed=True),
        redundancy=number(float(known.redundancy[i]), 2),
        least="–"
        if np.isnan(known.mdb[i])
        else value_text(float(known.mdb[i]), sigma, unit, units),
        status=KNOWN_STATUS_WORDS[known.status[i]],
        is_bad=known.status[i] in ("suspect", "removed"),
    )

"""Main facts of a result, as pairs of question and answer."""

from __future__ import annotations

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.survey.frame_states import frame_counts
from uavgram.views.units import units_of
from uavgram.views.formatting import (
    SIGNED_KINDS,
    alternatives_text,
    axes_text,
    number,
    relative,
    size_text,
    with_sigma,
    worst_first,
)

Fact = tuple[str, str]


def key_facts(result: Result) -> tuple[Fact, ...]:
    """List photos, least certain length, known length of worst fit, and least certain point."""
    facts = [
        ("photos", frame_counts(result)),
        ("least certain length for its size", _least_certain(result)),
        ("known length that fits worst", _worst_fit(result)),
        _least_known_point(result),
    ]
    return tuple((question, answer) for question, answer in facts if answer)


def least_certain_length(result: Result) -> int | None:
    """Return the row of the measured length with the largest relative sigma."""
    rows = result.measurements
    for i in worst_first(rows):
        is_length = rows.unit[i] == "m" and rows.kind[i] not in SIGNED_KINDS
        if is_length and np.isfinite(rows.value[i]):
            return int(i)
    return None


def largest_ellipse(result: Result) -> int | None:
    """Return the row of the least certain point within the survey; None if there is no shape."""
    major = result.points.relative.ellipse_95_m[:, 0]
    return int(np.argmax(major)) if major.any() else None


def _least_certain(result: Result) -> str:
    row, rows = least_certain_length(result), result.measurements
    if row is None:
        return ""
    value, sigma, unit = float(rows.value[row]), float(rows.sigma[row]), rows.unit[row]
    units = units_of(result)
    why = alternatives_text(rows, row, units) or f"({relative(value, sigma, unit)})"
    return f"{rows.name[row]}: {with_sigma(value, sigma, unit, units)} {why}"


def _worst_fit(result: Result) -> str:
    lines = result.lines
    removed = np.array([status == "removed" for status in lines.status], dtype=np.bool_)
    # a length that was removed early has no test statistic, and may be off by metres
    alone = lines.residual_m / np.hypot(lines.sigma_m, np.nan_to_num(lines.adjusted_sigma_m))
    w = np.nan_to_num(np.abs(np.where(removed & np.isnan(lines.w), alone, lines.w)), nan=-1.0)
    if not len(w) or w.max() < 0:
        return ""
    row = int(np.argmax(w))
    return (
        f"{lines.name[row]}, {lines.start[row]} to {lines.end[row]}: "
        f"{number(float(lines.residual_m[row]), signed=True)} m off "
        f"({number(float(w[row]), 1)} sigma{', removed' if removed[row] else ''})"
    )


def _least_known_point(result: Result) -> Fact:
    points = result.points
    if np.isfinite(points.neighbour_sigma_m).any():
        row = int(np.nanargmax(points.neighbour_sigma_m))
        sigma, around = size_text(float(points.neighbour_sigma_m[row])), points.neighbours[row]
        told = f"{points.label[row]}: ± {sigma} ({', '.join(around)})"
        return "point least known against its neighbours", told
    widest = largest_ellipse(result)  # a single point has no neighbours
    axes = "" if widest is None else axes_text(points.relative.ellipse_95_m[widest])
    told = f"{points.label[widest]}: {axes}" if widest is not None else ""
    return "largest 95 % ellipse within the survey (half axes)", told

"""A made-up result to which other solutions give other values."""

from __future__ import annotations

from dataclasses import replace

from uavgram.model.result.result import Result


def unsure(result: Result, name: str, values: tuple[float, ...]) -> Result:
    """The result, where another solution gives other values to one measurement."""
    rows = result.measurements
    others = tuple(values if one == name else () for one in rows.name)
    return replace(result, measurements=replace(rows, alternative_values=others))

"""Map of a batch: each survey at its place, in the colour of its verdict."""

from __future__ import annotations

import math
from typing import NamedTuple

from uavgram.geometry.earth.geodesy import EARTH_RADIUS_M
from uavgram.model.batch import Batch
from uavgram.views.batch_words import display_name

WIDTH, HIGHEST, MARGIN = 1000.0, 620.0, 46.0
_LEAST_SPAN_DEG = 0.002
"""Least span of the map, about 200 m, so that a batch at one place has an area."""
_STEPS = (1.0, 2.0, 5.0)


class Place(NamedTuple):
    """Survey on the map: place in the drawing, class of its colour, text, link to its report."""

    x: float
    y: float
    looks: str
    text: str
    link: str


class BatchMap(NamedTuple):
    """Drawing: height, grid lines with their texts, scale bar in kilometres or metres, places."""

    height: float
    meridians: list[tuple[float, str]]
    parallels: list[tuple[float, str]]
    bar: float
    bar_text: str
    places: list[Place]


def batch_map(batch: Batch, links: dict[str, str]) -> BatchMap | None:
    """Lay out the surveys in an equirectangular map that is true to scale in its middle.

    Parameters
    ----------
    batch
        The surveys.
    links
        Address of each project's report, by project; surveys without one have no link.

    Returns
    -------
    BatchMap
        None if no survey has a place on the earth.
    """
    rows = [row for row in batch.rows if math.isfinite(row.latitude_deg + row.longitude_deg)]
    if not rows:
        return None
    south, north = _widened([row.latitude_deg for row in rows])
    west, east = _widened([row.longitude_deg for row in rows])
    # equirectangular: degrees of longitude shrink with the cosine of the latitude
    squeeze = max(math.cos(math.radians((south + north) / 2.0)), 0.05)
    room = WIDTH - 2.0 * MARGIN
    scale = min(room / ((east - west) * squeeze), (HIGHEST - 2.0 * MARGIN) / (north - south))
    left = MARGIN + (room - scale * (east - west) * squeeze) / 2.0
    height = scale * (north - south) + 2.0 * MARGIN

    def x(longitude: float) -> float:
        return left + scale * squeeze * (longitude - west)

    def y(latitude: float) -> float:
        return MARGIN + scale * (north - latitude)

    metres = math.radians(1.0) * EARTH_RADIUS_M / scale  # metres per unit of the drawing
    long = _round_down(metres * WIDTH / 4.0)
    places = [
        Place(
            x(row.longitude_deg),
            y(row.latitude_deg),
            row.level or "none",
            f"{display_name(row)}: {row.sentence}",
            links.get(row.project, ""),
        )
        for row in rows
    ]
    return BatchMap(
        height=height,
        meridians=[(x(at), text) for at, text in _ticks(west, east, "E", "W")],
        parallels=[(y(at), text) for at, text in _ticks(south, north, "N", "S")],
        bar=long / metres,
        bar_text=f"{long / 1000.0:g} km" if long >= 1000.0 else f"{long:g} m",
        places=places,
    )


def _widened(values: list[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    more = max(0.06 * (high - low), (_LEAST_SPAN_DEG - (high - low)) / 2.0)
    return low - more, high + more


def _round_down(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(step * power for step in _STEPS if step * power <= value)


def _ticks(low: float, high: float, above: str, below: str) -> list[tuple[float, str]]:
    """Return the round degrees within a range, with their texts."""
    step = _round_down((high - low) / 2.0)
    digits = max(0, -math.floor(math.log10(step)))
    first, last = math.ceil(low / step), math.floor(high / step)
    return [(k * step, _degrees(k * step, digits, above, below)) for k in range(first, last + 1)]


def _degrees(value: float, digits: int, above: str, below: str) -> str:
    return f"{abs(value):.{digits}f}° {above if value >= 0 else below}"

"""Map of the accuracy in steps of grey, for black and white printers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.planned_layers import grid_cells
from uavgram.views.field_sheet.paper import Paper
from uavgram.views.planned.numbers import centimetres
from uavgram.views.survey.texts import svg_points

LIGHTEST, DARKEST = 1.0, 0.66
"""Range of grey as a share of white: names on the darkest can still be read."""

_LEAST_STEP_M = 1e-3
_STEPS = 4


@dataclass(frozen=True)
class Shade:
    """Shade of grey, and the range of accuracies that it represents."""

    colour: str
    words: str


@dataclass(frozen=True)
class Shading:
    """Map: SVG points of each cell with its grey, cells that cannot be measured in, legend."""

    cells: tuple[tuple[str, str], ...]
    unseen: tuple[str, ...]
    legend: tuple[Shade, ...]


def shading(planned: FlightPlanned, paper: Paper) -> Shading:
    """Shade the cells: the lighter, the better."""
    grid = planned.grid
    corners = [svg_points(paper(ring)) for ring in grid_cells(planned)]
    known = np.isfinite(grid.sigma_m)
    unseen = tuple(ring for ring, is_known in zip(corners, known, strict=True) if not is_known)
    if not known.any():
        return Shading((), unseen, ())
    edges = class_edges(grid.sigma_m[known])
    count = len(edges) - 1
    greys = [_grey(k / max(count - 1, 1)) for k in range(count)]
    which = np.clip(np.searchsorted(edges, grid.sigma_m, side="right") - 1, 0, count - 1)
    cells = tuple(
        (ring, greys[k]) for ring, k, seen in zip(corners, which, known, strict=True) if seen
    )
    legend = tuple(
        Shade(grey, centimetres(float(low), float(high)))
        for grey, low, high in zip(greys, edges, edges[1:], strict=False)
    )
    return Shading(cells, unseen, legend)


def class_edges(sigma_m: Floats) -> Floats:
    """Choose (c + 1,) round class limits in equal steps that enclose some (n,) accuracies."""
    low, high = float(sigma_m.min()), float(sigma_m.max())
    least = max((high - low) / _STEPS, _LEAST_STEP_M)
    # smallest step of the 1-2-5 series that is not below the least step
    power = 10.0 ** np.floor(np.log10(least))
    step = power * min(f for f in (1, 2, 5, 10) if f * power >= least * (1 - 1e-9))
    first = np.floor(low / step + 1e-9)
    last = max(np.ceil(high / step - 1e-9), first + 1)
    return np.asarray(step * np.arange(first, last + 1))


def _grey(share: float) -> str:
    level = round(255 * (LIGHTEST + (DARKEST - LIGHTEST) * share))
    return f"#{level:02x}{level:02x}{level:02x}"

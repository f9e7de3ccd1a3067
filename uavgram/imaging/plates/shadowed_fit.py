"""Plates under the edges of shadows: an edge is sought where a plate does not fit without."""

from __future__ import annotations

import numpy as np

from uavgram.imaging.plates.fit import FIRST_BLUR_PX, PlateFit, PlateModel, fit_plate, plate_weights
from uavgram.imaging.plates.picture import Window, render
from uavgram.imaging.plates.shadow import edge_pictures, likeliest_edges
from uavgram.model.arrays import Bools, Floats

_RUNS_ON = 0.35
"""Residuals that go together more than this show something that lies across the plate."""

_BETTER = 0.8
"""A shadow's edge must make the residuals this much smaller."""

MOST_EDGES = 2


def fit_with_shadows(
    grey: Floats, window: Window, cells: Bools, corner_px: Floats, margin: float = 1.0
) -> PlateFit | None:
    """Fit a plate, and the edges of shadows across it where it does not fit without.

    Parameters
    ----------
    grey, window, cells, corner_px, margin
        As of `fit_plate`.
    """
    fitted = fit_plate(grey, window, cells, corner_px, margin=margin)
    if fitted is None:
        return None
    for _ in range(MOST_EDGES):
        if fitted.runs_on < _RUNS_ON:
            break
        shadowed = _with_edge(grey, window, cells, fitted, corner_px, margin)
        if shadowed is None or shadowed.rms > _BETTER * fitted.rms:
            break
        fitted = shadowed
    return fitted


def _with_edge(
    grey: Floats, window: Window, cells: Bools, fitted: PlateFit, corner_px: Floats, margin: float
) -> PlateFit | None:
    """The best fit with one more edge."""
    picture = render(cells, fitted.corner_px, fitted.blur_px, window)
    weight = plate_weights(window, fitted.corner_px, len(cells), margin, fitted.blur_px)
    model = PlateModel(grey, window, cells, weight, corner_px.mean(axis=0))
    values = np.concatenate([np.zeros(0), *(edge.values for edge in fitted.edges)])
    shade = edge_pictures(values, window)[0]
    base = np.stack(model.columns(picture, shade), axis=-1)
    starts = likeliest_edges(grey, base, picture.share, weight)
    fits = [
        fit_plate(
            grey,
            window,
            cells,
            corner_px,
            edges=(*fitted.edges, start),
            blur_px=FIRST_BLUR_PX,
            margin=margin,
        )
        for start in starts
    ]
    good = [one for one in fits if one is not None]
    return min(good, key=lambda one: one.rms) if good else None

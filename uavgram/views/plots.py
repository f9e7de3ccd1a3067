"""Plots of a result: residuals, the plan from above, and the error budget.

Each draws into the given axes, or into a figure of its own, and returns the axes.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.formatting import order_worst_first
from uavgram.views.style import INK
from uavgram.views.survey.sheet import WIDTH
from uavgram.views.survey.top_view import top_view

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LETTER_MM = 0.24
"""Least size of a unit of the plan's letters [mm]: they are 11 of them high."""

MAX_BARS = 25
"""Number of measurements whose budget is drawn, the least certain ones."""

_TURN = np.linspace(0.0, 2.0 * np.pi, 49)


def residuals(result: Result, axes: Axes | None = None) -> Axes:
    """Plot the residuals of the picks [px], adjusted minus picked, with suspect ones in red.

    Parameters
    ----------
    result
        Result of a run.
    axes
        Axes to draw into; by default in a figure of its own.
    """
    axes = _axes_or_new(axes)
    status = np.array(result.picks.status, dtype=str)
    for name, colour, mark in (("used", "#00796b", "o"), ("suspect", INK["suspect"], "X")):
        some = result.picks.residual_px[status == name]
        if len(some):
            axes.scatter(some[:, 0], some[:, 1], s=16, c=colour, marker=mark, label=name)
    radius = 3.0 * float(np.median(result.picks.sigma_px)) if len(status) else 1.0
    circle = radius * np.stack([np.cos(_TURN), np.sin(_TURN)])
    axes.plot(*circle, "--", color="#777777", linewidth=1, label="3 sigma of a pick")
    axes.set(xlabel="to the right [px]", ylabel="downwards [px]", title="Residuals of the picks")
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.legend()
    return axes


def plan(result: Result, axes: Axes | None = None) -> Axes:
    """Plot the survey from above: points with enlarged 95 % ellipses, known and measured lines.

    It is the report's top view; grid and values are in metres, or feet if the project is in feet.

    Parameters
    ----------
    result
        Result of a run.
    axes
        Axes to draw into; by default in a figure of its own.
    """
    from uavgram.views.survey.figure import draw_in_axes  # noqa: PLC0415 - heavy

    axes = _axes_or_new(axes)
    room, paper = axes.get_position(), axes.get_figure(root=True)
    inches = np.ones(2) if paper is None else paper.get_size_inches()
    size_mm = 25.4 * inches * [room.width, room.height]
    view = top_view(result, unit=max(LETTER_MM * WIDTH / float(size_mm[0]), 1.0))
    axes.set_aspect("equal")
    if view is None:
        return axes
    drawing = view.drawing
    draw_in_axes(drawing, axes, float((size_mm / [drawing.width, drawing.height]).min()))
    axes.set_title(
        f"Green: measured, purple: known\n95 % ellipses {view.ellipse_factor} times as large"
    )
    return axes


def budget(result: Result, axes: Axes | None = None) -> Axes:
    """Plot the sources of each measurement's variance, as bars that add up to 100 %.

    Of many measurements, only the `MAX_BARS` least certain are shown.

    Parameters
    ----------
    result
        Result of a run.
    axes
        Axes to draw into; by default in a figure of its own.
    """
    axes = _axes_or_new(axes)
    axes.set(xlabel="share of the variance [%]", title="Where the uncertainty comes from")
    found = result.error_budget
    if found is None or not len(found.share):
        return axes
    has_value = np.isfinite(found.share[:, 0])
    rows = [i for i in order_worst_first(result.measurements) if has_value[i]][:MAX_BARS]
    names = [result.measurements.name[i] for i in rows]
    left = np.zeros(len(names))
    for k, source in enumerate(found.source):
        share = 100.0 * found.share[rows, k]
        axes.barh(names, share, left=left, label=source)
        left = left + share
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return axes


def _axes_or_new(axes: Axes | None) -> Axes:
    """Return the axes, or new ones; if pyplot is in use, in its figure, which a notebook shows."""
    if axes is not None:
        return axes
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        figure: Any = pyplot.figure(layout="constrained")
    else:
        from matplotlib.figure import Figure  # noqa: PLC0415 - heavy

        figure = Figure(layout="constrained")
    new: Axes = figure.subplots()
    return new

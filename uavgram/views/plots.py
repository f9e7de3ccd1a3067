"""Plots of a result: residuals, the plan from above, and the error budget.

Each draws into the given axes, or into a figure of its own, and returns the axes.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips, reference_strips
from uavgram.views.formatting import measurement_text, order_worst_first
from uavgram.views.style import INK
from uavgram.views.survey.outlines import nice_factor
from uavgram.views.units import table_unit, units_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ELLIPSE_SHARE = 0.03
"""Approximate size of the drawn ellipses, as a share of the plan's width."""

MAX_NAMED = 12
"""Number of measurements above which they are drawn thin and without names."""

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

    Coordinates are metres, or feet if the project is in feet.

    Parameters
    ----------
    result
        Result of a run.
    axes
        Axes to draw into; by default in a figure of its own.
    """
    axes = _axes_or_new(axes)
    measured, units = measured_strips(result), units_of(result)
    unit = table_unit(units)
    drawn = [(i, strips) for i, strips in measured.items() if strips]
    are_few = len(drawn) <= MAX_NAMED
    for k, (i, strips) in enumerate(drawn):
        row = measurement_text(result.measurements, int(i), units)
        look: dict[str, Any] = {"color": INK["measured"], "linewidth": 0.5}
        if are_few:
            look = {"color": f"C{k % 10}", "linewidth": 2, "linestyle": "-" if k < 10 else "-."}
        for strip in strips:
            axes.plot(*(unit.factor * strip[:, :2]).T, **look)
        if are_few:  # names on the lines would overlap
            axes.plot([], [], label=f"{row.name}: {row.value}", **look)
    for i, strip in reference_strips(result).items():
        ink = INK[result.lines.status[i]]
        axes.plot(*(unit.factor * strip[:, :2]).T, color=ink, linewidth=1.5, linestyle="--")
    place = unit.factor * result.points.position_world_m[:, :2]
    axes.plot(place[:, 0], place[:, 1], ".", color=INK["point"], markersize=4)
    for label, spot in zip(result.points.label, place, strict=True):
        axes.annotate(label, spot, xytext=(3, 3), textcoords="offset points", fontsize=8)
    factor = _ellipses(axes, result, unit.factor)
    axes.set_aspect("equal")
    axes.set(xlabel=f"east [{unit.symbol}]", ylabel=f"north [{unit.symbol}]")
    if drawn and are_few:
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
    axes.set_title(f"Solid: measured, dashed: known\n95 % ellipses {factor} times as large")
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


def _ellipses(axes: Axes, result: Result, unit: float) -> int:
    """Draw the ellipses within the survey; return their enlargement, besides the unit."""
    within, place = result.points.relative, result.points.position_world_m[:, :2]
    if not len(place):
        return 1
    extent_m = max(float(np.ptp(place, axis=0).max()), 1.0)
    factor = nice_factor(float(np.median(within.ellipse_95_m[:, 0])), ELLIPSE_SHARE * extent_m)
    azimuth, half = within.ellipse_azimuth_rad[:, None], factor * within.ellipse_95_m
    # ellipse by its half axes, turned to the azimuth (clockwise from north)
    along, across = half[:, :1] * np.cos(_TURN), half[:, 1:] * np.sin(_TURN)
    east = place[:, :1] + along * np.sin(azimuth) + across * np.cos(azimuth)
    north = place[:, 1:] + along * np.cos(azimuth) - across * np.sin(azimuth)
    axes.plot(unit * east.T, unit * north.T, color=INK["ellipse"], linewidth=1)
    return factor

"""Figures of studies, as SVG and PNG: errors predicted and simulated, their ratio and sources."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, NullLocator

from uavgram.model.simulation import SOURCES, MethodRow, Study
from uavgram.views.study import AGREES, SOURCE_WORDS

COLOURS = ("#2f6fb5", "#d9730d", "#2b8a3e", "#8e44ad", "#c92a2a")
SOURCE_COLOURS = ("#6b7280", "#e0b000", "#17a2a2", "#e377c2", "#8a6d3b", "#a8c686")
"""Colours of curves, and of sources of errors: each colour has one meaning."""
MARKERS = ("o", "s", "^", "D", "v")
MAX_TICKS = 8
GRID, GREY = "#e3e5e8", "#8a8f98"
_BELOW: dict[str, Any] = {
    "fontsize": 8.5,
    "loc": "upper center",
    "bbox_to_anchor": (0.5, -0.15),
    "ncols": 2,
    "frameon": False,
}
"""Legend below its own axes."""


def figure_files(studies: tuple[Study, ...]) -> dict[str, bytes]:
    """Return the contents of the files NAME.svg and NAME.png of each study.

    Parameters
    ----------
    studies
        The studies.
    """
    files = {}
    # Paths instead of fonts: the same picture wherever it is opened. A fixed salt and no date: the
    # same study gives the same file.
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "uavgram", "font.size": 9.5}):
        for study in studies:
            usual = next(iter(study.settings.values()), ())
            figure = _methods(usual) if usual else _cells(study)
            FigureCanvasAgg(figure)
            for kind in ("svg", "png"):
                drawn = io.BytesIO()
                metadata = {"Date": None} if kind == "svg" else {}
                figure.savefig(drawn, format=kind, dpi=110, metadata=metadata)
                files[f"{study.name}.{kind}"] = drawn.getvalue()
    return files


def _cells(study: Study) -> Figure:
    """Draw errors to the left, ratios in the middle, sources to the right."""
    figure = Figure(figsize=(12.0, 4.6), dpi=110, layout="constrained")
    axes = figure.subplots(1, 3)
    _errors(axes[0], study)
    _ratios(axes[1], study)
    _sources(axes[2], study)
    axes[0].legend(**_BELOW)
    return figure


def _errors(axis: Axes, study: Study) -> None:
    for k, (name, cells) in enumerate(study.curves.items()):
        colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
        at = [cell.at for cell in cells]
        predicted = [1e3 * cell.predicted_m for cell in cells]
        simulated = [1e3 * cell.simulated_m for cell in cells]
        axis.plot(at, predicted, color=colour, linewidth=1.4, label=name)
        axis.plot(at, simulated, marker, color=colour, markersize=5, fillstyle="none")
    axis.set_yscale("log")
    _plain_ticks(axis)
    _dress(axis, study, "Errors of measured distances [mm]\nline: predicted, marks: simulated")


def _plain_ticks(axis: Axes) -> None:
    """Set plain numbers as ticks of a logarithmic axis: 1, 2, 5 and tens, more if these are few."""
    low, high = axis.get_ylim()
    steps = [m * 10.0**k for k in range(-2, 6) for m in (1, 1.5, 2, 3, 4, 5, 7)]
    shown = [step for step in steps if low <= step <= high]
    if len(shown) > MAX_TICKS:
        shown = [step for step in shown if f"{step:e}"[0:3] in {"1.0", "2.0", "5.0"}]
    axis.set_yticks(shown, [f"{step:g}" for step in shown])
    axis.yaxis.set_minor_locator(NullLocator())
    axis.yaxis.set_minor_formatter(NullFormatter())


def _ratios(axis: Axes, study: Study) -> None:
    axis.axhspan(*AGREES, color=GREY, alpha=0.2, linewidth=0)
    axis.axhline(1.0, color=GREY, linewidth=1.0)
    curves = study.curves
    for k, cells in enumerate(curves.values()):
        shift = (k - (len(curves) - 1) / 2) * 0.012
        for cell in cells:
            low, high = cell.ratio_range
            at = _beside(cell.at, shift, study)
            axis.plot([at, at], [low, high], color=COLOURS[k % len(COLOURS)], linewidth=1.6)
            axis.plot(
                at, cell.ratio, MARKERS[k % len(MARKERS)], color=COLOURS[k % len(COLOURS)],
                markersize=4.5,
            )  # fmt: skip
    if max(cell.ratio_range[1] for cell in study.cells) > 3.0:
        axis.set_yscale("log")
        _plain_ticks(axis)
    else:
        low = min(0.9, *(cell.ratio_range[0] for cell in study.cells))
        axis.set_ylim(low - 0.02, max(1.1, *(c.ratio_range[1] for c in study.cells)) + 0.02)
    _dress(
        axis,
        study,
        "Errors over predicted errors\ncolours as on the left; bars: 95 %; grey: 0.95 to 1.05",
    )


def _beside(at: float, shift: float, study: Study) -> float:
    """Shift a position by a share of the axis, so that curves do not overlap."""
    every = [cell.at for cell in study.cells]
    if study.is_log:
        return float(at * (max(every) / min(every)) ** shift)
    return float(at + shift * (max(every) - min(every)))


def _sources(axis: Axes, study: Study) -> None:
    """Draw the share of each source in the predicted variance, for the first curve."""
    name, cells = next(iter(study.curves.items()))
    bottom = np.zeros(len(cells))
    for source, colour in zip(SOURCES, SOURCE_COLOURS, strict=True):
        part = np.array([100 * cell.share(source) for cell in cells])
        if part.max() < 0.5:
            continue
        axis.bar(
            np.arange(len(cells)), part, 0.75, bottom, color=colour, label=SOURCE_WORDS[source]
        )
        bottom += part
    axis.set_xticks(np.arange(len(cells)), [f"{cell.at:g}" for cell in cells], fontsize=8)
    axis.set_ylim(0, 100)
    axis.set_xlabel(study.axis)
    axis.legend(**_BELOW)
    axis.set_title(
        f"Where the errors come from [% of the variance]\n{name}", fontsize=9.5, loc="left"
    )


def _dress(axis: Axes, study: Study, title: str) -> None:
    axis.set_title(title, fontsize=9.5, loc="left")
    axis.grid(visible=True, color=GRID, linewidth=0.8)
    axis.set_axisbelow(True)
    if study.is_log:
        axis.set_xscale("log")
        axis.xaxis.set_minor_locator(NullLocator())
    shown = _apart(sorted({cell.at for cell in study.cells}), is_log=study.is_log)
    axis.set_xticks(shown, [f"{at:g}" for at in shown], fontsize=8)
    axis.set_xlabel(study.axis)


def _apart(at: list[float], *, is_log: bool) -> list[float]:
    """Select ticks whose texts do not overlap, including the last."""
    place = np.log(at) if is_log else np.array(at)
    room = 0.06 * (place[-1] - place[0])
    kept = [len(at) - 1]
    for k in range(len(at) - 2, -1, -1):
        if place[kept[-1]] - place[k] >= room:
            kept.append(k)
    return [at[k] for k in reversed(kept)]


def _methods(rows: tuple[MethodRow, ...]) -> Figure:
    """Draw the errors of each method: the median of scenes, and the range to the worst tenth."""
    figure = Figure(figsize=(9.0, 3.9), dpi=110, layout="constrained")
    axis = figure.subplots()
    for k, row in enumerate(rows):
        y = len(rows) - k
        axis.plot([1e3 * row.rms_m, 1e3 * row.ninth_m], [y, y], color=COLOURS[0], linewidth=2)
        axis.plot(1e3 * row.rms_m, y, "o", color=COLOURS[0], markersize=6)
        axis.plot(1e3 * row.ninth_m, y, "|", color=COLOURS[0], markersize=10)
    axis.set_yticks(range(len(rows), 0, -1), [row.method for row in rows])
    axis.set_xscale("log")
    axis.grid(visible=True, color=GRID, linewidth=0.8)
    axis.set_xlabel(
        "error of withheld distances [mm]: dot: half of the scenes are better; bar: nine tenths"
    )
    return figure

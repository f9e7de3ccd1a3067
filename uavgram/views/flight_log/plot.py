"""A flight log drawn: track, heights, clock and camera events, for ``uavgram log --plot``.

Matplotlib's figures are used without pyplot: no window, no state that others could see.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import PurePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure

from uavgram.model.flight.log import CameraEvents
from uavgram.model.flight.log_summary import BootSummary, LogSummary
from uavgram.views.flight_log.text import KINDS

_BLUE, _ORANGE, _RED, _GREY, _GREEN = "#2f6fb5", "#d9730d", "#c92a2a", "#8a8f98", "#2b8a3e"
_MOST_BOOTS = 4
_DATUMS = {"msl": "above sea level", "ellipsoid": "above the ellipsoid"}
_MARK_SIZE = 18.0


def log_plot_png(summary: LogSummary) -> bytes:
    """Draw a log; of many boots the four longest, in their order."""
    shown = _longest(summary.boots)
    figure = Figure(figsize=(13, 0.8 + 7.2 * len(shown)), dpi=110, layout="constrained")
    log = summary.log
    vehicle = "" if log.vehicle in log.firmware else log.vehicle
    title = f"{PurePath(log.path).name}   {KINDS[log.kind]}   {vehicle} {log.firmware}".rstrip()
    figure.suptitle(title, fontsize=13)
    parts = figure.subfigures(len(shown), 1, squeeze=False)
    for part, number in zip(parts.ravel(), shown, strict=True):
        _draw_boot(part, summary.boots[number], number + 1, len(summary.boots))
    drawn = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(drawn, format="png")
    return drawn.getvalue()


def _longest(boots: tuple[BootSummary, ...]) -> list[int]:
    order = sorted(range(len(boots)), key=lambda k: -len(boots[k].track_m))
    return sorted(order[:_MOST_BOOTS])


def _draw_boot(part: SubFigure, summary: BootSummary, number: int, count: int) -> None:
    span = " to ".join(summary.span_utc) if summary.span_utc[0] else "no UTC"
    part.suptitle(f"boot {number} of {count}: {span}" if count > 1 else span, fontsize=11)
    axes = part.subplots(2, 2)
    panels: tuple[tuple[Callable[[Axes, BootSummary], None], str], ...] = (
        (_draw_track, "Track and camera events"),
        (_draw_heights, "Height"),
        (_draw_clock, "Clock readings about their line"),
        (_draw_intervals, "Time from one camera event to the next"),
    )
    for axis, (draw, title) in zip(axes.ravel(), panels, strict=True):
        axis.set_title(title, fontsize=10, loc="left")
        axis.grid(visible=True, color="#e3e5e8", linewidth=0.8)
        axis.set_axisbelow(True)
        draw(axis, summary)


def _say_none(axis: Axes, text: str) -> None:
    axis.text(0.5, 0.5, text, transform=axis.transAxes, ha="center", va="center", color=_GREY)
    axis.set_xticks([])
    axis.set_yticks([])


def _confirmed(events: CameraEvents) -> np.ndarray:
    return np.asarray(events.confirmed > 0)


def _draw_track(axis: Axes, summary: BootSummary) -> None:
    if not len(summary.track_m):
        _say_none(axis, "no positions")
        return
    axis.plot(*summary.track_m.T, color=_BLUE, linewidth=1.2, label="track")
    axis.plot(*summary.track_m[0], "s", color=_GREEN, markersize=6, label="first position")
    events = summary.boot.events
    if events is not None:
        sure = _confirmed(events)
        places = summary.event_track_m
        if sure.any():
            axis.scatter(
                places[sure, 0],
                places[sure, 1],
                s=_MARK_SIZE,
                color=_ORANGE,
                zorder=3,
                label="camera event",
            )
        if not sure.all():
            axis.scatter(
                places[~sure, 0], places[~sure, 1], s=2.5 * _MARK_SIZE, marker="x",
                color=_RED, zorder=4, label="without feedback",
            )  # fmt: skip
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("east of the first position [m]")
    axis.set_ylabel("north [m]")
    axis.legend(fontsize=8, loc="best")


def _draw_heights(axis: Axes, summary: BootSummary) -> None:
    positions, events = summary.boot.positions, summary.boot.events
    if positions is None:
        _say_none(axis, "no positions")
        return
    axis.plot(
        positions.time_boot_s, positions.height_m, color=_BLUE, linewidth=1.2, label="vehicle"
    )
    home = summary.boot.home
    if home is not None:
        axis.step(
            [*home.time_boot_s, positions.time_boot_s[-1]],
            [*home.height_m, home.height_m[-1]],
            where="post", color=_GREEN, linewidth=1.2, label="home",
        )  # fmt: skip
    if events is not None:
        heights = np.interp(events.time_boot_s, positions.time_boot_s, positions.height_m)
        axis.scatter(
            events.time_boot_s, heights, s=_MARK_SIZE, color=_ORANGE, zorder=3, label="camera event"
        )
    axis.set_xlabel("time since boot [s]")
    axis.set_ylabel(f"{_DATUMS[positions.datum]} [m]")
    axis.legend(fontsize=8, loc="best")


def _draw_clock(axis: Axes, summary: BootSummary) -> None:
    clock = summary.clock
    if clock is None or not len(summary.clock_time_s):
        _say_none(axis, "nothing ties the boot clock to UTC")
        return
    residual_ms = summary.clock_residual_s * 1e3
    axis.plot(summary.clock_time_s, residual_ms, ".", color=_BLUE, markersize=3)
    axis.axhline(0.0, color=_GREY, linewidth=1.0)
    low, high = np.percentile(residual_ms, [1, 99])
    margin = max(0.3 * (high - low), 1.0)
    axis.set_ylim(low - margin, high + margin)
    axis.set_xlabel("time since boot [s]")
    axis.set_ylabel("reading ahead of the line [ms]")
    drift = f"{clock.source}, drift {(clock.rate - 1) * 1e6:+.1f} ppm, sigma {clock.sigma_s:.3f} s"
    axis.set_title(drift, fontsize=9, loc="right", color=_GREY)


def _draw_intervals(axis: Axes, summary: BootSummary) -> None:
    events = summary.boot.events
    if events is None or len(events.time_boot_s) < 2:
        _say_none(axis, "no camera events" if events is None else "one camera event")
        return
    apart = np.diff(events.time_boot_s)
    axis.vlines(events.time_boot_s[1:], 0.0, apart, color=_ORANGE, linewidth=1.2)
    axis.plot(events.time_boot_s[1:], apart, ".", color=_ORANGE, markersize=5)
    missed = ~_confirmed(events)[1:]
    if missed.any():
        axis.plot(
            events.time_boot_s[1:][missed], apart[missed], "x", color=_RED, markersize=8,
            label="without feedback",
        )  # fmt: skip
        axis.legend(fontsize=8, loc="best")
    axis.set_ylim(bottom=0.0)
    axis.set_xlabel("time since boot [s]")
    axis.set_ylabel("interval [s]")
    numbers = f"{events.source}, {len(events.time_boot_s)}, at {events.instant}"
    axis.set_title(numbers, fontsize=9, loc="right", color=_GREY)

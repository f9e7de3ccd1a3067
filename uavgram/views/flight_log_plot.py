"""Plot of a flight log, for ``uavgram log --plot``: track, attitude, GPS, clock, camera events.

Matplotlib's figures are used without pyplot: no window and no global state.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import PurePath

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from uavgram.geometry.motion.rotation import matrix_from_xyzw, ypr_from_matrix
from uavgram.model import flight_log
from uavgram.model.arrays import Floats
from uavgram.views.flight_log import KINDS

_BLUE, _ORANGE, _RED, _GREY, _GREEN = "#2f6fb5", "#d9730d", "#c92a2a", "#8a8f98", "#2b8a3e"
_MAX_BOOTS = 4
_DATUMS = {"msl": "above sea level", "ellipsoid": "above the ellipsoid"}
_MARK_SIZE = 18.0
_MIN_JUMP_M, _FASTEST = 5.0, 60.0
"""Largest step [m] and speed [m/s] from one row to the next that can be a flight."""


def log_plot_png(summary: flight_log.LogSummary) -> bytes:
    """Draw a log; of many boots the four longest, in their order."""
    shown = _select_longest(summary.boots)
    rows = [max(_rows(summary.boots[k]), 0.2) for k in shown]
    figure = Figure(figsize=(13, 0.8 + 3.6 * sum(rows)), dpi=110, layout="constrained")
    log = summary.log
    vehicle = "" if log.vehicle in log.firmware else log.vehicle
    title = f"{PurePath(log.path).name}   {KINDS[log.kind]}   {vehicle} {log.firmware}".rstrip()
    figure.suptitle(title, fontsize=13)
    parts = figure.subfigures(len(shown), 1, squeeze=False, height_ratios=rows)
    for part, number in zip(parts.ravel(), shown, strict=True):
        _draw_boot(part, summary.boots[number], number + 1, len(summary.boots))
    drawn = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(drawn, format="png")
    return drawn.getvalue()


def _select_longest(boots: tuple[flight_log.BootSummary, ...]) -> list[int]:
    order = sorted(range(len(boots)), key=lambda k: -len(boots[k].track_m))
    return sorted(order[:_MAX_BOOTS])


def _draw_boot(part: SubFigure, summary: flight_log.BootSummary, number: int, count: int) -> None:
    span = " to ".join(summary.span_utc) if summary.span_utc[0] else "no UTC"
    panels = list(_panels(summary))
    title = f"boot {number} of {count}: {span}" if count > 1 else span
    part.suptitle(title + ("" if panels else ": nothing to draw"), fontsize=11)
    for place, (title, draw) in enumerate(panels, start=1):
        axis = part.add_subplot(_rows(summary), 2, place)
        axis.set_title(title, fontsize=10, loc="left")
        axis.grid(visible=True, color="#e3e5e8", linewidth=0.8)
        axis.set_axisbelow(True)
        draw(axis)


def _rows(summary: flight_log.BootSummary) -> int:
    """Return the number of rows of panels."""
    return (len(list(_panels(summary))) + 1) // 2


def _panels(summary: flight_log.BootSummary) -> Iterator[tuple[str, Callable[[Axes], None]]]:
    """Yield title and drawing function of each panel for which the boot has data."""
    boot, sigmas = summary.boot, summary.boot.sigmas
    if boot.positions is not None:
        yield "Track and camera events", partial(_draw_track, summary, boot.positions)
        yield "Height", partial(_draw_heights, boot, boot.positions)
    if boot.attitudes is not None:
        yield "Attitude of the vehicle", partial(_draw_attitudes, boot.attitudes)
    if sigmas is not None and np.isfinite(sigmas.horizontal_m).any():
        yield "GPS quality", partial(_draw_quality, sigmas)
    if boot.reception is not None:
        yield "GPS reception", partial(_draw_reception, boot.reception)
    if summary.clock is not None and len(summary.clock_time_s):
        yield "Clock readings about their line", partial(_draw_clock, summary, summary.clock)
    if boot.events is not None and len(boot.events.time_boot_s) > 1:
        yield "Time from one camera event to the next", partial(_draw_intervals, boot.events)


def _select_flown(time_s: Floats, values: Floats) -> slice:
    """Return the rows of a curve (n, k) [m] from the first valid position on.

    Before a receiver or an estimator has a position, logs contain zeros or small numbers.
    """
    # first jump that no flight can make, after values near zero
    step = np.linalg.norm(np.diff(values, axis=0), axis=1)
    jumps = np.flatnonzero(step > np.maximum(_MIN_JUMP_M, _FASTEST * np.diff(time_s)))
    if len(jumps) and np.abs(values[: jumps[0] + 1]).max() < 0.1 * step[jumps[0]]:
        return slice(int(jumps[0]) + 1, None)
    return slice(None)


def _explain(axis: Axes, height: str, source: str) -> None:
    """Label the axes of a curve over time, and name its source."""
    axis.set_xlabel("time since boot [s]")
    axis.set_ylabel(height)
    axis.set_title(source, fontsize=9, loc="right", color=_GREY)
    if axis.get_legend_handles_labels()[0]:
        axis.legend(fontsize=8, loc="best")


def _add_right_axis(axis: Axes) -> Axes:
    """Add an axis on the right, below the curves and the legend of the left one."""
    right = axis.twinx()
    axis.set_zorder(right.get_zorder() + 1)
    axis.patch.set_visible(False)
    return right


def _mark_confirmed(events: flight_log.CameraEvents) -> np.ndarray:
    return np.asarray(events.confirmed > 0)


def _draw_track(
    summary: flight_log.BootSummary, positions: flight_log.PositionSamples, axis: Axes
) -> None:
    track = summary.track_m[_select_flown(positions.time_boot_s, summary.track_m)]
    axis.plot(*track.T, color=_BLUE, linewidth=1.2, label="track")
    axis.plot(*track[0], "s", color=_GREEN, markersize=6, label="first position")
    events = summary.boot.events
    if events is not None:
        sure = _mark_confirmed(events)
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
                color=_RED, zorder=4, label="not confirmed",
            )  # fmt: skip
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_xlabel("east of the first position [m]")
    axis.set_ylabel("north [m]")
    axis.legend(fontsize=8, loc="best")


def _draw_heights(boot: flight_log.Boot, positions: flight_log.PositionSamples, axis: Axes) -> None:
    time, height, home, events = positions.time_boot_s, positions.height_m, boot.home, boot.events
    flown = _select_flown(time, height[:, None])
    time, within = time[flown], height[flown]
    axis.plot(time, within, color=_BLUE, linewidth=1.2, label="vehicle")
    if home is not None:
        axis.step(
            [*home.time_boot_s, time[-1]],
            [*home.height_m, home.height_m[-1]],
            where="post", color=_GREEN, linewidth=1.2, label="home",
        )  # fmt: skip
        within = np.append(within, home.height_m[-1])
    if events is not None:
        heights = np.interp(events.time_boot_s, time, height[flown], left=np.nan)
        axis.scatter(
            events.time_boot_s, heights, s=_MARK_SIZE, color=_ORANGE, zorder=3, label="camera event"
        )
    room = max(0.08 * float(np.ptp(within)), 0.01)
    axis.set_ylim(within.min() - room, within.max() + room)
    _explain(axis, f"{_DATUMS[positions.datum]} [m]", positions.source)


def _draw_attitudes(attitudes: flight_log.AttitudeSamples, axis: Axes) -> None:
    yaw, pitch, roll = np.degrees(ypr_from_matrix(matrix_from_xyzw(attitudes.ned_from_body_xyzw)))
    time, heading = attitudes.time_boot_s, _add_right_axis(axis)
    heading.plot(time, yaw % 360.0, ".", color=_GREY, markersize=1.5)
    heading.set_ylabel("heading, grey [deg]")
    heading.set_ylim(0.0, 360.0)
    axis.plot(time, roll, color=_BLUE, linewidth=1.0, label="roll")
    axis.plot(time, pitch, color=_ORANGE, linewidth=1.0, label="pitch")
    _explain(axis, "roll, pitch [deg]", attitudes.source)


def _draw_quality(sigmas: flight_log.EstimatorSigmas, axis: Axes) -> None:
    both = np.stack([sigmas.horizontal_m, sigmas.vertical_m])
    for sigma, colour, name in zip(both, (_BLUE, _ORANGE), ("horizontal", "vertical"), strict=True):
        axis.plot(sigmas.time_boot_s, sigma, color=colour, linewidth=1.2, label=name)
    # receivers state hundreds of metres before they have a position
    axis.set_ylim(0.0, 1.3 * float(np.nanpercentile(both, 95)) + 0.01)
    _explain(axis, "1 sigma of positions [m]", sigmas.source)


def _draw_reception(heard: flight_log.ReceptionSamples, axis: Axes) -> None:
    axis.plot(heard.time_boot_s, heard.satellites, color=_BLUE, linewidth=1.2)
    axis.set_ylim(0.0, 1.2 * float(np.nanmax(heard.satellites, initial=1.0)))
    axis.yaxis.set_major_locator(MaxNLocator(integer=True))
    if np.isfinite(heard.hdop).any():
        spread = _add_right_axis(axis)
        spread.plot(heard.time_boot_s, heard.hdop, ".", color=_GREY, markersize=2)
        spread.set_ylabel("HDOP, grey (below 1 is good)")
        spread.set_ylim(0.0, 1.3 * float(np.nanpercentile(heard.hdop, 95)) + 0.01)
    _explain(axis, "satellites in use", heard.source)


def _draw_clock(summary: flight_log.BootSummary, clock: flight_log.BootClock, axis: Axes) -> None:
    residual_ms = summary.clock_residual_s * 1e3
    axis.plot(summary.clock_time_s, residual_ms, ".", color=_BLUE, markersize=3)
    axis.axhline(0.0, color=_GREY, linewidth=1.0)
    low, high = np.percentile(residual_ms, [1, 99])
    margin = max(0.3 * (high - low), 1.0)
    axis.set_ylim(low - margin, high + margin)
    drift = f"{clock.source}, drift {(clock.rate - 1) * 1e6:+.1f} ppm, sigma {clock.sigma_s:.3f} s"
    _explain(axis, "reading ahead of the line [ms]", drift)


def _draw_intervals(events: flight_log.CameraEvents, axis: Axes) -> None:
    apart = np.diff(events.time_boot_s)
    axis.vlines(events.time_boot_s[1:], 0.0, apart, color=_ORANGE, linewidth=1.2)
    axis.plot(events.time_boot_s[1:], apart, ".", color=_ORANGE, markersize=5)
    missed = ~_mark_confirmed(events)[1:]
    if missed.any():
        axis.plot(
            events.time_boot_s[1:][missed], apart[missed], "x", color=_RED, markersize=8,
            label="not confirmed",
        )  # fmt: skip
    axis.set_ylim(bottom=0.0)
    numbers = f"{events.source}, {len(events.time_boot_s)}, at {events.instant}"
    _explain(axis, "interval [s]", numbers)

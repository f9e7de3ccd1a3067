"""Accuracies that an estimator states in several messages, as one table."""

from __future__ import annotations

import numpy as np

from uavgram.io.logs.quality.rows import plausible_rows
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.log import EstimatorSigmas

RTK_FIXED = 6
"""Type of fix with solved ambiguities: GPS_FIX_TYPE_RTK_FIXED, in ArduPilot and PX4 alike."""

Stated = tuple[str, Floats, dict[str, Floats]]
"""What one message states: its name, times (N,) and columns (N,) by what they are of."""


def positions_known(name: str, time_s: Floats, horizontal_m: Floats, vertical_m: Floats) -> Stated:
    """How well a message says that positions are known.

    Parameters
    ----------
    name
        Of the message.
    time_s
        (N,) since boot.
    horizontal_m, vertical_m
        (N,) standard deviations.
    """
    return name, time_s, {"horizontal": horizontal_m, "vertical": vertical_m}


def _is_fixed(at_s: Floats, fix: tuple[Floats, Floats] | None) -> Bools:
    """(N,) whether the receiver's solutions before and after are fixed RTK ones."""
    if fix is None or not len(fix[0]):
        return np.zeros(len(at_s), dtype=np.bool_)
    return np.asarray(np.interp(at_s, fix[0], (fix[1] == RTK_FIXED).astype(float)) == 1.0)


def merged_sigmas(
    parts: list[Stated], fix: tuple[Floats, Floats] | None = None
) -> EstimatorSigmas | None:
    """Statements of several messages, interpolated to the times of the first that says anything.

    Parameters
    ----------
    parts
        Message name, (N,) times, and its columns by ``horizontal``, ``vertical`` [m], ``tilt``,
        ``yaw`` [rad]; where two messages state the same, the larger holds.
    fix
        (N,) times since boot, and the receiver's type of fix then, as MAVLink counts them.
    """
    base: Floats | None = None
    used: list[str] = []
    merged: dict[str, Floats] = {}
    for name, time, columns in parts:
        for key, values in columns.items():
            limit = 1000.0 if key in ("horizontal", "vertical") else 1.0
            rows = plausible_rows(time, (values > 0) & (values < limit))
            if not len(rows):
                continue
            base = time[rows] if base is None else base
            here = np.interp(base, time[rows], values[rows])
            merged[key] = np.fmax(merged[key], here) if key in merged else here
            if name not in used:
                used.append(name)
    if base is None:
        return None
    silent = np.full(len(base), np.nan)
    return EstimatorSigmas(
        time_boot_s=base,
        horizontal_m=merged.get("horizontal", silent),
        vertical_m=merged.get("vertical", silent),
        tilt_rad=merged.get("tilt", silent),
        yaw_rad=merged.get("yaw", silent),
        is_fixed=_is_fixed(base, fix),
        source="+".join(used),
    )

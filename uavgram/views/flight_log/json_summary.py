"""Summary of a flight log as a JSON object, for ``uavgram log FILE --json``."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from uavgram.estimation.clocks.clock_line import to_utc
from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    BootSummary,
    CameraEvents,
    EstimatorSigmas,
    GimbalSamples,
    HomeSamples,
    LogSummary,
    PositionSamples,
)


def log_summary_object(summary: LogSummary) -> Any:  # noqa: ANN401
    """Convert the content of a log to a JSON object; numbers missing in the log are null."""
    log = summary.log
    content = {
        "schema": 1,
        "path": log.path,
        "kind": log.kind,
        "vehicle": log.vehicle,
        "firmware": log.firmware,
        "undulation_m": log.undulation_m,
        "boots": [_boot(boot) for boot in summary.boots],
        "messages": [
            {"name": m.name, "count": m.count, "first_boot_s": m.first_s, "last_boot_s": m.last_s}
            for m in log.messages
        ],
        "notes": list(log.notes),
    }
    return _without_nan(content)


def _boot(summary: BootSummary) -> dict[str, Any]:
    boot, clock = summary.boot, summary.clock
    attitudes = boot.attitudes
    return {
        "span_utc": list(summary.span_utc) if summary.span_utc[0] else None,
        "path_m": summary.path_m,
        "clock": None
        if clock is None
        else {
            "source": clock.source,
            "pairs": len(summary.clock_time_s),
            "boot_to_utc_s": clock.offset_s,
            "sigma_s": clock.sigma_s,
            "drift_ppm": (clock.rate - 1) * 1e6,
            "drift_sigma_ppm": clock.drift_sigma * 1e6,
            "scatter_s": clock.scatter_s,
        },
        "positions": _positions(boot.positions),
        "attitudes": None if attitudes is None else _table(attitudes.source, attitudes.time_boot_s),
        "gimbal": _gimbal(boot.gimbal),
        "sigmas": _sigmas(boot.sigmas),
        "events": _events(boot.events, summary),
        "home": _home(boot.home, summary.home_moves_m),
        "messages": [message.record() for message in summary.messages],
    }


def _table(source: str, time_boot_s: Floats) -> dict[str, Any]:
    apart = np.diff(time_boot_s)
    return {
        "source": source,
        "count": len(time_boot_s),
        "first_boot_s": float(time_boot_s[0]),
        "last_boot_s": float(time_boot_s[-1]),
        "rate_hz": float(1 / np.median(apart)) if len(apart) else math.nan,
    }


def _positions(positions: PositionSamples | None) -> dict[str, Any] | None:
    if positions is None:
        return None
    p = positions
    return {
        **_table(p.source, p.time_boot_s),
        "height_datum": p.datum,
        "height_m": [float(p.height_m.min()), float(p.height_m.max())],
        "latitude_deg": [float(p.latitude_deg.min()), float(p.latitude_deg.max())],
        "longitude_deg": [float(p.longitude_deg.min()), float(p.longitude_deg.max())],
    }


def _gimbal(gimbal: GimbalSamples | None) -> dict[str, Any] | None:
    if gimbal is None:
        return None
    pitch_deg = np.degrees(gimbal.pitch_rad)
    return {
        **_table(gimbal.source, gimbal.time_boot_s),
        "yaw_frame": gimbal.yaw_frame,
        "pitch_deg": [float(pitch_deg.min()), float(pitch_deg.max())],
    }


def _sigmas(sigmas: EstimatorSigmas | None) -> dict[str, Any] | None:
    if sigmas is None:
        return None
    return {
        "source": sigmas.source,
        "median_horizontal_m": _median(sigmas.horizontal_m),
        "median_vertical_m": _median(sigmas.vertical_m),
        "median_tilt_deg": math.degrees(_median(sigmas.tilt_rad)),
        "median_yaw_deg": math.degrees(_median(sigmas.yaw_rad)),
    }


def _median(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def _events(events: CameraEvents | None, summary: BootSummary) -> dict[str, Any] | None:
    if events is None:
        return None
    clock = summary.clock
    utc = None if clock is None else to_utc(clock, events.time_boot_s).tolist()
    confirmed = events.confirmed > 0
    return {
        "source": events.source,
        "count": len(confirmed),
        "confirmed": int(confirmed.sum()),
        "instant": events.instant,
        "unconfirmed_images": events.image_number[~confirmed].tolist(),
        "missing_images": list(events.lost),
        "doubled_images": list(events.repeated),
        "time_boot_s": events.time_boot_s.tolist(),
        "time_utc_s": utc,
        "image": events.image_number.tolist(),
    }


def _home(home: HomeSamples | None, moves_m: float) -> dict[str, Any] | None:
    if home is None:
        return None
    return {
        "source": home.source,
        "latitude_deg": float(home.latitude_deg[0]),
        "longitude_deg": float(home.longitude_deg[0]),
        "height_m": float(home.height_m[0]),
        "height_datum": home.datum,
        "moves_m": moves_m,
    }


def _without_nan(value: Any) -> Any:  # noqa: ANN401 - whatever JSON can hold
    """Replace each number that is not finite by null."""
    if isinstance(value, dict):
        return {key: _without_nan(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_without_nan(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

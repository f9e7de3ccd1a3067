"""Content of a flight log, as lines of plain text and as plain data, for ``uavgram log FILE``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from uavgram.estimation.clocks.clock_line import convert_boot_to_utc
from uavgram.model import flight_log
from uavgram.model.arrays import Floats
from uavgram.model.naming import format_digits

KINDS = {
    "dataflash": "ArduPilot DataFlash log",
    "tlog": "MAVLink telemetry log",
    "ulog": "PX4 ULog",
}
_DATUMS = {"msl": "above mean sea level", "ellipsoid": "above the ellipsoid"}
_MANY = 20


Content = dict[str, Any]


def log_summary_lines(summary: flight_log.LogSummary) -> tuple[str, ...]:
    """List the content of a log: vehicle, boots, clock, tables, events, messages, notes."""
    log = collect_log_content(summary)
    lines = [f"{log['path']}: {KINDS[log['kind']]}"]
    lines.append(
        _row("vehicle", f"{log['vehicle'] or 'not stated'}; {log['firmware'] or 'no firmware'}")
    )
    if np.isfinite(log["undulation_m"]):
        lines.append(_row("undulation", f"{log['undulation_m']:+.2f} m, geoid above ellipsoid"))
    for number, boot in enumerate(log["boots"], start=1):
        lines.append(f"boot {number} of {len(log['boots'])}")
        lines.extend(_boot_lines(boot))
    lines.extend(_row("note", note) for note in log["notes"])
    messages = log["messages"]
    lines.append(f"{sum(m['count'] for m in messages)} messages of {len(messages)} types")
    # with several boots, first and last time are of different clocks: no rate
    one_clock = len(log["boots"]) == 1
    lines.extend(_message_line(message, one_clock=one_clock) for message in messages)
    return tuple(lines)


def _row(title: str, text: str) -> str:
    return f"  {title:<11} {text}"


def _boot_lines(boot: Content) -> list[str]:
    lines = []
    if boot["span_utc"]:
        lines.append(_row("flight", " to ".join(boot["span_utc"])))
    if (at := boot["positions"]) is not None:
        spent = at["last_boot_s"] - at["first_boot_s"]
        lines.append(_row("track", f"{boot['path_m']:.0f} m over ground in {spent:.1f} s"))
    texts = {
        "clock": _clock_text,
        "positions": _positions_text,
        "attitudes": _rate,
        "gimbal": _gimbal_text,
        "sigmas": _sigmas_text,
        "events": _events_text,
        "home": _home_text,
    }
    for table, text in texts.items():
        if boot[table] is not None:
            lines.append(_row(table, text(boot[table])))
        elif table != "clock":
            lines.append(_row(table, "none stated" if table in {"sigmas", "home"} else "none"))
    lines.extend(_row(m["level"], f"{m['text']} [{m['code']}]") for m in boot["messages"])
    return lines


def _clock_text(clock: Content) -> str:
    return (
        f"{clock['source']}, {clock['pairs']} pairs, drift {clock['drift_ppm']:+.1f} ± "
        f"{clock['drift_sigma_ppm']:.1f} ppm, scatter {clock['scatter_s'] * 1e3:.1f} ms, sigma "
        f"{clock['sigma_s']:.3f} s"
    )


def _rate(table: Content) -> str:
    """Format source, number of rows, span and rate of a table."""
    text = (
        f"{table['source']}, {table['count']}, {table['first_boot_s']:.1f} to "
        f"{table['last_boot_s']:.1f} s after boot"
    )
    rate = table["rate_hz"]
    return text if math.isnan(rate) else f"{text}, {format_digits(rate, 3)} Hz"


def _positions_text(positions: Content) -> str:
    low, high = positions["height_m"]
    return (
        f"{_rate(positions)}; height {low:.1f} to {high:.1f} m {_DATUMS[positions['height_datum']]}"
    )


def _gimbal_text(gimbal: Content) -> str:
    low, high = gimbal["pitch_deg"]
    frame = "north" if gimbal["yaw_frame"] == "earth" else "the vehicle's nose"
    return f"{_rate(gimbal)}; pitch {low:.1f} to {high:.1f} deg, yaw from {frame}"


def _sigmas_text(sigmas: Content) -> str:
    parts = [
        f"{name} {format_digits(value)} {unit}"
        for key, value in sigmas.items()
        if key != "source" and not math.isnan(value)
        for _, name, unit in [key.split("_")]
    ]
    return f"{sigmas['source']}: {', '.join(parts)} (medians, as the log states them)"


def _events_text(events: Content) -> str:
    time = np.array(events["time_boot_s"])
    text = f"{events['source']}, {len(time)}, {time[0]:.1f} to {time[-1]:.1f} s after boot"
    if len(time) > 1:
        apart = np.diff(time)
        text += f", {apart.min():.2f} to {apart.max():.2f} s apart, {np.median(apart):.2f} s median"
    meaning = {
        "feedback": "at the camera's feedback",
        "command": "at the command, a shutter's lag early",
    }
    text += f"; {events['confirmed']} confirmed, {meaning[events['instant']]}"
    for key, what in (
        ("unconfirmed_images", "triggered that the camera did not confirm"),
        ("missing_images", "missing"),
        ("doubled_images", "doubled"),
    ):
        if images := events[key]:
            text += f", {len(images)} {what} (image {_join_numbers(images)})"
    return text


def _join_numbers(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:_MANY])) + (", ..." if len(numbers) > _MANY else "")


def _home_text(home: Content) -> str:
    return (
        f"{home['source']}: {home['latitude_deg']:.7f}, {home['longitude_deg']:.7f} deg, "
        f"{home['height_m']:.2f} m {_DATUMS[home['height_datum']]}"
    )


def _message_line(message: Content, *, one_clock: bool) -> str:
    first, last, count = message["first_boot_s"], message["last_boot_s"], message["count"]
    line = f"  {message['name']:<36} {count:>8}"
    span = last - first
    if np.isfinite(span):
        line += f"   {first:9.1f} to {last:9.1f} s"
        if one_clock and span > 0 and count > 1:
            line += f"   {(count - 1) / span:8.3g} Hz"
    return line


def collect_log_content(summary: flight_log.LogSummary) -> Content:
    """Collect the content of a log; numbers missing in it are NaN."""
    log = summary.log
    return {
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


def _boot(summary: flight_log.BootSummary) -> dict[str, Any]:
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


def _positions(positions: flight_log.PositionSamples | None) -> dict[str, Any] | None:
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


def _gimbal(gimbal: flight_log.GimbalSamples | None) -> dict[str, Any] | None:
    if gimbal is None:
        return None
    pitch_deg = np.degrees(gimbal.pitch_rad)
    return {
        **_table(gimbal.source, gimbal.time_boot_s),
        "yaw_frame": gimbal.yaw_frame,
        "pitch_deg": [float(pitch_deg.min()), float(pitch_deg.max())],
    }


def _sigmas(sigmas: flight_log.EstimatorSigmas | None) -> dict[str, Any] | None:
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


def _events(
    events: flight_log.CameraEvents | None, summary: flight_log.BootSummary
) -> dict[str, Any] | None:
    if events is None:
        return None
    clock = summary.clock
    utc = None if clock is None else convert_boot_to_utc(clock, events.time_boot_s).tolist()
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


def _home(home: flight_log.HomeSamples | None, moves_m: float) -> dict[str, Any] | None:
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

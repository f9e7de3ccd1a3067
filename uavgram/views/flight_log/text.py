"""A flight log as lines of plain text, for ``uavgram log FILE``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight_log import (
    BootClock,
    BootSummary,
    CameraEvents,
    EstimatorSigmas,
    GimbalSamples,
    HomeSamples,
    LogSummary,
    MessageCount,
    PositionSamples,
)

KINDS = {
    "dataflash": "ArduPilot DataFlash log",
    "tlog": "MAVLink telemetry log",
    "ulog": "PX4 ULog",
}
_DATUMS = {"msl": "above mean sea level", "ellipsoid": "above the ellipsoid"}
_MANY = 20


def log_summary_lines(summary: LogSummary) -> tuple[str, ...]:
    """List the content of a log: vehicle, boots, clock, tables, events, messages, notes."""
    log = summary.log
    lines = [f"{log.path}: {KINDS[log.kind]}"]
    lines.append(_row("vehicle", f"{log.vehicle or 'not stated'}; {log.firmware or 'no firmware'}"))
    if np.isfinite(log.undulation_m):
        lines.append(_row("undulation", f"{log.undulation_m:+.2f} m, geoid above ellipsoid"))
    for number, boot in enumerate(summary.boots, start=1):
        lines.append(f"boot {number} of {len(summary.boots)}")
        lines.extend(_boot_lines(boot))
    lines.extend(_row("note", note) for note in log.notes)
    lines.append(f"{sum(m.count for m in log.messages)} messages of {len(log.messages)} types")
    # with several boots, first and last time are of different clocks: no rate
    one_clock = len(log.boots) == 1
    lines.extend(_message_line(message, one_clock=one_clock) for message in log.messages)
    return tuple(lines)


def _row(title: str, text: str) -> str:
    return f"  {title:<11} {text}"


def _boot_lines(summary: BootSummary) -> list[str]:
    boot, clock = summary.boot, summary.clock
    lines = []
    if summary.span_utc[0]:
        lines.append(_row("flight", f"{summary.span_utc[0]} to {summary.span_utc[1]}"))
    if boot.positions is not None:
        spent = boot.positions.time_boot_s[-1] - boot.positions.time_boot_s[0]
        lines.append(_row("track", f"{summary.path_m:.0f} m over ground in {spent:.1f} s"))
    if clock is not None:
        lines.append(_row("clock", _clock_text(clock, len(summary.clock_time_s))))
    lines.append(_row("positions", _positions_text(boot.positions)))
    attitudes = boot.attitudes
    text = "none" if attitudes is None else _rate(attitudes.source, attitudes.time_boot_s)
    lines.append(_row("attitudes", text))
    lines.append(_row("gimbal", _gimbal_text(boot.gimbal)))
    lines.append(_row("sigmas", _sigmas_text(boot.sigmas)))
    lines.append(_row("events", _events_text(boot.events)))
    lines.append(_row("home", _home_text(boot.home)))
    lines.extend(_row(m.level, f"{m.text} [{m.code}]") for m in summary.messages)
    return lines


def _clock_text(clock: BootClock, pairs: int) -> str:
    drift, drift_sigma = (clock.rate - 1) * 1e6, clock.drift_sigma * 1e6
    return (
        f"{clock.source}, {pairs} pairs, drift {drift:+.1f} ± {drift_sigma:.1f} ppm, "
        f"scatter {clock.scatter_s * 1e3:.1f} ms, sigma {clock.sigma_s:.3f} s"
    )


def _rate(source: str, time_boot_s: Floats) -> str:
    """Format source, number of rows, span and rate of a table."""
    first, last = time_boot_s[0], time_boot_s[-1]
    text = f"{source}, {len(time_boot_s)}, {first:.1f} to {last:.1f} s after boot"
    if len(time_boot_s) > 1:
        text += f", {1 / np.median(np.diff(time_boot_s)):.3g} Hz"
    return text


def _positions_text(positions: PositionSamples | None) -> str:
    if positions is None:
        return "none"
    low, high = positions.height_m.min(), positions.height_m.max()
    return (
        f"{_rate(positions.source, positions.time_boot_s)}; "
        f"height {low:.1f} to {high:.1f} m {_DATUMS[positions.datum]}"
    )


def _gimbal_text(gimbal: GimbalSamples | None) -> str:
    if gimbal is None:
        return "none"
    low, high = np.degrees([gimbal.pitch_rad.min(), gimbal.pitch_rad.max()])
    frame = "north" if gimbal.yaw_frame == "earth" else "the vehicle's nose"
    return (
        f"{_rate(gimbal.source, gimbal.time_boot_s)}; "
        f"pitch {low:.1f} to {high:.1f} deg, yaw from {frame}"
    )


def _sigmas_text(sigmas: EstimatorSigmas | None) -> str:
    if sigmas is None:
        return "none stated"
    stated = (
        ("horizontal", sigmas.horizontal_m, 1.0, "m"),
        ("vertical", sigmas.vertical_m, 1.0, "m"),
        ("tilt", sigmas.tilt_rad, np.degrees(1.0), "deg"),
        ("yaw", sigmas.yaw_rad, np.degrees(1.0), "deg"),
    )
    parts = [
        f"{name} {np.nanmedian(values) * scale:.2g} {unit}"
        for name, values, scale, unit in stated
        if np.isfinite(values).any()
    ]
    return f"{sigmas.source}: {', '.join(parts)} (medians, as the log states them)"


def _events_text(events: CameraEvents | None) -> str:
    if events is None:
        return "none"
    confirmed = events.confirmed > 0
    first, last = events.time_boot_s[[0, -1]]
    text = f"{events.source}, {len(confirmed)}, {first:.1f} to {last:.1f} s after boot"
    if len(confirmed) > 1:
        apart = np.diff(events.time_boot_s)
        text += f", {apart.min():.2f} to {apart.max():.2f} s apart, {np.median(apart):.2f} s median"
    meaning = {
        "feedback": "at the camera's feedback",
        "command": "at the command, a shutter's lag early",
    }
    text += f"; {int(confirmed.sum())} confirmed, {meaning[events.instant]}"
    missed = events.image_number[~confirmed].tolist()
    if missed:
        text += (
            f", {len(missed)} triggered that the camera did not confirm (image {_listed(missed)})"
        )
    if events.lost:
        text += f", {len(events.lost)} missing (image {_listed(events.lost)})"
    if events.repeated:
        text += f", {len(events.repeated)} doubled (image {_listed(events.repeated)})"
    return text


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:_MANY])) + (", ..." if len(numbers) > _MANY else "")


def _home_text(home: HomeSamples | None) -> str:
    if home is None:
        return "none stated"
    return (
        f"{home.source}: {home.latitude_deg[0]:.7f}, {home.longitude_deg[0]:.7f} deg, "
        f"{home.height_m[0]:.2f} m {_DATUMS[home.datum]}"
    )


def _message_line(message: MessageCount, *, one_clock: bool) -> str:
    line = f"  {message.name:<36} {message.count:>8}"
    span = message.last_s - message.first_s
    if np.isfinite(span):
        line += f"   {message.first_s:9.1f} to {message.last_s:9.1f} s"
        if one_clock and span > 0 and message.count > 1:
            line += f"   {(message.count - 1) / span:8.3g} Hz"
    return line

"""The survey on a map of the earth, where telemetry ties it to one."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun as rr

from uavgram.model.result import Result
from uavgram.stages.features import point_index
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import LINE_COLOURS, OBSERVED

MAP = "map"


def log_map(recorder: Recorder, result: Result) -> None:
    """Log points and known lengths in latitude and longitude (double precision in Rerun)."""
    points = result.points
    lat_lon = np.column_stack([points.latitude_deg, points.longitude_deg])
    known = np.isfinite(lat_lon[:, 0])
    if result.world.gauge != "world" or not known.any():
        return
    recorder.static(
        f"{MAP}/points",
        rr.GeoPoints(lat_lon=lat_lon[known], radii=rr.Radius.ui_points(4.0), colors=OBSERVED),
    )
    rows = point_index(result)
    strings, colours = [], []
    for start, end, status in zip(
        result.lines.start, result.lines.end, result.lines.status, strict=True
    ):
        if start in rows and end in rows and known[rows[start]] and known[rows[end]]:
            strings.append(lat_lon[[rows[start], rows[end]]])
            colours.append(LINE_COLOURS[status])
    if strings:
        recorder.static(
            f"{MAP}/known_lengths",
            rr.GeoLineStrings(lat_lon=strings, radii=rr.Radius.ui_points(2.0), colors=colours),
        )


def log_origin(recorder: Recorder, result: Result) -> None:
    """State the origin of the local world among the recording's properties."""
    world = result.world
    known: dict[str, Any] = {
        "gauge": world.gauge,
        "height_datum": world.height_datum,
        "latitude_deg": world.latitude_deg,
        "longitude_deg": world.longitude_deg,
        "height_m": world.height_m,
    }
    values = {name: value for name, value in known.items() if value is not None}
    recorder.stream.send_property("survey", rr.AnyValues(**values))

"""Survey on a map of the earth, if telemetry ties it to the earth."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import (
    footprints,
    measured_strips,
    position_strips,
    reference_strips,
)
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.world.labels import line_width
from uavgram.views.recording.world.survey import close_border
from uavgram.views.style import LINE_COLOURS, MEASURED, OBSERVED, QUIET, REFINED, SEED, Rgb
from uavgram.views.survey.outlines import track

MAP = "map"


def log_map(recorder: Recorder, result: Result) -> None:
    """Log flight, footprints, points and lines in latitude and longitude (double precision)."""
    world, points = result.world, result.points
    origin = world.origin
    if origin is None or not has_map(result):
        return

    def on_earth(strip: Floats) -> Floats:
        latitude, longitude, _ = geodetic_from_enu(strip, origin)
        return np.column_stack([latitude, longitude])

    def log_lines(name: str, strips: list[Floats], colours: list[Rgb], width: float) -> None:
        if strips:
            lat_lon = [on_earth(strip) for strip in strips]
            radii = rr.Radius.ui_points(width / 2)
            lines = rr.GeoLineStrings(lat_lon=lat_lon, radii=radii, colors=colours)
            recorder.static(f"{MAP}/{name}", lines)

    borders = [close_border(ring) for ring in footprints(result).values()]
    log_lines("footprints", borders, [QUIET] * len(borders), 1.0)
    for name, poses, colour in (
        ("flight_log", result.frames.seed, SEED),
        ("refined", result.frames.refined, REFINED),
    ):
        centers = track(result, poses)
        log_lines(name, [centers] if len(centers) > 1 else [], [colour], 2.0)
    measured = [strip for some in measured_strips(result).values() for strip in some]
    log_lines("measured", measured, [MEASURED] * len(measured), line_width(len(measured)))
    known = reference_strips(result)
    statuses = [result.lines.status[row] for row in known]
    log_lines("known_lengths", list(known.values()), [LINE_COLOURS[s] for s in statuses], 4.0)
    colours = [LINE_COLOURS[status] for status in result.control_lines.status]
    log_lines("lines_of_known_position", position_strips(result), colours, 2.0)
    lat_lon = np.column_stack([points.latitude_deg, points.longitude_deg])
    dots = rr.GeoPoints(
        lat_lon=lat_lon[np.isfinite(lat_lon[:, 0])],
        radii=rr.Radius.ui_points(3.0),
        colors=OBSERVED,
    )
    recorder.static(f"{MAP}/points", dots)


def has_map(result: Result) -> bool:
    """Return whether the survey has a place on the earth, and points to show there."""
    return result.world.gauge == "world" and bool(np.isfinite(result.points.latitude_deg).any())


def log_origin(recorder: Recorder, result: Result) -> None:
    """Log the origin of the local world among the recording's properties."""
    world = result.world
    place = {} if world.origin is None else world.origin._asdict()
    values = rr.AnyValues(gauge=world.gauge, height_datum=world.height_datum, **place)
    recorder.stream.send_property("survey", values)

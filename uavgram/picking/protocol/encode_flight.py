"""The flight as JSON for the page's map: track of the log during and around the photos."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight.log import Track
from uavgram.picking.protocol.encode_places import Json, number
from uavgram.pipeline.pick.live_survey import LiveSurvey

MOST_VERTICES = 300

BEFORE_AND_AFTER = 0.25
"""Time shown before the first and after the last photo, as a share of the time between them."""

LEAST_BEFORE_S = 5.0


def flight_json(survey: LiveSurvey) -> Json | None:
    """Return the track around the photos; None without seed poses.

    ``track`` is [UTC time s, east m, north m], empty where the photos state their own places.
    """
    posed = survey.posed
    if posed is None or posed.telemetry is None:
        return None
    track, vertices = posed.telemetry.track, np.zeros((0, 3))
    if isinstance(track, Track):
        vertices = around(track, posed.frames.time_utc_s)
    return {"track": [[number(t, 2), number(e, 2), number(n, 2)] for t, e, n in vertices.tolist()]}


def around(track: Track, time_utc_s: Floats) -> Floats:
    """Return (n, 3) time, east and north of the track while photos were taken, and some time more.

    Parameters
    ----------
    track
        Track of the flight.
    time_utc_s
        (F,) times of the photos, NaN where not known.
    """
    vertices = np.column_stack([track.position_time_s, track.position_world_m[:, :2]])
    known = time_utc_s[np.isfinite(time_utc_s)]
    if len(known):
        more = max(BEFORE_AND_AFTER * float(np.ptp(known)), LEAST_BEFORE_S)
        inside = (vertices[:, 0] >= known.min() - more) & (vertices[:, 0] <= known.max() + more)
        vertices = vertices[inside]
    if len(vertices) <= MOST_VERTICES:
        return vertices
    rows = np.linspace(0, len(vertices) - 1, MOST_VERTICES).round().astype(int)
    return np.asarray(vertices[rows])

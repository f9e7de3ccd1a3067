"""The flight as JSON for the page's map: where the log was when, around the photos."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.flight.log import Track
from uavgram.picking.protocol.encode_places import Json, number
from uavgram.pipeline.pick.live import LiveSurvey

MOST_VERTICES = 300

BEFORE_AND_AFTER = 0.25
"""Of the time between the first photo and the last: so much is shown on both sides."""

LEAST_BEFORE_S = 5.0


def flight_json(survey: LiveSurvey) -> Json | None:
    """The track around the photos, and the camera clock's readings; None without seed poses.

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
    """(n, 3) time, east and north of the track while photos were taken, and some time more.

    Parameters
    ----------
    track
        Of the flight.
    time_utc_s
        (F,) of the photos, NaN where not known.
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

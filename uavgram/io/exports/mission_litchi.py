"""mission_litchi.csv: the mission for DJI drones, through Litchi's Mission Hub.

The format: https://www.litchiutilities.com/docs/litchiCsv.php. It has no settings of a whole
mission, so drone and gimbal are turned by actions at each stop, which need none; what happens after
the last stop ("Finish Action") is for a person to choose there.
"""

from __future__ import annotations

import csv
import io

from uavgram.model.maps.mission import HeightFrame, Mission

NO_ACTION, STAY_MS, PHOTO, TURN_DRONE, TILT_CAMERA = -1, 0, 1, 4, 5
MOST_ACTIONS = 15
MOST_STAY_MS = 32_000

_INTERPOLATED_GIMBAL = 2
_ABOVE: dict[HeightFrame, int] = {"relative": 0, "terrain": 1}
_ACTIONS = [f"action{part}{k}" for k in range(1, MOST_ACTIONS + 1) for part in ("type", "param")]
COLUMNS = (
    *("latitude", "longitude", "altitude(m)", "heading(deg)", "curvesize(m)", "rotationdir"),
    *("gimbalmode", "gimbalpitchangle", *_ACTIONS, "altitudemode", "speed(m/s)"),
    *("poi_latitude", "poi_longitude", "poi_altitude(m)", "poi_altitudemode"),
    *("photo_timeinterval", "photo_distinterval"),
)


def litchi_text(mission: Mission) -> str:
    """One row for each stop: turn, tilt, wait, take a photo."""
    written = io.StringIO()
    table = csv.writer(written, lineterminator="\n")
    table.writerow(COLUMNS)
    stay_ms = min(round(1000 * mission.hold_s), MOST_STAY_MS)
    for latitude, longitude, height, heading, pitch in zip(
        mission.latitude_deg.tolist(),
        mission.longitude_deg.tolist(),
        mission.height_m.tolist(),
        mission.heading_deg.tolist(),
        mission.gimbal_pitch_deg.tolist(),
        strict=True,
    ):
        turned = round(heading) % 360  # whole degrees are all that actions take
        actions = (
            (TURN_DRONE, turned),
            (TILT_CAMERA, round(pitch)),
            (STAY_MS, stay_ms),
            (PHOTO, 0),
        )
        rest = [(NO_ACTION, 0)] * (MOST_ACTIONS - len(actions))
        table.writerow(
            (
                *(f"{latitude:.9f}", f"{longitude:.9f}", f"{height:.2f}", turned, 0, 0),
                *(_INTERPOLATED_GIMBAL, round(pitch)),
                *(number for action in (*actions, *rest) for number in action),
                *(_ABOVE[mission.height_frame], f"{mission.speed_m_s:g}"),
                *(0, 0, 0, 0, -1, -1),
            )
        )
    return written.getvalue()

"""Side view of a measurement's points: stations along it, heights, and sigmas."""

from __future__ import annotations

import numpy as np

from uavgram.model.observations import MeasurementRequest
from uavgram.model.result.tables import ProfileResults
from uavgram.pipeline.pick.live_survey import LiveAdjustment
from uavgram.pipeline.threads import with_one_blas_thread
from uavgram.stages.measure import compute_profiles


@with_one_blas_thread
def make_side_view(adjusted: LiveAdjustment, name: str) -> ProfileResults | None:
    """Return a measurement's adjusted points, in order along it.

    A profile is viewed across its own line; other measurements across the line from the first point
    to the one furthest from it, seen from above.

    Parameters
    ----------
    adjusted
        A full adjustment.
    name
        Name of the measurement.

    Returns
    -------
    points
        None where it was not requested then, or fewer than two of its points are adjusted.
    """
    request = next((one for one in adjusted.observed.requests if one.name == name), None)
    if request is None:
        return None
    points = adjusted.result.points
    place = dict(zip(points.label, points.position_world_m, strict=True))
    label = [one for one in dict.fromkeys(request.points) if one in place]
    if len(label) < 2:
        return None
    if request.kind != "profile":
        away = np.array([place[one] for one in label])[:, :2] - place[label[0]][:2]
        label.append(label.pop(int(np.argmax(np.hypot(*away.T)))))
    along = MeasurementRequest(name=name, kind="profile", points=tuple(label))
    found = compute_profiles(adjusted.adjustment, (along,))
    return found if found.label else None

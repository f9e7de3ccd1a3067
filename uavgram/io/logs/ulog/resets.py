"""Resets of the estimator that PX4 counts (msg/versioned/VehicleLocalPosition.msg and others)."""

from __future__ import annotations

import numpy as np

from uavgram.io.logs.quality.reset_texts import in_order
from uavgram.io.logs.ulog.topics import UlogTables
from uavgram.model.flight.second_opinions import EstimatorReset

_COUNTERS = (
    ("vehicle_local_position", "xy_reset_counter", "reset of the position"),
    ("vehicle_local_position", "z_reset_counter", "reset of the height"),
    ("vehicle_local_position", "heading_reset_counter", "reset of the heading"),
    ("vehicle_global_position", "lat_lon_reset_counter", "reset of the position"),
    ("vehicle_global_position", "alt_reset_counter", "reset of the height"),
    ("vehicle_attitude", "quat_reset_counter", "reset of the attitude"),
)


def stated_resets(tables: UlogTables) -> tuple[EstimatorReset, ...]:
    """Rows at which a counter of resets changes, in the order of time."""
    found: list[EstimatorReset] = []
    for name, field, what in _COUNTERS:
        topic = tables.topic(name)
        if topic is None or field not in topic.fields:
            continue
        step = np.diff(topic.column(field))
        rows = np.flatnonzero(np.isfinite(step) & (step != 0)) + 1
        found.extend(EstimatorReset(time, what) for time in topic.time_s[rows].tolist())
    return in_order(found)

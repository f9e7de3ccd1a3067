"""What an autopilot says in words of its estimator beginning anew, in the words of a reader."""

from __future__ import annotations

import math
from collections.abc import Iterable

from uavgram.model.flight.second_opinions import EstimatorReset

# ArduPilot, libraries/AP_NavEKF3/*.cpp, AP_NavEKF/*.cpp, AP_AHRS.cpp and ArduCopter/events.cpp:
# texts of GCS_SEND_TEXT, parts of them in small letters.
_TEXTS = (
    ("lane switch", "change to another estimator"),
    ("primary changed", "change to another estimator"),
    ("yaw aligned", "reset of the heading"),
    ("yaw re-aligned", "reset of the heading"),
    ("yaw alignment complete", "reset of the heading"),
    ("yaw reset", "reset of the heading"),
    ("alt reset", "reset of the height"),
    ("gps glitch", "glitch of the GPS"),
    ("glitch cleared", "end of a glitch of the GPS"),
    ("is using gps", "change of what the estimator goes by"),
    ("stopped aiding", "change of what the estimator goes by"),
)


def resets_in_texts(time_s: Iterable[float], texts: Iterable[str]) -> tuple[EstimatorReset, ...]:
    """Resets that messages to the ground station tell of, (N,) times since boot and (N,) texts."""
    found = []
    for time, text in zip(time_s, texts, strict=True):
        small = text.lower()
        what = next((words for part, words in _TEXTS if part in small), None)
        if what is not None and math.isfinite(time):
            found.append(EstimatorReset(float(time), what))
    return tuple(found)


def in_order(resets: Iterable[EstimatorReset]) -> tuple[EstimatorReset, ...]:
    """Each once, by time."""
    return tuple(sorted(set(resets), key=lambda reset: (reset.time_boot_s, reset.what)))

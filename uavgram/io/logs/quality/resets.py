"""Where an autopilot states that its estimator began anew: by counters, by numbers, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from uavgram.io.logs.topics import Messages
from uavgram.model.flight.second_opinions import EstimatorReset

ANY_CODE = -1

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


@dataclass(frozen=True, kw_only=True)
class StatedResets:
    """Which messages of a format state resets.

    Attributes
    ----------
    counters
        Message, field, what happened where its number changes.
    codes
        Message, fields, and by their numbers what happened; the last may be `ANY_CODE`.
    texts
        Message and field of texts to the ground station.
    """

    counters: tuple[tuple[str, str, str], ...] = ()
    codes: tuple[tuple[str, tuple[str, ...], Mapping[tuple[int, ...], str]], ...] = ()
    texts: tuple[tuple[str, str], ...] = ()


def stated_resets(messages: Messages, stated: StatedResets) -> tuple[EstimatorReset, ...]:
    """Of one boot, in the order of time, each once.

    Parameters
    ----------
    messages
        Of one boot.
    stated
        By the table of their format.
    """
    found = {
        *_counted(messages, stated),
        *_by_codes(messages, stated),
        *_in_messages(messages, stated),
    }
    return tuple(sorted(found, key=lambda reset: (reset.time_boot_s, reset.what)))


def _counted(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, field, what in stated.counters:
        topic = messages.topic(name)
        if topic is not None:
            step = np.diff(topic.column(field))
            rows = np.flatnonzero(np.isfinite(step) & (step != 0)) + 1
            yield from (EstimatorReset(time, what) for time in topic.time_s[rows].tolist())


def _by_codes(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, fields, known in stated.codes:
        topic = messages.topic(name)
        if topic is None:
            continue
        rows = zip(*(topic.column(field).tolist() for field in fields), strict=True)
        for time, code in zip(topic.time_s.tolist(), rows, strict=True):
            what = known.get(code) or known.get((*code[:-1], ANY_CODE))
            if what is not None and math.isfinite(time):
                yield EstimatorReset(time, what)


def _in_messages(messages: Messages, stated: StatedResets) -> Iterator[EstimatorReset]:
    for name, field in stated.texts:
        topic = messages.topic(name)
        if topic is not None and (lines := topic.texts(field)):
            yield from resets_in_texts(topic.time_s.tolist(), lines)


def resets_in_texts(time_s: Iterable[float], texts: Iterable[str]) -> Iterator[EstimatorReset]:
    """Resets that messages to the ground station tell of, (N,) times since boot and (N,) texts."""
    for time, text in zip(time_s, texts, strict=True):
        small = text.lower()
        what = next((words for part, words in _TEXTS if part in small), None)
        if what is not None and math.isfinite(time):
            yield EstimatorReset(float(time), what)

"""Resets of the estimator that a DataFlash log states: EV, ERR, and texts in MSG.

Numbers: ArduPilot libraries/AP_Logger/AP_Logger.h, LogEvent and LogErrorSubsystem.
"""

from __future__ import annotations

import numpy as np

from uavgram.io.logs.dataflash.samples import boot_time_s, numbers
from uavgram.io.logs.dataflash.tables import Tables
from uavgram.io.logs.quality.reset_texts import in_order, resets_in_texts
from uavgram.model.flight.second_opinions import EstimatorReset

_EVENTS = {60: "reset of the height", 62: "reset of the heading"}
# (subsystem, code); code -1 stands for any
_ERRORS = {
    (11, 2): "glitch of the GPS",
    (16, 2): "fault of the estimator (bad variances)",
    (24, -1): "change to another estimator",
}


def stated_resets(tables: Tables) -> tuple[EstimatorReset, ...]:
    """Of one boot, in the order of time."""
    found: list[EstimatorReset] = []
    if events := tables.columns("EV"):
        for time, number in zip(boot_time_s(events), numbers(events, "Id"), strict=True):
            if np.isfinite(time) and number in _EVENTS:
                found.append(EstimatorReset(float(time), _EVENTS[int(number)]))
    if errors := tables.columns("ERR"):
        codes = zip(
            boot_time_s(errors), numbers(errors, "Subsys"), numbers(errors, "ECode"), strict=True
        )
        for time, subsystem, code in codes:
            what = _ERRORS.get((subsystem, code)) or _ERRORS.get((subsystem, -1))
            if what is not None and np.isfinite(time):
                found.append(EstimatorReset(float(time), what))
    texts = tables.columns("MSG")
    words = texts.get("Message", np.zeros(0))
    if words.dtype.kind in "SO":  # damaged formats make numbers of it
        lines = (bytes(text).split(b"\0")[0].decode("latin-1") for text in words)
        found.extend(resets_in_texts(boot_time_s(texts).tolist(), lines))
    return in_order(found)

"""A made-up result whose measurements stand as a test wants them."""

from __future__ import annotations

from dataclasses import replace

from uavgram.model.result.reliability import MeasurementStatus
from uavgram.model.result.result import Result


def with_status(result: Result, *status: MeasurementStatus) -> Result:
    """The result with these statuses, the last one for all further measurements."""
    rows = result.measurements
    rest = (status[-1],) * (len(rows.name) - len(status))
    return replace(result, measurements=replace(rows, status=(*status, *rest)))

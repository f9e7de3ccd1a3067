"""Resets of the estimator that a telemetry log states: texts to the ground station."""

from __future__ import annotations

from uavgram.io.logs.quality.reset_texts import in_order, resets_in_texts
from uavgram.io.logs.tlog.stream import Stream
from uavgram.model.flight.second_opinions import EstimatorReset


def stated_resets(stream: Stream) -> tuple[EstimatorReset, ...]:
    """Of one boot, in the order of time."""
    columns, rows = stream.columns("STATUSTEXT")
    if not columns:
        return ()
    texts = (bytes(text).split(b"\0")[0].decode("latin-1") for text in columns["text"])
    return in_order(resets_in_texts(stream.boot_s(rows).tolist(), texts))

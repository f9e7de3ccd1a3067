"""Which photos the recording of a very large survey carries, and the message that says so."""

from __future__ import annotations

from dataclasses import replace

from uavgram.model.message import Message
from uavgram.model.result.result import Result

MOST_RECORDED = 5_000
"""Photos in a recording: at some 0.3 MB each the viewer needs gigabytes to open more."""


def carried(count: int) -> range:
    """Rows of the photos that the recording of so many carries: all, or evenly some of them."""
    return range(0, count, max(1, -(-count // MOST_RECORDED)))


def with_thinning_told(result: Result) -> Result:
    """The result with a note, where its recording carries only some of the photos."""
    count = len(result.frames.frame_id)
    rows = carried(count)
    if len(rows) == count:
        return result
    text = (
        f"The recording carries {len(rows)} of the {count} photos, one in {rows.step}: with all of "
        "them it would be too large to open. Nothing else is left out of it."
    )
    return replace(result, messages=(*result.messages, Message("info", "recording-thinned", text)))

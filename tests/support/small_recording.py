"""The smallest recording that a viewer opens."""

from __future__ import annotations

from pathlib import Path

import rerun as rr


def write_small_recording(path: Path) -> Path:
    stream = rr.RecordingStream("test", recording_id="test")
    stream.save(path)
    stream.log("text", rr.TextDocument("hello"), static=True)
    stream.flush()
    stream.disconnect()
    return path

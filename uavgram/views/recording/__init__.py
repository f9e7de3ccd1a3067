"""The review as a Rerun recording; the only package that knows Rerun."""

from uavgram.views.recording.write import write_recording

__all__ = ["write_recording"]

"""Review of a survey as a Rerun recording."""

from uavgram.views.recording.write import write_recording

__all__ = ["write_recording"]

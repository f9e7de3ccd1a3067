"""The strip of the frames' states."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.result.result import Result
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import FRAME_COLOURS
from uavgram.views.survey.frame_states import frame_states
from uavgram.views.wording import FRAME_STATE_WORDS

STATUS = "frame_status"


def log_status(recorder: Recorder, result: Result) -> None:
    """Log the state of each frame, and an end: else the last would have no width."""
    states = np.array(frame_states(result), dtype=str)
    recorder.static(
        STATUS,
        rr.StateConfiguration(
            values=list(FRAME_COLOURS),
            labels=[FRAME_STATE_WORDS[state] for state in FRAME_COLOURS],
            colors=list(FRAME_COLOURS.values()),
        ),
    )
    recorder.rows(
        STATUS, np.arange(len(states)), lambda some: [rr.StateChange.columns(state=states[some])]
    )
    recorder.after_the_last(STATUS, rr.StateChange.columns(state=[""]))  # "" ends a state

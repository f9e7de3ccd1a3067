"""One curve over the frames."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import Rgb


def log_curve(recorder: Recorder, path: str, values: Floats, name: str, colour: Rgb) -> None:
    """Log (F,) values where they are known, under a name that a person understands."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known):
        recorder.static(path, rr.SeriesLines(colors=colour, names=name, widths=2.0))
        recorder.rows(path, known, lambda some: [rr.Scalars.columns(scalars=values[some])])

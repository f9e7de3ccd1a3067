"""The least certain point at true scale, with a bar to compare it with."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.result.result import Result
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import OBSERVED
from uavgram.views.wording import size_text

BAR = "close_up/scale_bar"
# South of the point, in half axes of its ellipse.
BAR_BELOW = 1.6


def log_scale_bar(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Log a bar of a round length beside the ellipse of the least certain point."""
    if scene.worst_point is None:
        return
    major = float(result.points.relative.ellipse_95_m[scene.worst_point, 0])
    length = round_length(2 * major)
    middle = result.points.position_world_m[scene.worst_point] - [0.0, BAR_BELOW * major, 0.0]
    ends = middle + np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * length
    recorder.static(
        BAR,
        rr.LineStrips3D(
            [ends],
            colors=OBSERVED,
            radii=rr.Radius.ui_points(2.0),
            labels=[size_text(length)],
            show_labels=True,
        ),
    )


def round_length(most_m: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not larger."""
    power = 10.0 ** np.floor(np.log10(most_m))
    return float(power * max(f for f in (1, 2, 5) if f * power <= most_m * (1 + 1e-9)))

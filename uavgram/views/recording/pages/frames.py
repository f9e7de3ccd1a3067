"""Text sheet for every frame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.pages import page_environment, units_shown
from uavgram.views.recording.curves.plots import Curves
from uavgram.views.recording.curves.pose_curves import PoseCurves
from uavgram.views.recording.photo.frame_picks import FramePicks
from uavgram.views.survey.sources import frames_made
from uavgram.views.formatting import FRAME_STATUS_WORDS


def frame_sheets(
    result: Result, picks: FramePicks, curves: Curves, poses: PoseCurves
) -> Iterator[str]:
    """Yield the text sheet of each frame, in their order.

    Parameters
    ----------
    result
        Result of a run.
    picks
        Picks of each frame.
    curves, poses
        Residuals and corrections of every frame.
    """
    template = page_environment().get_template("recording/frame.md")
    frames = result.frames
    sigma = np.sqrt(np.diagonal(frames.refined.covariance, axis1=1, axis2=2))
    moved = np.linalg.norm(frames.refined.center_world_m - frames.seed.center_world_m, axis=1)
    w = np.nan_to_num(np.abs(result.picks.w))
    made, shown = frames_made(result), units_shown(result)
    for i, rows in enumerate(picks.rows):
        sheet = template.render(
            **shown,
            result=result,
            frames=frames,
            frame_words=FRAME_STATUS_WORDS,
            i=i,
            picks=rows,
            made=made,
            curves=curves,
            poses=poses,
            position_sigma_m=sigma[i, :3],
            moved_m=moved[i],
            worst_label=result.picks.label[rows[np.argmax(w[rows])]] if len(rows) else "",
        )
        yield sheet.rstrip("\n")

"""Text pages in the recording: summary, tables, and a sheet for every frame."""

from __future__ import annotations

import rerun as rr

from uavgram.model.result.result import Result
from uavgram.views.recording.curves.plots import Curves
from uavgram.views.recording.curves.pose_curves import PoseCurves
from uavgram.views.recording.pages.frames import frame_sheets
from uavgram.views.recording.pages.tables import (
    checks_page,
    heights_page,
    lengths_page,
    measured_page,
    messages_page,
    points_page,
    summary,
)
from uavgram.views.recording.photo.frame_picks import FramePicks
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.survey.verdict import verdict_words

SUMMARY = "documents/summary"
FRAME_SHEET = "documents/frame"
MEASURED = "documents/measurements"
LENGTHS = "documents/known_lengths"
CHECKS = "documents/checks"
POINTS = "documents/points"
HEIGHTS = "documents/heights"
MESSAGES = "documents/messages"


def log_documents(
    recorder: Recorder,
    result: Result,
    scene: Scene,
    picks: FramePicks,
    curves: Curves,
    poses: PoseCurves,
) -> None:
    """Log all pages.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    picks
        Picks of each frame.
    curves, poses
        Residuals and corrections of every frame.
    """
    for path, text in (
        (SUMMARY, summary(result, verdict_words(result), scene)),
        (MEASURED, measured_page(result)),
        (LENGTHS, lengths_page(result)),
        (CHECKS, checks_page(result)),
        (POINTS, points_page(result)),
        (MESSAGES, messages_page(result)),
    ):
        recorder.static(path, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    if scene.off_ground is not None:
        text = heights_page(result, scene.off_ground)
        recorder.static(HEIGHTS, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
    recorder.sheets(FRAME_SHEET, list(frame_sheets(result, picks, curves, poses)))

"""Automatic picks in each photo: matches and targets with marks of their own, tie points."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.model.survey.observations import Source
from uavgram.views.recording.photo.frame_picks import FramePicks
from uavgram.views.recording.photo_marks import log_dots, log_polylines
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import FOUND, TIE

MARKS: dict[Source, tuple[Floats, ...]] = {
    "match": (
        np.array([[-1.0, -1.0], [1.0, 1.0]]),
        np.array([[-1.0, 1.0], [1.0, -1.0]]),
    ),
    "target": (np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]]),),
}
"""Lines of the mark of each source, in half sizes: a diagonal cross, and a square."""

MARK_SHARE = 0.009
"""Half size of a mark, as a share of the photo's width."""

FOUND_PICKS = "picked_by_program"
SIGHTINGS = "tie_points"


def log_found(
    recorder: Recorder, result: Result, picks: FramePicks, shown: Bools, photo: str
) -> None:
    """Log the marks of matches and targets.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    picks
        Picks of each frame.
    shown
        (P,) picks to draw here; picks that do not fit are drawn elsewhere.
    photo
        Path of the photo's entity.
    """
    size = MARK_SHARE * result.camera.width_px
    source = np.array(result.picks.source, dtype=str)
    for name, lines in MARKS.items():
        own = shown & (source == name)
        marks = [
            [at + size * line for at in result.picks.pixel_px[rows[own[rows]]] for line in lines]
            for rows in picks.rows
        ]
        log_polylines(recorder, f"{photo}/{FOUND_PICKS}/{name}", marks, FOUND, 1.5)


def log_sightings(recorder: Recorder, result: Result, ties: TieCloud, photo: str) -> None:
    """Log small dots for the tie points in each photo.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    ties
        Tie points.
    photo
        Path of the photo's entity.
    """
    frames = range(len(result.frames.frame_id))
    order = np.argsort(ties.frame, kind="stable")
    edges = np.searchsorted(ties.frame[order], np.arange(len(frames) + 1))
    dots = [ties.pixel_px[order[edges[i] : edges[i + 1]]] for i in frames]
    log_dots(recorder, f"{photo}/{SIGHTINGS}", dots, TIE, 1.2)

"""Texts on the photo: of lines and points, as many as leave it to be seen."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.views.recording.photo.frame_picks import FramePicks
from uavgram.views.recording.photo_marks import log_texts
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.world.labels import HALF_LETTER, LINE_HEIGHT
from uavgram.views.survey.drawing import uncovered
from uavgram.views.unit_words import in_units
from uavgram.views.units import units_of
from uavgram.views.wording import number

Word = tuple[Floats, str]
"""Pixel and text of a label."""

MOST_LINE_WORDS, MOST_WORDS = 10, 22
"""More labels than this hide the photo: of lines, and of lines and points."""

ON_SMALL_SCREENS = 1.55
"""Texts are as many times as long there, in shares of the photo: on 1280 x 720 pixels."""


def log_names(
    recorder: Recorder, result: Result, picks: FramePicks, words: list[list[Word]], photo: str
) -> None:
    """Texts of the lines, then names of the points, as far as they do not cover each other.

    Each stands wholly in the photo: the view ends with it.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Of the run.
    picks
        By frame.
    words
        Per frame the texts of the lines.
    photo
        Path of the photo's entity.
    """
    anchors, texts, named = [], [], _with_heights(result)
    for rows, lines in zip(picks.rows, words, strict=True):
        kept = _fitting(result, inside(result, lines), MOST_LINE_WORDS)
        labels = [result.picks.label[p] for p in rows]
        at = result.picks.pixel_px[rows]
        names = [(spot, named.get(label, label)) for spot, label in zip(at, labels, strict=True)]
        every = _fitting(result, kept + inside(result, names), MOST_WORDS)
        anchors.append(np.reshape([anchor for anchor, _ in every], (-1, 2)))
        texts.append([text for _, text in every])
    log_texts(recorder, f"{photo}/labels", anchors, texts)


def _half_widths(result: Result, words: list[Word]) -> Floats:
    """(n,) of texts, in pixels of the photo."""
    return HALF_LETTER * result.camera.width_px * np.array([len(t) for _, t in words], dtype=float)


def inside(result: Result, words: list[Word]) -> list[Word]:
    """The same texts, moved into the photo where they would reach beyond it."""
    width, height = result.camera.width_px, result.camera.height_px
    moved = []
    for (anchor, text), half in zip(words, _half_widths(result, words), strict=True):
        edge = min(ON_SMALL_SCREENS * half, width / 2)
        u = np.clip(anchor[0], edge, width - edge)
        moved.append((np.array([u, np.clip(anchor[1], 0.0, (1 - LINE_HEIGHT) * height)]), text))
    return moved


def _fitting(result: Result, words: list[Word], most: int) -> list[Word]:
    at = np.reshape([anchor for anchor, _ in words], (-1, 2))
    half_widths = _half_widths(result, words)
    kept = uncovered(at, half_widths, LINE_HEIGHT * result.camera.height_px, most)
    return [words[k] for k in kept]


def _with_heights(result: Result) -> dict[str, str]:
    """``V21 +1.40 m`` of each point off the ground."""
    points = result.points
    rows = np.flatnonzero(points.is_off_ground).tolist()
    heights = [number(points.height_above_ground_m[row], 2, signed=True) for row in rows]
    return {
        points.label[row]: f"{points.label[row]} {in_units(f'{height} m', units_of(result))}"
        for row, height in zip(rows, heights, strict=True)
    }

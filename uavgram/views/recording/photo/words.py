"""Texts of lines and points on the photo, few enough to leave the photo visible."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.text_places import Placed
from uavgram.views.recording.photo.frame_picks import FramePicks
from uavgram.views.recording.photo_marks import log_polylines, log_texts
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.view_texts import hanging, place_texts
from uavgram.views.style import OBSERVED
from uavgram.views.unit_words import in_units
from uavgram.views.units import units_of
from uavgram.views.formatting import number

Word = tuple[Floats, str]
"""Pixel and text of a label."""

MOST_LINE_WORDS, MOST_WORDS = 10, 22
"""Largest numbers of labels: of lines, and of lines and points; more would hide the photo."""

HALF_LETTER, LINE_HEIGHT, HALF_DOT = 0.0062, 0.062, 0.004
"""Sizes on a usual screen.

Half the width of a letter and of a pick in shares of the photo's width, and the height of a
line in shares of its height.
"""

ON_SMALL_SCREENS = 1.55
"""Factor on the length of texts, in shares of the photo, on a screen of 1280 x 720 pixels."""

LEADERS, LEADER_WIDTH = "labels/lines", 1.0
"""Entity of the lines to texts apart from their objects, and their width in screen points."""


def log_names(
    recorder: Recorder, result: Result, picks: FramePicks, words: list[list[Word]], photo: str
) -> None:
    """Log texts of the lines, then names of the points, with lines to those apart from them.

    Each is completely within the photo, where the view ends.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    picks
        Picks of each frame.
    words
        Texts of the lines of each frame.
    photo
        Path of the photo's entity.
    """
    places, texts, leaders, named = [], [], [], _with_heights(result)
    for rows, lines in zip(picks.rows, words, strict=True):
        at = result.picks.pixel_px[rows]
        labels = [result.picks.label[p] for p in rows]
        names = [(spot, named.get(label, label)) for spot, label in zip(at, labels, strict=True)]
        wanted = [*lines[:MOST_LINE_WORDS], *names]
        placed = place_on_photo(result, wanted, at)
        kept = np.flatnonzero(np.isfinite(placed.boxes[:, 0])).tolist()
        hung = hanging(placed)
        places.append(hung[kept])
        texts.append([wanted[k][1] for k in kept])
        far = [k for k in kept if np.isfinite(placed.leaders[k, 0, 0])]
        leaders.append([np.stack([placed.leaders[k, 0], hung[k]]) for k in far])
    log_polylines(recorder, f"{photo}/{LEADERS}", leaders, OBSERVED, LEADER_WIDTH)
    log_texts(recorder, f"{photo}/labels", places, texts)


def place_on_photo(result: Result, words: Sequence[Word], picked_px: Floats) -> Placed:
    """Place texts on a photo, at most MOST_WORDS, the first ones first.

    Parameters
    ----------
    result
        Result of the run.
    words
        Texts to place.
    picked_px
        (n, 2) picks, which must not be covered.
    """
    size = np.array([result.camera.width_px, result.camera.height_px], dtype=np.float64)
    letter = size * [ON_SMALL_SCREENS * HALF_LETTER, LINE_HEIGHT / 2]
    dot = np.tile([*(HALF_DOT * size[:1]), *(HALF_DOT * size[:1]), 0.0], (len(picked_px), 1))
    return place_texts(
        np.reshape([spot for spot, _ in words], (-1, 2)),
        [text for _, text in words],
        letter,
        (np.zeros(2), size),
        np.column_stack([picked_px, dot]),
        most=MOST_WORDS,
    )


def _with_heights(result: Result) -> dict[str, str]:
    """Return the text of each point off the ground, such as ``V21 +1.40 m``."""
    points = result.points
    rows = np.flatnonzero(points.is_off_ground).tolist()
    heights = [number(points.height_above_ground_m[row], 2, signed=True) for row in rows]
    return {
        points.label[row]: f"{points.label[row]} {in_units(f'{height} m', units_of(result))}"
        for row, height in zip(rows, heights, strict=True)
    }

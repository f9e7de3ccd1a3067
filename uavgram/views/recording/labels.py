"""Labels in the recording's views: their texts, and their places without overlaps.

Rerun writes each text level below its place, in letters of one size on the screen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips, point_index, reference_strips
from uavgram.stages.products.text_places import Label, Placed, place_labels
from uavgram.views.formatting import (
    alternatives_text,
    axes_text,
    format_relative_sigma,
    format_with_sigma,
    order_worst_first,
)
from uavgram.views.recording.scene import Eye, Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import QUIET
from uavgram.views.survey.heights import height_label
from uavgram.views.survey.key_facts import least_certain_length
from uavgram.views.survey.outlines import longest_middle
from uavgram.views.survey.verdict import STATUS_WORDS, status_text
from uavgram.views.units import format_length, format_reading, units_of

HALF_LETTER_ON_SCREEN, LINE_ON_SCREEN = 0.0056, 0.040
"""Half the width of a letter on a usual screen, and the height of a line, in views of space.

Both are tangents of angles of view.
"""
HALF_VIEW = np.array([0.74, 0.50])
"""Half the size of such a view, as tangents."""
HALF_DOT, GAP = 0.004, 0.008
"""Margin around points without texts, and gap between a text and its object."""
REACH = 6.0
"""Largest distance of a text from its object, in its heights: a line leads to it."""


@dataclass(frozen=True, eq=False)
class ViewTexts:
    """Texts in space for one view.

    Attributes
    ----------
    rows
        (n,) indices of these texts among those to place.
    place_m, words
        (n, 3) places below which they are written, and (n,) texts.
    leaders_m
        (2, 3) lines to texts that are not beside their objects.
    """

    rows: Ints
    place_m: Floats
    words: tuple[str, ...]
    leaders_m: list[Floats]


def place_in_space(
    eye: Eye,
    anchor_m: Floats,
    words: Sequence[str],
    *,
    dots_m: Floats | None = None,
    most: int | None = None,
    spread: float = 1.0,
) -> ViewTexts:
    """Place texts in a view of space, the first ones first; those without room are omitted.

    Parameters
    ----------
    eye
        Eye of the view as it opens.
    anchor_m
        (N, 3) named objects.
    words
        (N,) texts.
    dots_m
        (K, 3) points that must not be covered.
    most
        Largest number of texts; by default all.
    spread
        Factor on the room of each.
    """
    spots = eye.project_to_screen(np.reshape(anchor_m, (-1, 3)))
    dots = np.empty((0, 2)) if dots_m is None else eye.project_to_screen(dots_m)
    placed = place_texts(
        spots * [1.0, -1.0],
        words,
        spread * np.array([HALF_LETTER_ON_SCREEN, LINE_ON_SCREEN / 2]),
        (-HALF_VIEW, HALF_VIEW),
        np.column_stack([dots * [1.0, -1.0], np.tile([HALF_DOT, HALF_DOT, 0.0], (len(dots), 1))]),
        most=most,
    )
    rows = np.flatnonzero(np.isfinite(placed.boxes[:, 0])).astype(np.int64)
    places = eye.place_in_space(anchor_m[rows], places_below(placed)[rows] * [1.0, -1.0])
    leaders = [
        np.stack([anchor_m[row], place])
        for row, place in zip(rows, places, strict=True)
        if np.isfinite(placed.leaders[row, 0, 0])
    ]
    return ViewTexts(rows, places, tuple(words[row] for row in rows.tolist()), leaders)


def place_texts(
    spots: Floats,
    words: Sequence[str],
    letter: Floats,
    bounds: tuple[Floats, Floats],
    taken: Floats,
    *,
    ranks: Sequence[int] | None = None,
    most: int | None = None,
) -> Placed:
    """Place level texts of one font size in a view whose y goes down, the first ones first.

    Parameters
    ----------
    spots
        (N, 2) named objects.
    words
        (N,) texts.
    letter
        (2,) half the width of a letter and half the height of a line.
    bounds
        First and last corner (2,) of the view.
    taken
        (t, 5) places where no text may be.
    ranks
        (N,) texts of a lower rank come first, by default in their order; those of a negative one
        must be at their objects.
    most
        Largest number of texts; by default all.
    """
    ranks = range(len(words)) if ranks is None else ranks
    labels = [
        Label(
            spot,
            spot,
            letter * [len(text) + 1.0, 1.0],
            2.0 * GAP / LINE_ON_SCREEN * float(letter[1]),
            "at" if rank < 0 else "beside",
            rank=rank,
        )
        for spot, text, rank in zip(spots, words, ranks, strict=True)
    ]
    return place_labels(labels, taken, bounds, least=1.0, reach=REACH, most=most)


def places_below(placed: Placed) -> Floats:
    """Return the (N, 2) places below which texts are written, where y goes down."""
    return np.asarray(placed.boxes[:, :2] - placed.boxes[:, 3:4] * [0.0, 1.0])


def log_in_space(recorder: Recorder, path: str, placed: ViewTexts) -> None:
    """Log texts and, below the same entity, the lines to their objects.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    placed
        The placed texts.
    """
    if placed.words:
        recorder.texts(path, placed.place_m, placed.words)
    recorder.lines(f"{path}/lines", placed.leaders_m, QUIET, 1.2)


# More than a dozen values are easier to read in tables.
MAX_LABELS = 14
MAX_MEASURED = 8
MAX_OF_A_KIND = 3
# The view from the side shows nothing else.
MAX_HEIGHTS = 24
# With more lines than this, which would hide the ground: thin lines, and labels farther apart.
MANY_LINES = 20
SPREAD = 1.5
# Place in the world, text, and row of the measurement (-1: none).
Candidate = tuple[Floats, str, int]


def line_width(count: int) -> float:
    """Return the line width in points on the screen: many lines are drawn thinner."""
    return 3.5 if count <= MANY_LINES else 0.8


def reference_text(result: Result, row: int) -> str:
    """Label a known length: ``R1 lane: 34.00 m (known)``."""
    lines = result.lines
    units = units_of(result)
    length_m, adjusted_m = float(lines.length_m[row]), float(lines.adjusted_m[row])
    taped = f"{lines.name[row]}: {format_reading(length_m, units)}"
    if lines.status[row] in ("suspect", "removed"):
        found = format_length(adjusted_m, units)
        return f"{lines.status[row].upper()} {taped} taped, {found} found"
    return f"{taped} (withheld)" if lines.status[row] == "checked" else f"{taped} (known)"


def measured_text(result: Result, row: int) -> str:
    """Label a measurement: ``road width 6.31 ± 0.02 m (contradicted)``, or with ``or 7.25 m``.

    The latter is the value of another solution that fits as well.
    """
    rows, units = result.measurements, units_of(result)
    value = format_with_sigma(float(rows.value[row]), float(rows.sigma[row]), rows.unit[row], units)
    status = status_text(rows, row)
    status = "" if status in {STATUS_WORDS["ok"], value} else f"({status})"
    words = (rows.name[row], value, alternatives_text(rows, row, units), status)
    return " ".join(filter(None, words))


def survey_labels(result: Result, scene: Scene) -> tuple[ViewTexts, frozenset[int]]:
    """Place the most important labels; the tables have all values.

    Their order is: suspect lines, the least certain length, the largest ellipse, rejected frames
    and suspect picks, other measurements (at most MOST_MEASURED, spread out), then the other known
    lengths and heights of points.

    Returns
    -------
    texts
        Texts that have room.
    measured
        Rows of the measurements among them.
    """
    known = reference_strips(result)
    suspect = [i for i in known if result.lines.status[i] in ("suspect", "removed")]
    measured, trouble = _measured(result), _problem_labels(result)
    wanted = [*_known(result, suspect), *measured[:1], *_worst_point(result, scene), *trouble]
    wanted += measured[1:MAX_MEASURED]
    wanted += _known(result, [i for i in known if i not in suspect])
    wanted += _heights(result, scene)
    spread = SPREAD if len(measured) > MANY_LINES else 1.0
    texts = _place(wanted, scene.eye, result, MAX_LABELS, spread)
    return texts, frozenset(wanted[k][2] for k in texts.rows.tolist() if wanted[k][2] >= 0)


def height_labels(result: Result, scene: Scene, eye: Eye) -> ViewTexts:
    """Place heights of points off the ground as far as they fit into the view from the side.

    Parameters
    ----------
    result
        Result of the run.
    scene
        Scene with the points off the ground.
    eye
        Eye of the view.
    """
    return _place(_heights(result, scene), eye, result, MAX_HEIGHTS)


def _place(
    wanted: list[Candidate], eye: Eye, result: Result, most: int, spread: float = 1.0
) -> ViewTexts:
    anchors = np.reshape([anchor for anchor, _, _ in wanted], (-1, 3))
    words = [text for _, text, _ in wanted]
    dots = result.points.position_world_m
    return place_in_space(eye, anchors, words, dots_m=dots, most=most, spread=spread)


def _heights(result: Result, scene: Scene) -> list[Candidate]:
    """Return heights of points off the ground, the highest first."""
    if scene.off_ground is None:
        return []
    points, rows, units = result.points, scene.off_ground.rows, units_of(result)
    highest = rows[np.argsort(-points.height_above_ground_m[rows], kind="stable")]
    return [
        (points.position_world_m[row], height_label(points, row, units), -1)
        for row in highest.tolist()
    ]


def _known(result: Result, rows: list[int]) -> list[Candidate]:
    known = reference_strips(result)
    return [(longest_middle(known[i]), reference_text(result, i), -1) for i in rows]


def _worst_point(result: Result, scene: Scene) -> list[Candidate]:
    """Return the label of the largest ellipse."""
    row, points = scene.worst_point, result.points
    if row is None:
        return []
    axes = axes_text(points.relative.ellipse_95_m[row], units_of(result))
    return [
        (points.position_world_m[row], f"{points.label[row]}: largest 95 % ellipse, {axes}", -1)
    ]


def _problem_labels(result: Result) -> list[Candidate]:
    """Label rejected frames at their place by the flight log, and suspect picks.

    At most MOST_OF_A_KIND of each are returned.
    """
    frames, picks, at = result.frames, result.picks, point_index(result)
    rejected = [
        (frames.seed.center_world_m[i], f"REJECTED {frames.frame_id[i]}", -1)
        for i, status in enumerate(frames.status)
        if status == "rejected" and result.has_seed[i]
    ]
    suspect = [
        (
            result.points.position_world_m[at[picks.label[p]]],
            f"SUSPECT PICK {picks.label[p]} in {picks.image[p]}",
            -1,
        )
        for p, status in enumerate(picks.status)
        if status == "suspect" and picks.label[p] in at
    ]
    return [*rejected[:MAX_OF_A_KIND], *suspect[:MAX_OF_A_KIND]]


def _measured(result: Result) -> list[Candidate]:
    """Return the least certain length first, marked as such, then the others in that order."""
    strips, worst = measured_strips(result), least_certain_length(result)
    rows = [int(i) for i in order_worst_first(result.measurements) if int(i) in strips]
    rows.sort(key=lambda i: i != worst)
    return [
        (
            longest_middle(strips[i]),
            (_least_certain(result, i) if i == worst else "") + measured_text(result, i),
            i,
        )
        for i in rows
    ]


def _least_certain(result: Result, row: int) -> str:
    """State why a length is the least certain: not unique, or the largest relative sigma."""
    rows = result.measurements
    if rows.is_ambiguous[row]:
        return "NOT UNIQUE: "
    share = format_relative_sigma(float(rows.value[row]), float(rows.sigma[row]), rows.unit[row])
    return f"LEAST CERTAIN LENGTH (by {share}): "

"""Labels in the pictures: their texts, and their places."""

from __future__ import annotations

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips, point_index, reference_strips
from uavgram.views.formatting import (
    alternatives_text,
    axes_text,
    format_relative_sigma,
    format_with_sigma,
    order_worst_first,
)
from uavgram.views.recording.scene import Eye, Scene
from uavgram.views.recording.view_texts import ViewTexts, place_in_space
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.survey.key_facts import least_certain_length
from uavgram.views.survey.off_ground import height_label
from uavgram.views.survey.outlines import longest_middle
from uavgram.views.survey.verdict import STATUS_WORDS, status_text
from uavgram.views.units import units_of

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
    taped = f"{lines.name[row]}: {convert_sentence(f'{length_m:.2f} m', units, exact=[length_m])}"
    if lines.status[row] in ("suspect", "removed"):
        found = convert_sentence(f"{adjusted_m:.2f} m", units, exact=[adjusted_m])
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
    return [(longest_middle([known[i]]), reference_text(result, i), -1) for i in rows]


def _worst_point(result: Result, scene: Scene) -> list[Candidate]:
    """Return the label of the largest ellipse."""
    row, points = scene.worst_point, result.points
    if row is None:
        return []
    axes = convert_sentence(axes_text(points.relative.ellipse_95_m[row]), units_of(result))
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
    rows = [int(i) for i in order_worst_first(result.measurements) if strips.get(int(i))]
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

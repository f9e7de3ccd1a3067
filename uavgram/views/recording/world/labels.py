"""What the labels in the pictures say, and where they fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import measured_strips, point_index, reference_strips
from uavgram.views.recording.eye import Eye
from uavgram.views.recording.scene import Scene
from uavgram.views.survey.drawing import longest_middle, uncovered
from uavgram.views.survey.key_facts import least_certain_length
from uavgram.views.survey.off_ground import height_label
from uavgram.views.survey.verdict import STATUS_WORDS, status_text
from uavgram.views.unit_words import in_units
from uavgram.views.units import units_of
from uavgram.views.wording import (
    alternatives_text,
    axes_text,
    relative,
    with_sigma,
    worst_first,
)

# Rerun does not keep labels from covering each other: beyond a dozen, tables are read instead.
MOST_LABELS = 14
MOST_MEASURED = 8
MOST_OF_A_KIND = 3
# The view from the side shows nothing else.
MOST_HEIGHTS = 24
# Size of a letter on a usual screen: half the width of one, and the height of a line. In the survey
# as tangents of angles of view, in the photo as shares of its width and height.
HALF_LETTER_ON_SCREEN, LINE_ON_SCREEN = 0.0056, 0.040
HALF_LETTER, LINE_HEIGHT = 0.0062, 0.062
# So many lines that they hide the ground: thin ones, and labels farther apart.
MANY_LINES = 20
SPREAD = 1.5
# Between an ellipse and a label beside it, in sizes of the scene.
LABEL_GAP = 0.03

# Place in the world, text, and row of the measurement (-1: none).
Candidate = tuple[Floats, str, int]


@dataclass(frozen=True, eq=False)
class Labels:
    """(N, 3) places in the world and (N,) texts; `measured` are the rows that are labelled."""

    anchor_m: Floats
    text: tuple[str, ...]
    measured: frozenset[int]


def line_width(count: int) -> float:
    """Points on the screen: many lines are drawn thinner."""
    return 3.5 if count <= MANY_LINES else 0.8


def reference_text(result: Result, row: int) -> str:
    """``R1 lane: 34.00 m (known)``."""
    lines = result.lines
    units = units_of(result)
    length_m, adjusted_m = float(lines.length_m[row]), float(lines.adjusted_m[row])
    taped = f"{lines.name[row]}: {in_units(f'{length_m:.2f} m', units, exact=[length_m])}"
    if lines.status[row] in ("suspect", "removed"):
        found = in_units(f"{adjusted_m:.2f} m", units, exact=[adjusted_m])
        return f"{lines.status[row].upper()} {taped} taped, {found} found"
    return f"{taped} (withheld)" if lines.status[row] == "checked" else f"{taped} (known)"


def measured_text(result: Result, row: int) -> str:
    """``road width 6.31 ± 0.02 m (contradicted)``; also ``or 7.25 m`` where that fits as well."""
    rows, units = result.measurements, units_of(result)
    value = with_sigma(float(rows.value[row]), float(rows.sigma[row]), rows.unit[row], units)
    status = status_text(rows, row)
    status = "" if status in {STATUS_WORDS["ok"], value} else f"({status})"
    words = (rows.name[row], value, alternatives_text(rows, row, units), status)
    return " ".join(filter(None, words))


def survey_labels(result: Result, scene: Scene) -> Labels:
    """What deserves to be seen first; a label that would cover one before it is left out.

    Suspect lines, the least certain length, the largest ellipse, rejected frames and suspect
    picks, other measurements (at most MOST_MEASURED, spread out), then the other known lengths and
    heights of points: the tables have them all.
    """
    known = reference_strips(result)
    suspect = [i for i in known if result.lines.status[i] in ("suspect", "removed")]
    measured = _measured(result)
    first = [*_known(result, suspect), *measured[:1]]
    spread = SPREAD if len(measured) > MANY_LINES else 1.0
    worst = _worst_point(result, scene, first, spread)
    trouble = _trouble(result)
    first += [*worst, *trouble, *measured[1:]]
    most = len(suspect) + len(worst) + len(trouble) + MOST_MEASURED
    chosen = _take(first, scene.eye, most, spread)
    rest = _known(result, [i for i in known if i not in suspect])
    kept = _take([*chosen, *rest, *_heights(result, scene)], scene.eye, MOST_LABELS, 1.0)
    return Labels(
        np.reshape([anchor for anchor, _, _ in kept], (-1, 3)),
        tuple(text for _, text, _ in kept),
        frozenset(row for _, _, row in kept if row >= 0),
    )


def height_labels(result: Result, scene: Scene) -> Labels:
    """Heights of points off the ground as far as they fit into the view from the side."""
    if scene.side_eye is None:
        return Labels(np.zeros((0, 3)), (), frozenset())
    kept = _take(_heights(result, scene), scene.side_eye, MOST_HEIGHTS, 1.0)
    return Labels(
        np.reshape([anchor for anchor, _, _ in kept], (-1, 3)),
        tuple(text for _, text, _ in kept),
        frozenset(),
    )


def _heights(result: Result, scene: Scene) -> list[Candidate]:
    """Heights of points off the ground, the highest first."""
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


def _worst_point(
    result: Result, scene: Scene, before: list[Candidate], spread: float
) -> list[Candidate]:
    """The largest ellipse: beside it to the north or south where other labels cover the point."""
    row, points = scene.worst_point, result.points
    if row is None:
        return []
    axes, spot = points.relative.ellipse_95_m[row], points.position_world_m[row]
    text = (
        f"{points.label[row]}: largest 95 % ellipse, {in_units(axes_text(axes), units_of(result))}"
    )
    aside = np.array([0.0, scene.ellipse_factor * axes[0] + LABEL_GAP * scene.size_m, 0.0])
    for side in (0, 1, -1):
        place: Candidate = (spot + side * aside, text, -1)
        if _take([*before, place], scene.eye, MOST_LABELS, spread)[-1] is place:
            return [place]
    return []


def _trouble(result: Result) -> list[Candidate]:
    """Rejected frames where the flight log has them, and suspect picks; at most MOST_OF_A_KIND."""
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
    return [*rejected[:MOST_OF_A_KIND], *suspect[:MOST_OF_A_KIND]]


def _measured(result: Result) -> list[Candidate]:
    """The worst length first, by name as such, then the others, the least certain first."""
    strips, worst = measured_strips(result), least_certain_length(result)
    rows = [int(i) for i in worst_first(result.measurements) if strips.get(int(i))]
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
    """Why this one: it is not the only value, or its sigma is the largest share of it."""
    rows = result.measurements
    if rows.is_ambiguous[row]:
        return "NOT UNIQUE: "
    share = relative(float(rows.value[row]), float(rows.sigma[row]), rows.unit[row])
    return f"LEAST CERTAIN LENGTH (by {share}): "


def _take(candidates: list[Candidate], eye: Eye, most: int, spread: float) -> list[Candidate]:
    anchors = np.reshape([anchor for anchor, _, _ in candidates], (-1, 3))
    half_widths = HALF_LETTER_ON_SCREEN * np.array([len(text) for _, text, _ in candidates])
    rows = uncovered(eye.on_screen(anchors), spread * half_widths, spread * LINE_ON_SCREEN, most)
    return [candidates[i] for i in rows]

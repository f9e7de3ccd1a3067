"""Overlay of the photo: residuals, lines, texts, automatic picks and tie points."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.geometry.ground.row_projection import row_poses
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource, TieCloud
from uavgram.model.survey.observations import Source
from uavgram.stages.products.map_layers import measured_strips, position_strips, reference_strips
from uavgram.stages.products.text_places import Placed
from uavgram.views.formatting import BRIGHTENED, FRAME_STATE_WORDS, number, order_worst_first
from uavgram.views.recording.photo import FramePicks
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.view_texts import place_texts, places_below
from uavgram.views.recording.world.labels import (
    line_width,
    measured_text,
    reference_text,
)
from uavgram.views.recording.world.survey import NEIGHBOURS
from uavgram.views.sentence_units import convert_sentence
from uavgram.views.style import (
    BAD,
    FOUND,
    HEIGHT_COLOURS,
    LINE_COLOURS,
    MEASURED_COLOURS,
    OBSERVED,
    REFINED,
    SEED,
    TIE,
    Rgb,
)
from uavgram.views.survey.drawing import SIGNS, Sign
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.off_ground import OffGround
from uavgram.views.survey.outlines import (
    VisiblePolylines,
    is_in_photo,
    project_from,
    sample_polyline,
    visible_runs,
)
from uavgram.views.survey.verdict import list_named_picks
from uavgram.views.units import units_of

MARKS: dict[Source, Sign] = {"match": "cross", "target": "square"}
"""Sign of each source."""

MARK_SHARE = 0.009
"""Half size of a mark, as a share of the photo's width."""

FOUND_PICKS = "picked_by_program"
SIGHTINGS = "tie_points"


def log_automatic_picks(
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
    for name, sign in MARKS.items():
        own = shown & (source == name)
        marks = [
            [
                at + size * line
                for at in result.picks.pixel_px[rows[own[rows]]]
                for line in SIGNS[sign]
            ]
            for rows in picks.rows
        ]
        recorder.lines_of_frames(f"{photo}/{FOUND_PICKS}/{name}", marks, FOUND, 1.5)


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
    recorder.dots_of_frames(f"{photo}/{SIGHTINGS}", dots, TIE, 1.2)


PhotoText = tuple[Floats, str]
"""Pixel and text of a label."""

MAX_LINE_TEXTS, MAX_TEXTS = 10, 22
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
    recorder: Recorder, result: Result, picks: FramePicks, words: list[list[PhotoText]], photo: str
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
        wanted = [*lines[:MAX_LINE_TEXTS], *names]
        placed = place_on_photo(result, wanted, at)
        kept = np.flatnonzero(np.isfinite(placed.boxes[:, 0])).tolist()
        hung = places_below(placed)
        places.append(hung[kept])
        texts.append([wanted[k][1] for k in kept])
        far = [k for k in kept if np.isfinite(placed.leaders[k, 0, 0])]
        leaders.append([np.stack([placed.leaders[k, 0], hung[k]]) for k in far])
    recorder.lines_of_frames(f"{photo}/{LEADERS}", leaders, OBSERVED, LEADER_WIDTH)
    recorder.dots_of_frames(f"{photo}/labels", places, OBSERVED, 0.0, texts)


def place_on_photo(result: Result, words: Sequence[PhotoText], picked_px: Floats) -> Placed:
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
        most=MAX_TEXTS,
    )


def _with_heights(result: Result) -> dict[str, str]:
    """Return the text of each point off the ground, such as ``V21 +1.40 m``."""
    points = result.points
    rows = np.flatnonzero(points.is_off_ground).tolist()
    heights = [number(points.height_above_ground_m[row], 2, signed=True) for row in rows]
    return {
        points.label[
            row
        ]: f"{points.label[row]} {convert_sentence(f'{height} m', units_of(result))}"
        for row, height in zip(rows, heights, strict=True)
    }


# Parent of the rulers from the ground to points off it, by the source of their heights.
HEIGHTS = "heights"
# Rulers are short: their bend needs few samples.
RULER_SAMPLES, RULER_WIDTH = 9, 2.0

# Entities drawn on the photo.
OVERLAYS = (
    "residual_exaggerated",
    "residual_exaggerated_suspect",
    "from_flight_log",
    "from_refined",
    "picked",
    FOUND_PICKS,
    "picked_suspect",
    SIGHTINGS,
    "labels",
    "known_lengths",
    "lines_of_known_position",
    "measured",
    *(f"{HEIGHTS}/{source}" for source in HEIGHT_COLOURS),
    "name",
    NEIGHBOURS,
)
# Height of the photo's name above it, as a share of the photo's height.
NAME_ABOVE = 0.075


def log_overlay(
    recorder: Recorder,
    result: Result,
    scene: Scene,
    picks: FramePicks,
    photo: str,
    brightened: Collection[int] = (),
) -> None:
    """Log all drawings on the photo, below the entity `photo`.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    picks
        Picks of each frame, with their projections [px].
    photo
        Path of the photo's entity.
    brightened
        Rows of the frames whose photos are brighter than the files.
    """
    words = _lines(recorder, result, picks, photo)
    if scene.off_ground is not None:
        _rulers(recorder, result, scene.off_ground, picks, photo)
    _residuals(recorder, result, scene, picks, photo)
    log_names(recorder, result, picks, words, photo)
    _title(recorder, result, photo, brightened)


def _title(recorder: Recorder, result: Result, photo: str, brightened: Collection[int]) -> None:
    """Log name and state of each photo, above it."""
    spot = np.array([[0.5 * result.camera.width_px, -NAME_ABOVE * result.camera.height_px]])
    texts = [
        [f"{name}: {FRAME_STATE_WORDS[state]}{f', {BRIGHTENED}' if k in brightened else ''}"]
        for k, (name, state) in enumerate(
            zip(result.frames.frame_id, frame_states(result), strict=True)
        )
    ]
    recorder.dots_of_frames(f"{photo}/name", [spot] * len(texts), OBSERVED, 0.0, texts)


def _residuals(
    recorder: Recorder, result: Result, scene: Scene, picks: FramePicks, photo: str
) -> None:
    pixel = result.picks.pixel_px
    named, picked = list_named_picks(result.verdict), result.picks
    bad = np.isin(np.array(picked.status, dtype=str), ("suspect", "removed"))
    bad |= np.array([p in named for p in zip(picked.image, picked.label, strict=True)], dtype=bool)
    fitted = np.isfinite(result.picks.residual_px[:, 0])
    tip = pixel + scene.residual_factor * np.nan_to_num(result.picks.residual_px)
    arrows = np.stack([pixel, tip], axis=1)

    def where(mask: Bools) -> list[Ints]:
        return [rows[mask[rows]] for rows in picks.rows]

    for name, rows, colour in (
        ("residual_exaggerated", where(fitted & ~bad), REFINED),
        ("residual_exaggerated_suspect", where(fitted & bad), BAD),
    ):
        recorder.lines_of_frames(f"{photo}/{name}", [list(arrows[r]) for r in rows], colour, 2.5)
    by_hand = result.picks.by_hand
    log_automatic_picks(recorder, result, picks, ~bad, photo)
    for name, at, rows, colour, size in (
        ("from_flight_log", picks.seed_px, where(is_in_photo(result, picks.seed_px)), SEED, 3.0),
        (
            "from_refined",
            picks.refined_px,
            where(is_in_photo(result, picks.refined_px)),
            REFINED,
            2.5,
        ),
        ("picked", pixel, where(by_hand & ~bad), OBSERVED, 3.5),
        ("picked_suspect", pixel, where(bad), BAD, 6.0),
    ):
        recorder.dots_of_frames(f"{photo}/{name}", [at[r] for r in rows], colour, size)


@dataclass(frozen=True, eq=False)
class _Shape:
    """Shape to draw in every frame that sees it: samples of one polyline in the world.

    `ends` are the labels that must all be picked in a frame; known lengths are always drawn.
    Contradicted measurements are dashed.
    """

    entity: str
    colour: Rgb
    text: str
    samples_m: Floats
    ends: frozenset[str] = frozenset()
    is_dashed: bool = False


def _shapes(result: Result) -> list[_Shape]:
    """Return known lengths, suspect first; lines; measurements, the least certain first."""
    known, measured = reference_strips(result), measured_strips(result)
    shapes = []
    for row in sorted(known, key=lambda i: result.lines.status[i] not in ("suspect", "removed")):
        status = result.lines.status[row]
        text = reference_text(result, row)
        entity = f"known_lengths/{status}"
        shapes.append(_Shape(entity, LINE_COLOURS[status], text, sample_polyline(known[row])))
    lines = result.control_lines
    for name, status, strip in zip(lines.name, lines.status, position_strips(result), strict=True):
        entity = f"lines_of_known_position/{status}"
        shapes.append(_Shape(entity, LINE_COLOURS[status], name, sample_polyline(strip)))
    for row in map(int, order_worst_first(result.measurements)):
        text, ends = measured_text(result, row), frozenset(result.measurements.points[row])
        standing = result.measurements.status[row]
        entity = f"measured/{standing}" if standing in ("doubtful", "contradicted") else "measured"
        shapes += [
            _Shape(
                entity,
                MEASURED_COLOURS[standing],
                text,
                sample_polyline(strip),
                ends,
                is_dashed=standing == "contradicted",
            )
            for strip in measured.get(row, [])
        ]
    return shapes


def _dashed(pixel: Floats) -> Floats:
    """Return the (m, 2) samples of a polyline, every fourth one NaN."""
    return np.where(np.arange(len(pixel))[:, None] % 4 == 3, np.nan, pixel)


def _lines(
    recorder: Recorder, result: Result, picks: FramePicks, photo: str
) -> list[list[PhotoText]]:
    """Log visible known lengths, and the measurements whose points were all picked in the frame.

    Returns
    -------
    The texts of the lines of each frame.
    """
    frames, shapes = range(len(result.frames.frame_id)), _shapes(result)
    in_sight = VisiblePolylines(result, [shape.samples_m for shape in shapes])
    words: list[list[PhotoText]] = [[] for _ in frames]
    kinds = {shape.entity: shape for shape in shapes}
    runs: dict[str, list[list[Floats]]] = {entity: [[] for _ in frames] for entity in kinds}
    for frame in np.flatnonzero(result.has_refined):
        picked = {result.picks.label[row] for row in picks.rows[frame]}
        near = (shapes[row] for row in in_sight.of(int(frame)))
        shown = [shape for shape in near if shape.ends <= picked]
        if not shown:
            continue
        samples = np.concatenate([shape.samples_m for shape in shown])
        cuts = np.cumsum([len(shape.samples_m) for shape in shown])[:-1]
        pixel = project_from(result, row_poses(result, int(frame)), samples)
        for shape, seen in zip(shown, np.split(pixel, cuts), strict=True):
            pieces = visible_runs(seen)
            if pieces:
                runs[shape.entity][frame] += (
                    visible_runs(_dashed(seen)) if shape.is_dashed else pieces
                )
                longest = max(pieces, key=len)
                words[frame].append((longest[len(longest) // 2], shape.text))
    for shape in kinds.values():
        per_frame = runs[shape.entity]
        width = line_width(max(map(len, per_frame))) if shape.ends else line_width(0)
        recorder.lines_of_frames(f"{photo}/{shape.entity}", per_frame, shape.colour, width)
    return words


def _rulers(
    recorder: Recorder, result: Result, standing: OffGround, picks: FramePicks, photo: str
) -> None:
    """Log the line from the ground to each picked point off it, which shows its height."""
    ends = np.stack([standing.foot_m, result.points.position_world_m[standing.rows]], axis=1)
    place = {result.points.label[row]: k for k, row in enumerate(standing.rows.tolist())}
    frames = range(len(result.frames.frame_id))
    lines: dict[HeightSource, list[list[Floats]]] = {
        source: [[] for _ in frames] for source in set(standing.source)
    }
    for frame in np.flatnonzero(result.has_refined):
        labels = [result.picks.label[pick] for pick in picks.rows[frame]]
        here = [place[label] for label in labels if label in place]
        if not here:
            continue
        strips = np.stack([sample_polyline(ends[k], RULER_SAMPLES) for k in here])
        pixel = project_from(result, row_poses(result, int(frame)), strips)
        for k, seen in zip(here, pixel, strict=True):
            lines[standing.source[k]][frame] += visible_runs(seen)
    for source, per_frame in lines.items():
        recorder.lines_of_frames(
            f"{photo}/{HEIGHTS}/{source}", per_frame, HEIGHT_COLOURS[source], RULER_WIDTH
        )

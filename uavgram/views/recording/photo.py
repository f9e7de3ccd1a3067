"""One frame at a time: the moving camera, its photo, picks, residuals, lines and texts over it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
import rerun as rr

from uavgram.geometry.ground.row_projection import RowPoses
from uavgram.imaging.photos.preview import Preview
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.maps import close_ring
from uavgram.model.observations import Source
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.stages.products.map_layers import (
    footprints,
    measured_strips,
    point_index,
    position_strips,
    reference_strips,
)
from uavgram.stages.products.text_places import Placed
from uavgram.views import style
from uavgram.views.formatting import BRIGHTENED, FRAME_STATE_WORDS, order_worst_first
from uavgram.views.recording.labels import (
    line_width,
    measured_text,
    place_texts,
    places_below,
    reference_text,
)
from uavgram.views.recording.scene import CURRENT_FRUSTUM, Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.survey import outlines
from uavgram.views.survey.drawing import SIGNS, Sign
from uavgram.views.survey.heights import OffGround
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.verdict import list_named_picks
from uavgram.views.units import format_length, units_of


@dataclass(frozen=True, eq=False)
class FramePicks:
    """Picks of each frame and their projections.

    Attributes
    ----------
    rows
        (n,) rows of the picks of each frame.
    seed_px, refined_px
        (P, 2) projections of the adjusted point; NaN without a pose or outside the photo.
    """

    rows: list[Ints]
    seed_px: Floats
    refined_px: Floats


def project_picks(result: Result) -> FramePicks:
    """Project every picked point back into its frame, from both poses."""
    at = point_index(result)
    known = np.array([at.get(label, -1) for label in result.picks.label], dtype=np.int64)
    rows = rows_by_frame(result)
    seed = np.full((len(known), 2), np.nan)
    refined = np.full((len(known), 2), np.nan)
    for frame, in_frame in enumerate(rows):
        picks = in_frame[known[in_frame] >= 0]
        points = result.points.position_world_m[known[picks]]
        for poses, pixel, adjusted in (
            (result.frames.seed, seed, False),
            (result.frames.refined, refined, True),
        ):
            if len(picks) and np.isfinite(poses.center_world_m[frame, 0]):
                pixel[picks] = outlines.project_from(
                    result,
                    RowPoses(
                        poses.center_world_m[frame],
                        poses.world_from_camera[frame],
                        result.frames.sweep[frame],
                    ),
                    points,
                    adjusted_lens=adjusted,
                )
    return FramePicks(rows, seed, refined)


def rows_by_frame(result: Result) -> list[Ints]:
    """Return the rows of the picks of each frame, in their order."""
    names = {name: i for i, name in enumerate(result.frames.frame_id)}
    frame = np.array([names.get(image, -1) for image in result.picks.image], dtype=np.int64)
    # group the picks by frame: a stable sort, then the first row of each frame
    order = np.argsort(frame, kind="stable")
    edges = np.searchsorted(frame[order], np.arange(len(names) + 1))
    return [order[a:b] for a, b in pairwise(edges)]


CAMERA = "survey/current_camera"
PHOTO = f"{CAMERA}/photo"
PICTURE = f"{PHOTO}/picture"

# Depth of the frustum of a frame without a pose: too small to be seen.
HIDDEN_M = 1e-6

# Photos are sent a few at a time, so that a long flight is not in memory twice.
PHOTOS_PER_CHUNK = 8


def log_camera(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Log a pinhole camera that moves with time; it is invisibly small for a frame without a pose.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    """
    frames = result.frames
    posed = np.where(
        result.has_refined[:, None], frames.refined.center_world_m, frames.seed.center_world_m
    )
    turned = np.where(
        result.has_refined[:, None, None],
        frames.refined.world_from_camera,
        frames.seed.world_from_camera,
    )
    visible = np.isfinite(posed[:, 0])
    center = np.where(visible[:, None], posed, scene.middle_m)
    rotation = np.where(visible[:, None, None], turned, np.eye(3))
    recorder.poses(CAMERA, center, rotation)
    depth = np.where(visible, CURRENT_FRUSTUM * scene.frustum_m, HIDDEN_M)
    recorder.each(PHOTO, lambda some: rr.Pinhole.columns(image_plane_distance=depth[some]))
    size_px = result.camera.width_px, result.camera.height_px
    recorder.camera(PHOTO, result.shared.intrinsics.value, size_px)


def log_photos(
    recorder: Recorder, result: Result, photos: Iterable[tuple[str, Preview]]
) -> frozenset[int]:
    """Log JPEGs as they come, a few at a time; their scale maps them to original pixels.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    photos
        Frame names and reduced photos, in any order.

    Returns
    -------
    Rows of the frames whose photos are brightened for display.
    """
    row = {name: i for i, name in enumerate(result.frames.frame_id)}
    shown = np.zeros(len(row), dtype=np.float32)
    coming, brightened = iter(photos), set[int]()
    while some := {row[name]: photo for name, photo in islice(coming, PHOTOS_PER_CHUNK)}:
        shown[list(some)] = 1.0
        brightened |= {k for k, photo in some.items() if not photo.tone.is_identity}
        _log_some(recorder, some)
    if shown.any():
        recorder.static(
            PICTURE, rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=-10.0)
        )
        # a frame without a photo must not show that of the frame before
        recorder.each(PICTURE, lambda rows: rr.EncodedImage.columns(opacity=shown[rows]))
    return frozenset(brightened)


def _log_some(recorder: Recorder, photos: dict[int, Preview]) -> None:
    """Log photos by their frames' rows, and flush them from memory."""
    frames = np.array(sorted(photos), dtype=np.int64)
    recorder.rows(
        PICTURE,
        frames,
        lambda rows: rr.EncodedImage.columns(blob=[photos[i].jpeg for i in rows.tolist()]),
        lambda rows: rr.Transform3D.columns(scale=[[*photos[i].scale, 1.0] for i in rows.tolist()]),
    )
    recorder.stream.flush()


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
        recorder.lines_of_frames(f"{photo}/{FOUND_PICKS}/{name}", marks, style.FOUND, 1.5)


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
    recorder.dots_of_frames(f"{photo}/{SIGHTINGS}", dots, style.TIE, 1.2)


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
    places, texts, leaders, named = [], [], [], _format_heights(result)
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
    recorder.lines_of_frames(f"{photo}/{LEADERS}", leaders, style.OBSERVED, LEADER_WIDTH)
    recorder.dots_of_frames(f"{photo}/labels", places, style.OBSERVED, 0.0, texts)


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


def _format_heights(result: Result) -> dict[str, str]:
    """Return the text of each point off the ground, such as ``V21 +1.40 m``."""
    points, units = result.points, units_of(result)
    rows = np.flatnonzero(points.is_off_ground).tolist()
    heights = (format_length(points.height_above_ground_m[row], units, signed=True) for row in rows)
    labels = [points.label[row] for row in rows]
    return {label: f"{label} {height}" for label, height in zip(labels, heights, strict=True)}


# Parent of the rulers from the ground to points off it, by the source of their heights.
HEIGHTS = "heights"
# Rulers are short: their bend needs few samples.
RULER_SAMPLES, RULER_WIDTH = 9, 2.0
# So are the pieces of a footprint's border.
BORDER_SAMPLES = 7
NEIGHBOURS = "footprints_before_and_after"

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
    *(f"{HEIGHTS}/{source}" for source in style.HEIGHT_COLOURS),
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
    words = _log_shapes(recorder, result, scene, picks, photo)
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
    recorder.dots_of_frames(f"{photo}/name", [spot] * len(texts), style.OBSERVED, 0.0, texts)


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
        ("residual_exaggerated", where(fitted & ~bad), style.REFINED),
        ("residual_exaggerated_suspect", where(fitted & bad), style.BAD),
    ):
        recorder.lines_of_frames(f"{photo}/{name}", [list(arrows[r]) for r in rows], colour, 2.5)
    by_hand = result.picks.by_hand
    log_automatic_picks(recorder, result, picks, ~bad, photo)
    for name, at, rows, colour, size in (
        (
            "from_flight_log",
            picks.seed_px,
            where(result.camera.is_in_photo(picks.seed_px)),
            style.SEED,
            3.0,
        ),
        (
            "from_refined",
            picks.refined_px,
            where(result.camera.is_in_photo(picks.refined_px)),
            style.REFINED,
            2.5,
        ),
        ("picked", pixel, where(by_hand & ~bad), style.OBSERVED, 3.5),
        ("picked_suspect", pixel, where(bad), style.BAD, 6.0),
    ):
        recorder.dots_of_frames(f"{photo}/{name}", [at[r] for r in rows], colour, size)


@dataclass(frozen=True, eq=False)
class _Shape:
    """Shape to draw in every frame that sees it.

    Attributes
    ----------
    entity, colour
        Entity that it belongs to, and its colour.
    samples_m
        (n, 3) samples of one polyline in the world.
    text
        Its label, if any.
    ends
        Labels that must all be picked in a frame.
    frames
        Rows of the frames, if not all.
    width
        Width in points of the screen; by default many lines are drawn thinner.
    is_dashed
        Whether it is dashed, as contradicted measurements are.
    """

    entity: str
    colour: style.Rgb
    samples_m: Floats
    text: str = ""
    ends: frozenset[str] = frozenset()
    frames: frozenset[int] | None = None
    width: float | None = line_width(0)
    is_dashed: bool = False


def _shapes(result: Result, scene: Scene) -> Iterator[_Shape]:
    """Yield known lengths, suspect first; lines; measurements, the least certain first; others."""
    known, measured = reference_strips(result), measured_strips(result)
    for row in sorted(known, key=lambda i: result.lines.status[i] not in ("suspect", "removed")):
        status, samples = result.lines.status[row], outlines.sample_polyline(known[row])
        entity, text = f"known_lengths/{status}", reference_text(result, row)
        yield _Shape(entity, style.LINE_COLOURS[status], samples, text)
    lines = result.control_lines
    for name, status, strip in zip(lines.name, lines.status, position_strips(result), strict=True):
        entity = f"lines_of_known_position/{status}"
        yield _Shape(entity, style.LINE_COLOURS[status], outlines.sample_polyline(strip), name)
    for row in map(int, order_worst_first(result.measurements)):
        text, ends = measured_text(result, row), frozenset(result.measurements.points[row])
        standing = result.measurements.status[row]
        entity = f"measured/{standing}" if standing in ("doubtful", "contradicted") else "measured"
        if row in measured:
            yield _Shape(
                entity,
                style.MEASURED_COLOURS[standing],
                outlines.sample_polyline(measured[row]),
                text,
                ends,
                width=None,
                is_dashed=standing == "contradicted",
            )
    if scene.off_ground is not None:
        yield from _rulers(result, scene.off_ground)
    # borders of the ground that the photos before and after show
    rings = footprints(result)
    flown = [int(frame) for frame in outlines.flight_order(result) if int(frame) in rings]
    for k, frame in enumerate(flown):
        samples = outlines.sample_polyline(close_ring(rings[frame]), BORDER_SAMPLES)
        beside = frozenset([*flown[max(k - 1, 0) : k], *flown[k + 1 : k + 2]])
        yield _Shape(NEIGHBOURS, style.QUIET, samples, frames=beside, width=1.0)


def _rulers(result: Result, standing: OffGround) -> Iterator[_Shape]:
    """Yield the line from the ground to each point off it, which shows its height."""
    for foot, row, source in zip(standing.foot_m, standing.rows, standing.source, strict=True):
        ends = np.stack([foot, result.points.position_world_m[row]])
        yield _Shape(
            f"{HEIGHTS}/{source}",
            style.HEIGHT_COLOURS[source],
            outlines.sample_polyline(ends, RULER_SAMPLES),
            ends=frozenset([result.points.label[row]]),
            width=RULER_WIDTH,
        )


def _dash_line(pixel: Floats) -> Floats:
    """Return the (m, 2) samples of a polyline, every fourth one NaN."""
    return np.where(np.arange(len(pixel))[:, None] % 4 == 3, np.nan, pixel)


def _log_shapes(
    recorder: Recorder, result: Result, scene: Scene, picks: FramePicks, photo: str
) -> list[list[PhotoText]]:
    """Log the visible shapes.

    Returns
    -------
    The texts of the lines of each frame.
    """
    frames, shapes = range(len(result.frames.frame_id)), list(_shapes(result, scene))
    in_sight = outlines.VisiblePolylines(result, [shape.samples_m for shape in shapes])
    words: list[list[PhotoText]] = [[] for _ in frames]
    kinds = {shape.entity: shape for shape in shapes}
    runs: dict[str, list[list[Floats]]] = {entity: [[] for _ in frames] for entity in kinds}
    for frame in np.flatnonzero(result.has_refined).tolist():
        picked = {result.picks.label[row] for row in picks.rows[frame]}
        near = (shapes[row] for row in in_sight.of(frame))
        shown = [
            shape
            for shape in near
            if shape.ends <= picked and (shape.frames is None or frame in shape.frames)
        ]
        pixels = outlines.project_polylines(result, frame, [shape.samples_m for shape in shown])
        for shape, seen in zip(shown, pixels, strict=True):
            pieces = outlines.visible_runs(seen)
            runs[shape.entity][frame] += (
                outlines.visible_runs(_dash_line(seen)) if shape.is_dashed else pieces
            )
            if pieces and shape.text:
                longest = max(pieces, key=len)
                words[frame].append((longest[len(longest) // 2], shape.text))
    for shape in kinds.values():
        per_frame = runs[shape.entity]
        width = shape.width or line_width(max(map(len, per_frame)))
        recorder.lines_of_frames(f"{photo}/{shape.entity}", per_frame, shape.colour, width)
    return words

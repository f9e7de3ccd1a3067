"""What is drawn on the photo: residuals, projections, and lines bent as the lens bends them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result import Result
from uavgram.views.drawing import (
    in_photo,
    measured_strips,
    project_from,
    reference_strips,
    sampled,
    uncovered,
    visible_runs,
)
from uavgram.views.recording.frame_picks import FramePicks
from uavgram.views.recording.labels import (
    HALF_LETTER,
    LINE_HEIGHT,
    line_width,
    measured_text,
    reference_text,
)
from uavgram.views.recording.photo_marks import log_dots, log_polylines, log_texts
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import BAD, LINE_COLOURS, MEASURED, OBSERVED, REFINED, SEED, Rgb

# Pixel and text of a label.
Word = tuple[Floats, str]

# More labels than this hide the photo.
MOST_WORDS = 25

# What is drawn on the photo, by the name of its entity.
OVERLAYS = (
    "residual_exaggerated",
    "residual_exaggerated_suspect",
    "from_flight_log",
    "from_refined",
    "picked",
    "picked_suspect",
    "labels",
    "known_lengths",
    "measured",
)


def log_overlay(
    recorder: Recorder, result: Result, scene: Scene, picks: FramePicks, photo: str
) -> None:
    """Log all that is drawn on the photo, below the entity `photo`."""
    words = _lines(recorder, result, photo)
    _residuals(recorder, result, scene, picks, photo)
    _names(recorder, result, picks, words, photo)


def _residuals(
    recorder: Recorder, result: Result, scene: Scene, picks: FramePicks, photo: str
) -> None:
    pixel = result.picks.pixel_px
    status = np.array(result.picks.status, dtype=str)
    bad = np.isin(status, ("suspect", "removed"))
    fitted = np.isfinite(result.picks.residual_px[:, 0])
    tip = pixel + scene.residual_factor * np.nan_to_num(result.picks.residual_px)
    arrows = np.stack([pixel, tip], axis=1)

    def where(mask: Bools) -> list[Ints]:
        return [rows[mask[rows]] for rows in picks.rows]

    everything = np.ones(len(pixel), dtype=np.bool_)
    for name, rows, colour in (
        ("residual_exaggerated", where(fitted & ~bad), REFINED),
        ("residual_exaggerated_suspect", where(fitted & bad), BAD),
    ):
        log_polylines(recorder, f"{photo}/{name}", [list(arrows[r]) for r in rows], colour, 2.5)
    for name, at, rows, colour, size in (
        ("from_flight_log", picks.seed_px, where(in_photo(result, picks.seed_px)), SEED, 3.0),
        ("from_refined", picks.refined_px, where(in_photo(result, picks.refined_px)), REFINED, 2.5),
        ("picked", pixel, where(everything & ~bad), OBSERVED, 3.5),
        ("picked_suspect", pixel, where(bad), BAD, 6.0),
    ):
        log_dots(recorder, f"{photo}/{name}", [at[r] for r in rows], colour, size)


@dataclass(frozen=True, eq=False)
class _Shape:
    """A thing to draw in every frame that sees it: samples of one polyline in the world."""

    entity: str
    colour: Rgb
    text: str
    samples_m: Floats


def _shapes(result: Result) -> list[_Shape]:
    shapes = []
    for row, strip in reference_strips(result).items():
        status = result.lines.status[row]
        text = reference_text(result, row)
        entity = f"known_lengths/{status}"
        shapes.append(_Shape(entity, LINE_COLOURS[status], text, sampled(strip)))
    for row, strips in measured_strips(result).items():
        text = measured_text(result, row)
        shapes += [_Shape("measured", MEASURED, text, sampled(strip)) for strip in strips]
    return shapes


def _lines(recorder: Recorder, result: Result, photo: str) -> list[list[Word]]:
    """Known lengths and measurements, only where they are seen.

    Returns
    -------
    Per frame the texts that belong to them.
    """
    frames, shapes = range(len(result.frames.frame_id)), _shapes(result)
    words: list[list[Word]] = [[] for _ in frames]
    if not shapes:
        return words
    colours = {shape.entity: shape.colour for shape in shapes}
    runs: dict[str, list[list[Floats]]] = {name: [[] for _ in frames] for name in colours}
    samples = np.concatenate([shape.samples_m for shape in shapes])
    cuts = np.cumsum([len(shape.samples_m) for shape in shapes])[:-1]
    poses = result.frames.refined
    for frame in np.flatnonzero(result.has_refined):
        pixel = project_from(
            result, poses.center_world_m[frame], poses.world_from_camera[frame], samples
        )
        for shape, seen in zip(shapes, np.split(pixel, cuts), strict=True):
            pieces = visible_runs(seen)
            if pieces:
                runs[shape.entity][frame] += pieces
                longest = max(pieces, key=len)
                words[frame].append((longest[len(longest) // 2], shape.text))
    width = line_width(len(shapes))
    for name, per_frame in runs.items():
        log_polylines(recorder, f"{photo}/{name}", per_frame, colours[name], width)
    return words


def _names(
    recorder: Recorder, result: Result, picks: FramePicks, words: list[list[Word]], photo: str
) -> None:
    """Texts of the lines, then names of the points, as far as they do not cover each other."""
    width, height = result.camera.width_px, result.camera.height_px
    anchors, texts = [], []
    for rows, lines in zip(picks.rows, words, strict=True):
        every = [*lines, *((result.picks.pixel_px[p], result.picks.label[p]) for p in rows)]
        at = np.reshape([anchor for anchor, _ in every], (-1, 2))
        half_widths = HALF_LETTER * width * np.array([len(text) for _, text in every])
        kept = uncovered(at, half_widths, LINE_HEIGHT * height, MOST_WORDS)
        anchors.append(at[kept])
        texts.append([every[k][1] for k in kept])
    log_texts(recorder, f"{photo}/labels", anchors, texts)

"""One frame at a time: the photo in its original pixels, with everything drawn through the lens."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import rerun as rr

from uavgram.imaging.preview import Preview
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result import Result
from uavgram.views.drawing import (
    in_photo,
    longest_middle,
    measured_strips,
    point_index,
    project_from,
    reference_strips,
    sampled,
    uncovered,
    visible_runs,
)
from uavgram.views.recording.labels import (
    HALF_LETTER,
    LINE_HEIGHT,
    measured_text,
    reference_text,
)
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import BAD, LINE_COLOURS, MEASURED, OBSERVED, REFINED, SEED, Rgb

# Pixel and text of a label.
Word = tuple[Floats, str]

CAMERA = "survey/current_camera"
PHOTO = f"{CAMERA}/photo"

# More labels than this hide the photo.
MOST_WORDS = 25

# Depth of the frustum of a frame without a pose: too small to be seen.
HIDDEN_M = 1e-6

# Photos are sent a few at a time, so that a long flight does not lie in memory twice.
PHOTOS_PER_CHUNK = 8

# Rerun puts the corner of the first pixel at (0, 0), we its centre (DESIGN, Conventions).
CENTRE_PX = 0.5


@dataclass(frozen=True, eq=False)
class FramePicks:
    """Picks of each frame and where the poses put them.

    Attributes
    ----------
    rows
        Per frame (n,) rows of the picks.
    seed_px, refined_px
        (P, 2) projections of the adjusted point; NaN without a pose or outside the photo.
    """

    rows: list[Ints]
    seed_px: Floats
    refined_px: Floats


def project_picks(result: Result) -> FramePicks:
    """Project every picked point back into its frame, from both poses."""
    image = np.array(result.picks.image, dtype=str)
    at = point_index(result)
    known = np.array([at.get(label, -1) for label in result.picks.label], dtype=np.int64)
    rows = [np.flatnonzero(image == name) for name in result.frames.frame_id]
    seed = np.full((len(image), 2), np.nan)
    refined = np.full((len(image), 2), np.nan)
    for frame, in_frame in enumerate(rows):
        picks = in_frame[known[in_frame] >= 0]
        points = result.points.position_world_m[known[picks]]
        for poses, pixel, adjusted in (
            (result.frames.seed, seed, False),
            (result.frames.refined, refined, True),
        ):
            if len(picks) and np.isfinite(poses.center_world_m[frame, 0]):
                pixel[picks] = project_from(
                    result,
                    poses.center_world_m[frame],
                    poses.world_from_camera[frame],
                    points,
                    adjusted_lens=adjusted,
                )
    return FramePicks(rows, seed, refined)


def log_photos(
    recorder: Recorder,
    result: Result,
    scene: Scene,
    previews: Mapping[str, Preview],
    picks: FramePicks,
) -> None:
    """Log the moving camera, its photo and what is drawn on it."""
    _camera(recorder, result, scene)
    _previews(recorder, result, previews)
    words = _lines(recorder, result)
    _residuals(recorder, result, scene, picks)
    _names(recorder, result, picks, words)


def _camera(recorder: Recorder, result: Result, scene: Scene) -> None:
    """A pinhole that moves with time; where a frame has no pose, too small to be seen."""
    frames, count = result.frames, len(result.frames.frame_id)
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
    recorder.rows(
        CAMERA,
        np.arange(count),
        lambda some: [
            rr.Transform3D.columns(
                translation=center[some],
                # Rerun stores matrices by columns
                mat3x3=np.swapaxes(rotation[some], 1, 2).reshape(-1, 9),
            )
        ],
    )
    depth = np.where(visible, 1.8 * scene.frustum_m, HIDDEN_M)
    recorder.rows(
        PHOTO,
        np.arange(count),
        lambda some: [rr.Pinhole.columns(image_plane_distance=depth[some])],
    )
    fx, fy, cx, cy = result.shared.intrinsics.value[:4]
    recorder.static(
        PHOTO,
        rr.Pinhole.from_fields(
            image_from_camera=[[fx, 0, cx + CENTRE_PX], [0, fy, cy + CENTRE_PX], [0, 0, 1]],
            resolution=[result.camera.width_px, result.camera.height_px],
            camera_xyz=rr.ViewCoordinates.RDF,
            color=OBSERVED,
        ),
    )


def _previews(recorder: Recorder, result: Result, previews: Mapping[str, Preview]) -> None:
    """JPEGs as they are; the scale puts them back into original pixels."""
    names = result.frames.frame_id
    shown = np.array([i for i, name in enumerate(names) if name in previews], dtype=np.int64)
    path = f"{PHOTO}/picture"
    if not len(shown):
        return
    recorder.static(path, rr.EncodedImage.from_fields(media_type="image/jpeg", draw_order=-10.0))
    scales = np.array([[*previews[names[i]].scale, 1.0] for i in shown])
    recorder.rows(
        path,
        shown,
        lambda some: [rr.Transform3D.columns(scale=scales[np.searchsorted(shown, some)])],
    )
    for start in range(0, len(shown), PHOTOS_PER_CHUNK):
        recorder.rows(
            path,
            shown[start : start + PHOTOS_PER_CHUNK],
            lambda some: [rr.EncodedImage.columns(blob=[previews[names[i]].jpeg for i in some])],
        )


def _residuals(recorder: Recorder, result: Result, scene: Scene, picks: FramePicks) -> None:
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
        _polylines(recorder, f"{PHOTO}/{name}", [list(arrows[r]) for r in rows], colour, 2.5)
    for name, at, rows, colour, size in (
        ("from_flight_log", picks.seed_px, where(in_photo(result, picks.seed_px)), SEED, 3.0),
        ("from_refined", picks.refined_px, where(in_photo(result, picks.refined_px)), REFINED, 2.5),
        ("picked", pixel, where(everything & ~bad), OBSERVED, 3.5),
        ("picked_suspect", pixel, where(bad), BAD, 6.0),
    ):
        _dots(recorder, f"{PHOTO}/{name}", [at[r] for r in rows], colour, size)


def _lines(recorder: Recorder, result: Result) -> list[list[Word]]:
    """Known lengths and measurements, bent as the lens bends them, only where they are seen.

    Returns
    -------
    Per frame the texts that belong to them.
    """
    known, measured = reference_strips(result), measured_strips(result)
    groups: dict[str, tuple[Rgb, list[tuple[list[Floats], str]]]] = {}
    for row, strip in known.items():
        status = result.lines.status[row]
        entry = groups.setdefault(f"known_lengths/{status}", (LINE_COLOURS[status], []))
        entry[1].append(([strip], reference_text(result, row)))
    shapes = [(strips, measured_text(result, row)) for row, strips in measured.items() if strips]
    if shapes:
        groups["measured"] = (MEASURED, shapes)
    texts: list[list[Word]] = [[] for _ in result.frames.frame_id]
    for name, (colour, group) in groups.items():
        per_frame = []
        for frame in range(len(result.frames.frame_id)):
            runs, words = _seen(result, frame, group)
            per_frame.append(runs)
            texts[frame] += words
        _polylines(recorder, f"{PHOTO}/{name}", per_frame, colour, 3.0)
    return texts


def _names(recorder: Recorder, result: Result, picks: FramePicks, words: list[list[Word]]) -> None:
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
    _texts(recorder, f"{PHOTO}/labels", anchors, texts)


def _seen(
    result: Result, frame: int, group: list[tuple[list[Floats], str]]
) -> tuple[list[Floats], list[Word]]:
    """Visible pieces of polylines in one frame, and a text on the middle of each thing."""
    poses = result.frames.refined
    runs: list[Floats] = []
    words: list[Word] = []
    if not result.has_refined[frame]:
        return runs, words
    for strips, text in group:
        pieces = [
            run
            for strip in strips
            for run in visible_runs(
                project_from(
                    result,
                    poses.center_world_m[frame],
                    poses.world_from_camera[frame],
                    sampled(strip),
                )
            )
        ]
        if pieces:
            runs += pieces
            longest = max(pieces, key=len)
            words.append((longest_middle([longest[[0, -1]]]), text))
    return runs, words


def _polylines(
    recorder: Recorder, path: str, per_frame: list[list[Floats]], colour: Rgb, width: float
) -> None:
    radius = rr.Radius.ui_points(width / 2)
    recorder.static(path, rr.LineStrips2D.from_fields(colors=colour, radii=radius))
    _batches(
        recorder,
        path,
        [len(strips) for strips in per_frame],
        lambda some: rr.LineStrips2D.columns(
            strips=[strip + CENTRE_PX for i in some for strip in per_frame[i]]
        ),
    )


def _dots(recorder: Recorder, path: str, per_frame: list[Floats], colour: Rgb, size: float) -> None:
    radius = rr.Radius.ui_points(size)
    recorder.static(path, rr.Points2D.from_fields(colors=colour, radii=radius))
    _batches(
        recorder,
        path,
        [len(pixel) for pixel in per_frame],
        lambda some: rr.Points2D.columns(
            positions=np.concatenate([per_frame[i] for i in some]) + CENTRE_PX
        ),
    )


def _texts(
    recorder: Recorder,
    path: str,
    anchors: list[Floats],
    texts: list[list[str]],
) -> None:
    """White texts without a dot."""
    recorder.static(
        path,
        rr.Points2D.from_fields(colors=OBSERVED, radii=rr.Radius.ui_points(0.0), show_labels=True),
    )
    _batches(
        recorder,
        path,
        [len(words) for words in texts],
        lambda some: rr.Points2D.columns(
            positions=np.concatenate([anchors[i] for i in some]) + CENTRE_PX,
            labels=[text for i in some for text in texts[i]],
        ),
    )


def _batches(
    recorder: Recorder,
    path: str,
    lengths: list[int],
    columns: Callable[[Ints], rr.ComponentColumnList],
) -> None:
    """One row per frame, an empty one too: it wipes out what the frame before has drawn."""
    counts = np.array(lengths, dtype=np.int64)
    if counts.any():
        recorder.rows(
            path,
            np.arange(len(counts)),
            lambda some: [columns(some).partition(counts[some])],
        )

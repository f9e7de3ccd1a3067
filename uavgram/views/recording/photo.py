"""One frame at a time: the moving camera, its photo, its picks and their projections."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
import rerun as rr

from uavgram.geometry.ground.row_projection import RowPoses
from uavgram.imaging.photos.preview import Preview
from uavgram.model.arrays import Floats, Ints
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import point_index
from uavgram.views.recording.scene import CURRENT_FRUSTUM, Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.survey.outlines import project_from


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
                pixel[picks] = project_from(
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

"""Points, lines and texts on the photo: one row per frame, in original pixels."""

from __future__ import annotations

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.views.recording.stream import Columns, Recorder
from uavgram.views.style import OBSERVED, Rgb

# Rerun puts the corner of the first pixel at (0, 0), this program its centre.
CENTRE_PX = 0.5


def log_camera_poses(
    recorder: Recorder, path: str, center_m: Floats, world_from_camera: Floats
) -> None:
    """Log the pose of the camera of each frame.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    center_m, world_from_camera
        (F, 3) and (F, 3, 3), world from camera.
    """
    recorder.each(
        path,
        lambda some: rr.Transform3D.columns(
            translation=center_m[some],
            # Rerun stores matrices by columns
            mat3x3=np.swapaxes(world_from_camera[some], 1, 2).reshape(-1, 9),
        ),
    )


def log_polylines(
    recorder: Recorder, path: str, per_frame: list[list[Floats]], colour: Rgb, width: float
) -> None:
    """Log polylines on the photo, different ones in each frame.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    per_frame
        (F,) lists of (n, 2) polylines in original pixels.
    colour
        Colour of all lines.
    width
        Width in points of the screen.
    """
    radius = rr.Radius.ui_points(width / 2)
    recorder.static(path, rr.LineStrips2D.from_fields(colors=colour, radii=radius))
    log_batches(
        recorder,
        path,
        [len(strips) for strips in per_frame],
        lambda some: rr.LineStrips2D.columns(
            strips=_packed([strip for i in some for strip in per_frame[i]])
        ),
    )


def _packed(strips: list[Floats]) -> rr.components.LineStrip2DArrayLike:
    """Pack all polylines into one array; Rerun needs a tenth of a millisecond for each."""
    corners = np.concatenate([np.zeros((0, 2)), *strips]) + CENTRE_PX
    pairs = rr.components.Position2DBatch(corners).as_arrow_array()
    ends = np.cumsum([0, *(len(strip) for strip in strips)])
    none = rr.components.LineStrip2DBatch([]).as_arrow_array()
    packed: rr.components.LineStrip2DArrayLike
    packed = type(none).from_arrays(ends, pairs, type=none.type)
    return packed


def log_dots(
    recorder: Recorder, path: str, per_frame: list[Floats], colour: Rgb, size: float
) -> None:
    """Log dots on the photo, different ones in each frame.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    per_frame
        (F,) arrays (n, 2) of original pixels.
    colour
        Colour of all dots.
    size
        Radius in points of the screen.
    """
    radius = rr.Radius.ui_points(size)
    recorder.static(path, rr.Points2D.from_fields(colors=colour, radii=radius))
    log_batches(
        recorder,
        path,
        [len(pixel) for pixel in per_frame],
        lambda some: rr.Points2D.columns(
            positions=np.concatenate([per_frame[i] for i in some]) + CENTRE_PX
        ),
    )


def log_texts(recorder: Recorder, path: str, anchors: list[Floats], texts: list[list[str]]) -> None:
    """Log white texts on the photo, different ones in each frame.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    anchors
        (F,) arrays (n, 2) of original pixels.
    texts
        (F,) lists of n texts.
    """
    recorder.static(
        path,
        rr.Points2D.from_fields(colors=OBSERVED, radii=rr.Radius.ui_points(0.0), show_labels=True),
    )
    log_batches(
        recorder,
        path,
        [len(words) for words in texts],
        lambda some: rr.Points2D.columns(
            positions=np.concatenate([anchors[i] for i in some]) + CENTRE_PX,
            labels=[text for i in some for text in texts[i]],
        ),
    )


def log_batches(recorder: Recorder, path: str, lengths: list[int], columns: Columns) -> None:
    """Log one row per frame; an empty row clears the drawing of the frame before.

    Parameters
    ----------
    recorder
        The open recording.
    path
        Path of the entity.
    lengths
        (F,) number of objects in each frame.
    columns
        Function that makes the rows of the objects in some frames.
    """
    counts = np.array(lengths, dtype=np.int64)
    if counts.any():
        recorder.each(path, lambda some: columns(some).partition(counts[some]))

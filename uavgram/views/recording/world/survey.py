"""Survey in 3-D: ground, flight, footprints, lines and points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import rerun as rr

from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PoseTable
from uavgram.stages.products.map_layers import (
    footprints,
    measured_strips,
    position_strips,
    reference_strips,
)
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.view_texts import log_in_space
from uavgram.views.recording.world.labels import MANY_LINES, line_width, survey_labels
from uavgram.views.recording.world.points import log_departures, log_points
from uavgram.views.style import (
    FRAME_COLOURS,
    LINE_COLOURS,
    MEASURED,
    MEASURED_COLOURS,
    MEASURED_QUIET,
    OBSERVED,
    QUIET,
    REFINED,
    SEED,
    Rgb,
)
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.outlines import (
    frusta,
    sample_polyline,
    track,
)

ALL = "survey/footprints"
CURRENT = "survey/footprint_of_this_photo"


def log_footprints(recorder: Recorder, result: Result) -> None:
    """Log all borders on the ground, and that of each frame."""
    rings = {frame: close_border(ring) for frame, ring in footprints(result).items()}
    if not rings:
        return
    recorder.lines(ALL, list(rings.values()), QUIET, 0.8)
    strips = [[rings[k]] if k in rings else [] for k in range(len(result.frames.frame_id))]
    recorder.lines_of_frames(CURRENT, strips, OBSERVED, 1.6)


def close_border(ring: Floats) -> Floats:
    """Close a border: (v + 1, 3), with its first corner repeated."""
    return np.concatenate([ring, ring[:1]])


# Corners of the mesh that carries the mosaic, in pixels of the mosaic.
MESH_CELL_PX = 8
# States of frames that are drawn once more, and the words for their paths.
ODD_FRAMES = {"check": "to_check", "rejected": "rejected"}


def log_survey(
    recorder: Recorder, result: Result, scene: Scene, texture: GroundTexture | None
) -> None:
    """Log all static objects.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    texture
        Top view of the ground; None if no photo shows it.
    """
    recorder.static("survey", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if texture is not None:
        recorder.static("survey/ground", _ground(result, texture, scene))
    _flight(recorder, result, scene, "survey/flight_log", result.frames.seed, SEED)
    _flight(recorder, result, scene, "survey/refined", result.frames.refined, REFINED)
    _odd_frames(recorder, result, scene)
    _reference_lines(recorder, result)
    labels, named = survey_labels(result, scene)
    _measured(recorder, result, named)
    log_in_space(recorder, "survey/labels", labels)
    if result.points.label:
        log_points(recorder, result, scene)
    if scene.uneven is not None:
        log_departures(recorder, result, scene, scene.uneven)


def _flight(
    recorder: Recorder, result: Result, scene: Scene, path: str, poses: PoseTable, colour: Rgb
) -> None:
    centers = track(result, poses)
    if not len(centers):
        return
    if len(centers) > 1:
        recorder.lines(f"{path}/track", [centers], colour, 2.0)
    cameras = frusta(result, poses, scene.frustum_m)
    recorder.lines(f"{path}/cameras", cameras, colour, 0.9)


def _odd_frames(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Log frames that deserve a second look once more, in their own colour."""
    states = np.array(frame_states(result), dtype=str)
    for state, poses in (("check", result.frames.refined), ("rejected", result.frames.seed)):
        cameras = frusta(result, _only(poses, states == state), scene.frustum_m)
        path = f"survey/frames_{ODD_FRAMES[state]}"
        recorder.lines(path, cameras, FRAME_COLOURS[state], 2.5)


def _only(poses: PoseTable, rows: Bools) -> PoseTable:
    return replace(poses, center_world_m=np.where(rows[:, None], poses.center_world_m, np.nan))


def _measured(recorder: Recorder, result: Result, named: frozenset[int]) -> None:
    """Log labelled lines thick; if there are many, the others are thin and of a dull colour.

    Doubtful and contradicted measurements have a colour and an entity of their own.
    """
    strips, status = measured_strips(result), result.measurements.status
    total = sum(len(some) for some in strips.values())
    for doubt in ("doubtful", "contradicted"):
        own = [strip for row in strips if status[row] == doubt for strip in strips[row]]
        if doubt == "contradicted":
            own = [dash for strip in own for dash in _dashes(strip)]
        colour, width = MEASURED_COLOURS[doubt], line_width(total)
        recorder.lines(f"survey/measured/{doubt}", own, colour, width)
    strips = {row: s for row, s in strips.items() if status[row] in ("ok", "not-checked")}
    bold = [strip for row in named for strip in strips.get(row, [])]
    quiet = [strip for row, some in strips.items() if row not in named for strip in some]
    recorder.lines("survey/measured/least_certain", bold, MEASURED, 3.5)
    colour = MEASURED if total <= MANY_LINES else MEASURED_QUIET
    recorder.lines("survey/measured/others", quiet, colour, line_width(total))


def _reference_lines(recorder: Recorder, result: Result) -> None:
    by_status: dict[str, list[Floats]] = {}
    for row, strip in reference_strips(result).items():
        by_status.setdefault(result.lines.status[row], []).append(strip)
    for status, strips in by_status.items():
        dashed = [dash for strip in strips for dash in _dashes(strip)]
        drawn = dashed if status == "checked" else strips
        recorder.lines(f"survey/known_lengths/{status}", drawn, LINE_COLOURS[status], 5.0)
    by_status.clear()
    for strip, status in zip(position_strips(result), result.control_lines.status, strict=True):
        by_status.setdefault(status, []).append(strip)
    for status, strips in by_status.items():
        path = f"survey/lines_of_known_position/{status}"
        recorder.lines(path, strips, LINE_COLOURS[status], 2.0)


def _dashes(strip: Floats, count: int = 15) -> list[Floats]:
    """Return every other piece of a polyline's segments, as a dashed line."""
    return list(sample_polyline(strip, 2 * count).reshape(-1, 2, 3))


def _ground(result: Result, texture: GroundTexture, scene: Scene) -> rr.Mesh3D:
    """Make a mesh of the mosaic on the plane, without the cells that no photo shows."""
    height, width = texture.covered.shape
    rows, columns = height // MESH_CELL_PX, width // MESH_CELL_PX
    cells = texture.covered[: rows * MESH_CELL_PX, : columns * MESH_CELL_PX]
    blocks = cells.reshape(rows, MESH_CELL_PX, columns, MESH_CELL_PX)
    row, column = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    east = texture.west_m + column * MESH_CELL_PX * texture.pixel_size_m
    north = texture.north_m - row * MESH_CELL_PX * texture.pixel_size_m
    spots = np.stack([east, north], axis=-1)
    up = result.plane.height_at(spots) - scene.ground_drop_m
    # two triangles for each cell that the mosaic covers completely
    i, j = np.nonzero(blocks.all(axis=(1, 3)))
    first = i * (columns + 1) + j
    below = first + columns + 1
    triangles = np.concatenate(
        [
            np.stack([first, below, first + 1], axis=-1),
            np.stack([first + 1, below, below + 1], axis=-1),
        ]
    )
    # texture coordinates of the corners, 0 to 1
    share = np.stack([column * MESH_CELL_PX / width, row * MESH_CELL_PX / height], axis=-1)
    return rr.Mesh3D(
        vertex_positions=np.concatenate([spots, up[..., None]], axis=-1).reshape(-1, 3),
        triangle_indices=triangles,
        vertex_texcoords=share.reshape(-1, 2),
        albedo_texture=texture.rgb,
    )

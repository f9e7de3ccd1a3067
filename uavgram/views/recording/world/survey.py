"""The survey in 3-D: ground, flight, lines and points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import rerun as rr

from uavgram.imaging.photos.preview import Pixels
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PoseTable
from uavgram.stages.products.map_layers import ellipse_outlines, measured_strips, reference_strips
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.world.heights import MOST_ELLIPSOIDS, log_heights
from uavgram.views.recording.world.labels import MANY_LINES, Labels, line_width, survey_labels
from uavgram.views.style import (
    FRAME_COLOURS,
    LINE_COLOURS,
    MEASURED,
    MEASURED_QUIET,
    OBSERVED,
    REFINED,
    SEED,
    Rgb,
    scale_colours,
)
from uavgram.views.survey.departures import Departures
from uavgram.views.survey.drawing import frusta, round_length, track
from uavgram.views.survey.frame_states import frame_states
from uavgram.views.wording import size_text

# Outlines are heavy on the viewer.
MOST_OUTLINES = 5_000
# Corners of the mesh that carries the mosaic, in pixels of the mosaic.
MESH_CELL_PX = 8
# Rerun hides the labels of larger batches by itself; say so from here on.
MOST_POINT_LABELS = 30
# Labels float a little above what they name.
LABEL_LIFT = 0.05
# States of frames that are drawn once more, and the words for their paths.
ODD_FRAMES = {"check": "to_check", "rejected": "rejected"}
# Flat ellipsoids: half a millimetre of height keeps them from flickering with the ground.
FLAT_M = 1e-3
# The least certain point from near by: a bar to compare its ellipse with, at true scale, south of
# the point, in half axes of the ellipse.
CLOSE_UP = "close_up"
BAR_BELOW = 1.6
# Of the bars that say how far the ground lies off its plane, in points of the screen.
BAR_WIDTH = 4.0


def log_survey(
    recorder: Recorder, result: Result, scene: Scene, texture: GroundTexture | None
) -> None:
    """Log everything that stands still.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Of the run.
    scene
        Sizes that the pictures are scaled by.
    texture
        Top view of the ground; None where no photo shows it.
    """
    recorder.static("survey", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    if texture is not None:
        recorder.static("survey/ground", _ground(result, texture, scene))
    _flight(recorder, result, scene, "survey/flight_log", result.frames.seed, SEED)
    _flight(recorder, result, scene, "survey/refined", result.frames.refined, REFINED)
    _odd_frames(recorder, result, scene)
    _reference_lines(recorder, result)
    labels = survey_labels(result, scene)
    _measured(recorder, result, labels)
    if labels.text:
        lift = np.array([0.0, 0.0, LABEL_LIFT * scene.size_m])
        recorder.static("survey/labels", _texts(labels.anchor_m + lift, labels.text))
    if result.points.label:
        _points(recorder, result, scene)
    if scene.uneven is not None:
        _departures(recorder, result, scene, scene.uneven)


def log_close_up(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Log a bar of a round length beside the ellipse of the least certain point.

    Of a point off the ground the ellipse too: elsewhere it has an ellipsoid.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Of the run.
    scene
        Sizes that the pictures are scaled by.
    """
    if scene.worst_point is None:
        return
    major = float(result.points.relative.ellipse_95_m[scene.worst_point, 0])
    length = round_length(2 * major)
    middle = result.points.position_world_m[scene.worst_point] - [0.0, BAR_BELOW * major, 0.0]
    ends = middle + np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * length
    recorder.static(
        f"{CLOSE_UP}/scale_bar",
        rr.LineStrips3D(
            [ends],
            colors=OBSERVED,
            radii=rr.Radius.ui_points(2.0),
            labels=[size_text(length)],
            show_labels=True,
        ),
    )
    if result.points.is_off_ground[scene.worst_point]:
        colours = scale_colours(sigma_shares(result)[0])
        worst = np.array([scene.worst_point])
        recorder.static(f"{CLOSE_UP}/ellipse_95", _flat_ellipses(result, worst, colours))


def _flat_ellipses(result: Result, rows: Ints, colours: Pixels) -> rr.Ellipsoids3D:
    """Within the survey, of some points, at true size."""
    within = result.points.relative
    return rr.Ellipsoids3D(
        centers=result.points.position_world_m[rows],
        half_sizes=np.column_stack([within.ellipse_95_m[rows], np.full(len(rows), FLAT_M)]),
        quaternions=_yaw_quaternions(within.ellipse_azimuth_rad[rows]),
        colors=colours[rows],
        fill_mode="solid",
    )


def has_outlines(result: Result) -> bool:
    """Whether enlarged ellipses are drawn; more points than that are coloured themselves."""
    return len(result.points.label) <= MOST_OUTLINES


def sigma_shares(result: Result) -> tuple[Floats, float, float]:
    """(K,) place of each point's semi-major axis on a scale, and the ends of the scale [m].

    Of the ellipses within the survey: those on the earth all have the receiver's bias in common
    and would have one colour. The scale reaches from the smallest to the largest, and at least
    from half the largest: what is nearly equal has nearly the same colour.
    """
    major = result.points.relative.ellipse_95_m[:, 0]
    high = float(major.max())
    low = min(float(major.min()), high / 2)
    share = (major - low) / max(high - low, 1e-12)
    return share, low, high


def _flight(
    recorder: Recorder, result: Result, scene: Scene, path: str, poses: PoseTable, colour: Rgb
) -> None:
    centers = track(result, poses)
    if not len(centers):
        return
    if len(centers) > 1:
        recorder.static(f"{path}/track", _strips([centers], colour, 2.0))
    cameras = frusta(result, poses, scene.frustum_m)
    recorder.static(f"{path}/cameras", _strips(cameras, colour, 0.9))


def _odd_frames(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Frames that deserve a look once more, in their own colour: where to look."""
    states = np.array(frame_states(result), dtype=str)
    for state, poses in (("check", result.frames.refined), ("rejected", result.frames.seed)):
        cameras = frusta(result, _only(poses, states == state), scene.frustum_m)
        if len(cameras):
            path = f"survey/frames_{ODD_FRAMES[state]}"
            recorder.static(path, _strips(cameras, FRAME_COLOURS[state], 2.5))


def _only(poses: PoseTable, rows: Bools) -> PoseTable:
    return replace(poses, center_world_m=np.where(rows[:, None], poses.center_world_m, np.nan))


def _measured(recorder: Recorder, result: Result, labels: Labels) -> None:
    """Labelled lines stand out; where there are many, the others are thin and quiet."""
    strips = measured_strips(result)
    total = sum(len(some) for some in strips.values())
    bold = [strip for row in labels.measured for strip in strips[row]]
    quiet = [strip for row, some in strips.items() if row not in labels.measured for strip in some]
    if bold:
        recorder.static("survey/measured/least_certain", _strips(bold, MEASURED, 3.5))
    if quiet:
        colour = MEASURED if total <= MANY_LINES else MEASURED_QUIET
        recorder.static("survey/measured/others", _strips(quiet, colour, line_width(total)))


def _reference_lines(recorder: Recorder, result: Result) -> None:
    by_status: dict[str, list[Floats]] = {}
    for row, strip in reference_strips(result).items():
        by_status.setdefault(result.lines.status[row], []).append(strip)
    for status, strips in by_status.items():
        dashed = [dash for strip in strips for dash in _dashes(strip)]
        recorder.static(
            f"survey/known_lengths/{status}",
            _strips(dashed if status == "checked" else strips, LINE_COLOURS[status], 5.0),
        )


def _dashes(strip: Floats, count: int = 15) -> list[Floats]:
    """Every other piece of a segment: withheld lines did not hold anything together."""
    at = strip[0] + np.linspace(0, 1, 2 * count)[:, None] * (strip[1] - strip[0])
    return list(at.reshape(count, 2, 3))


def _points(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Dots, names, and ellipses within the survey: those on the earth are in the tables."""
    points, position, within = result.points, result.points.position_world_m, result.points.relative
    colours = scale_colours(sigma_shares(result)[0])
    few = len(points.label) <= MOST_POINT_LABELS
    log_heights(recorder, result, scene, colours)
    recorder.static(
        "survey/points/picked",
        rr.Points3D(
            position,
            radii=rr.Radius.ui_points(2.0 if few else 1.0),
            colors=OBSERVED if has_outlines(result) else colours,
            labels=points.label,
            show_labels=False,
        ),
    )
    grounded = np.flatnonzero(~points.is_off_ground)
    for start in range(0, len(grounded), MOST_ELLIPSOIDS):
        part = grounded[start : start + MOST_ELLIPSOIDS]
        recorder.static(
            f"survey/points/ellipse_95_true_size/{start // MOST_ELLIPSOIDS}",
            _flat_ellipses(result, part, colours),
        )
    if has_outlines(result):
        outlines = ellipse_outlines(
            position[:, :2], within.ellipse_95_m, within.ellipse_azimuth_rad, scene.ellipse_factor
        )
        height = np.broadcast_to(
            position[:, None, 2:] + 0.001 * scene.size_m, (*outlines.shape[:2], 1)
        )
        recorder.static(
            "survey/points/ellipse_95_exaggerated",
            _strips(np.concatenate([outlines, height], axis=-1), colours, 1.3),
        )
    if few:
        recorder.static("survey/point_names", _texts(position, points.label))


def _departures(recorder: Recorder, result: Result, scene: Scene, uneven: Departures) -> None:
    """Bars on the ground, as tall as it lies off its plane: red above the plane, blue below.

    All stand up: what hangs down is hidden by the ground.
    """
    position = result.points.position_world_m[uneven.rows].copy()
    position[:, 2] -= np.nan_to_num(result.points.height_above_ground_m[uneven.rows])
    height = scene.departure_factor * np.abs(uneven.value_m)
    top = position + height[:, None] * [0.0, 0.0, 1.0]
    bars = np.stack([position, top], axis=1)
    recorder.static("survey/points/off_plane", _strips(bars, uneven.colours, BAR_WIDTH))


def _yaw_quaternions(azimuth_rad: Floats) -> Floats:
    """(K, 4) xyzw: turn the x axis to an azimuth (clockwise from north), about up."""
    half = (np.pi / 2 - azimuth_rad) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


def _strips(strips: Floats | list[Floats], colour: Rgb | Pixels, width: float) -> rr.LineStrips3D:
    single = (
        np.asarray(strips, dtype=np.float32) if isinstance(strips, np.ndarray) else list(strips)
    )
    return rr.LineStrips3D(single, colors=colour, radii=rr.Radius.ui_points(width / 2))


def _texts(position: Floats, texts: tuple[str, ...]) -> rr.Points3D:
    """White texts without a dot: coloured text is hard to read over photos."""
    return rr.Points3D(
        position, radii=rr.Radius.ui_points(0.0), colors=OBSERVED, labels=texts, show_labels=True
    )


def _ground(result: Result, texture: GroundTexture, scene: Scene) -> rr.Mesh3D:
    """The mosaic on the plane, without the cells that no photo shows."""
    height, width = texture.covered.shape
    rows, columns = height // MESH_CELL_PX, width // MESH_CELL_PX
    cells = texture.covered[: rows * MESH_CELL_PX, : columns * MESH_CELL_PX]
    blocks = cells.reshape(rows, MESH_CELL_PX, columns, MESH_CELL_PX)
    row, column = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    east = texture.west_m + column * MESH_CELL_PX * texture.pixel_size_m
    north = texture.north_m - row * MESH_CELL_PX * texture.pixel_size_m
    spots = np.stack([east, north], axis=-1)
    up = result.plane.height_at(spots) - scene.ground_drop_m
    i, j = np.nonzero(blocks.all(axis=(1, 3)))
    first = i * (columns + 1) + j
    below = first + columns + 1
    triangles = np.concatenate(
        [
            np.stack([first, below, first + 1], axis=-1),
            np.stack([first + 1, below, below + 1], axis=-1),
        ]
    )
    share = np.stack([column * MESH_CELL_PX / width, row * MESH_CELL_PX / height], axis=-1)
    return rr.Mesh3D(
        vertex_positions=np.concatenate([spots, up[..., None]], axis=-1).reshape(-1, 3),
        triangle_indices=triangles,
        vertex_texcoords=share.reshape(-1, 2),
        albedo_texture=texture.rgb,
    )

"""Picked points in 3-D: names, ellipses, heights with ellipsoids, departures of the ground."""

from __future__ import annotations

import numpy as np

from uavgram.geometry.motion.rotation import xyzw_from_matrix
from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Bools, Floats
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource, TieCloud
from uavgram.stages.products.map_layers import ellipse_outlines
from uavgram.views.recording.labels import height_labels, log_in_space, place_in_space
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import HEIGHT_COLOURS, OBSERVED, TIE_FAINT, Rgb, scale_colours
from uavgram.views.survey.heights import Departures, OffGround, height_of
from uavgram.views.units import round_bar, units_of

# Outlines slow the viewer down.
MAX_OUTLINES = 5_000
# Rerun hides the labels of larger batches itself; from this number on it is done explicitly.
MAX_POINT_LABELS = 30
# Flat ellipsoids: half a millimetre of height keeps them from flickering with the ground.
FLAT_M = 1e-3
# Close-up of the least certain point: a bar to compare with its ellipse, at true scale, south of
# the point, in half axes of the ellipse.
CLOSE_UP = "close_up"
BAR_BELOW = 1.6
# Width of the bars for departures of the ground from its plane, in points of the screen.
BAR_WIDTH = 4.0


def has_outlines(result: Result) -> bool:
    """Return whether enlarged ellipses are drawn; with more points, the points are coloured."""
    return len(result.points.label) <= MAX_OUTLINES


def sigma_shares(result: Result) -> tuple[Floats, float, float]:
    """Scale the (K,) semi-major axes of points to 0 to 1; return shares and scale ends [m].

    The axes are those of the ellipses within the survey: those on the earth all share the
    receiver's bias and would have one colour. The scale is from the smallest to the largest, and
    at least from half the largest: nearly equal values have nearly the same colour.
    """
    major = result.points.relative.ellipse_95_m[:, 0]
    high = float(major.max())
    low = min(float(major.min()), high / 2)
    share = (major - low) / max(high - low, 1e-12)
    return share, low, high


def log_points(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Log dots, names, and ellipses within the survey; ellipses on the earth are in the tables.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    """
    points, position, within = result.points, result.points.position_world_m, result.points.relative
    colours = scale_colours(sigma_shares(result)[0])
    few = len(points.label) <= MAX_POINT_LABELS
    log_heights(recorder, result, scene, colours)
    recorder.dots(
        "survey/points/picked",
        position,
        OBSERVED if has_outlines(result) else colours,
        2.0 if few else 1.0,
        points.label,
    )
    _log_flat_ellipses(
        recorder, "survey/points/ellipse_95_true_size", result, ~points.is_off_ground
    )
    if has_outlines(result):
        outlines = ellipse_outlines(
            position[:, :2], within.ellipse_95_m, within.ellipse_azimuth_rad, scene.ellipse_factor
        )
        height = np.broadcast_to(
            position[:, None, 2:] + 0.001 * scene.size_m, (*outlines.shape[:2], 1)
        )
        rings = np.concatenate([outlines, height], axis=-1)
        recorder.lines("survey/points/ellipse_95_exaggerated", rings, colours, 1.3)
    if few:
        names = place_in_space(scene.top_eye, position, points.label, dots_m=position)
        log_in_space(recorder, "survey/point_names", names)


def log_tie_points(recorder: Recorder, ties: TieCloud) -> None:
    """Log a faint cloud of tie points: an entity of its own, which can be switched off."""
    recorder.dots("survey/tie_points", ties.position_world_m, TIE_FAINT, 0.7)


def log_departures(recorder: Recorder, result: Result, scene: Scene, uneven: Departures) -> None:
    """Log bars for departures of the ground from its plane: red above it, blue below it.

    All bars point up, as the ground would hide bars that point down.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    uneven
        Departures of the ground from its plane.
    """
    position = result.points.position_world_m[uneven.rows].copy()
    position[:, 2] -= np.nan_to_num(result.points.height_above_ground_m[uneven.rows])
    height = scene.departure_factor * np.abs(uneven.value_m)
    top = position + height[:, None] * [0.0, 0.0, 1.0]
    bars = np.stack([position, top], axis=1)
    recorder.lines("survey/points/off_plane", bars, uneven.colours, BAR_WIDTH)


def log_close_up(recorder: Recorder, result: Result, scene: Scene) -> None:
    """Log a bar of a round length beside the ellipse of the least certain point.

    For a point off the ground, which elsewhere has an ellipsoid, the ellipse is logged too.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    """
    if scene.worst_point is None:
        return
    major = float(result.points.relative.ellipse_95_m[scene.worst_point, 0])
    length, words = round_bar(2 * major, units_of(result))
    middle = result.points.position_world_m[scene.worst_point] - [0.0, BAR_BELOW * major, 0.0]
    ends = middle + np.array([[-0.5, 0, 0], [0.5, 0, 0]]) * length
    recorder.lines(f"{CLOSE_UP}/scale_bar", [ends], OBSERVED, 4.0, [words], is_labelled=True)
    spot = result.points.position_world_m[[scene.worst_point]]
    recorder.texts(f"{CLOSE_UP}/name", spot, [result.points.label[scene.worst_point]])
    worst = np.arange(len(result.points.label)) == scene.worst_point
    own = worst & result.points.is_off_ground
    _log_flat_ellipses(recorder, f"{CLOSE_UP}/ellipse_95", result, own)


def _log_flat_ellipses(recorder: Recorder, path: str, result: Result, which: Bools) -> None:
    """Log the ellipses of some points within the survey, at true size."""
    within, colours = result.points.relative, scale_colours(sigma_shares(result)[0])
    rows = np.flatnonzero(which)
    recorder.ellipsoids(
        path,
        result.points.position_world_m[rows],
        np.column_stack([within.ellipse_95_m[rows], np.full(len(rows), FLAT_M)]),
        _yaw_quaternions(within.ellipse_azimuth_rad[rows]),
        colours[rows],
    )


def _yaw_quaternions(azimuth_rad: Floats) -> Floats:
    """Return (K, 4) xyzw quaternions that turn x to an azimuth (clockwise from north), about up."""
    # half of the counterclockwise angle from east
    half = (np.pi / 2 - azimuth_rad) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


RULERS = "survey/points/heights"
ELLIPSOIDS = "survey/points/ellipsoid_95"
SIDE_TEXTS = "from_the_side/heights"
# In points of the screen.
RULER_WIDTH = 2.5


def log_heights(recorder: Recorder, result: Result, scene: Scene, colours: Pixels) -> None:
    """Log rulers, ellipsoids and texts that show heights and their accuracy.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    scene
        Extent of the scene, from which drawings are scaled.
    colours
        (K, 3) colours of all points' ellipses.
    """
    standing = scene.off_ground
    if standing is None or scene.side_eye is None:
        return
    for source, colour in HEIGHT_COLOURS.items():
        _rulers(recorder, result, standing, source, colour)
    _ellipsoids(recorder, result, standing, "true_size", 1, colours)
    if scene.ellipsoid_factor > 1:
        _ellipsoids(recorder, result, standing, "exaggerated", scene.ellipsoid_factor, colours)
    log_in_space(recorder, SIDE_TEXTS, height_labels(result, scene, scene.side_eye))


def _rulers(
    recorder: Recorder, result: Result, standing: OffGround, source: HeightSource, colour: Rgb
) -> None:
    """Log the ruler from the ground to each point; its label under the pointer is the height."""
    which = standing.of(source)
    points, rows = result.points, standing.rows[which]
    rulers = np.stack([standing.foot_m[which], points.position_world_m[rows]], axis=1)
    words = [f"{points.label[row]} {height_of(points, row)}" for row in rows.tolist()]
    recorder.lines(f"{RULERS}/{source}", rulers, colour, RULER_WIDTH, words)


def _ellipsoids(
    recorder: Recorder,
    result: Result,
    standing: OffGround,
    size: str,
    factor: int,
    colours: Pixels,
) -> None:
    known = np.flatnonzero(standing.half_axes_m[:, 0] > 0)
    rows = standing.rows[known]
    recorder.ellipsoids(
        f"{ELLIPSOIDS}_{size}",
        result.points.position_world_m[rows],
        factor * standing.half_axes_m[known],
        xyzw_from_matrix(standing.directions[known]),
        colours[rows],
        is_solid=False,
    )

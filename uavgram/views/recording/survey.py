"""Survey in 3-D and on a map: ground, flight, footprints, lines, points and profiles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import rerun as rr

from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.imaging.top_view.mosaic import GroundTexture
from uavgram.model.arrays import Bools, Floats
from uavgram.model.maps import close_ring
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PoseTable
from uavgram.stages.products.map_layers import (
    footprints,
    ground_lines,
    measured_strips,
)
from uavgram.views import style
from uavgram.views.recording.labels import (
    MANY_LINES,
    line_width,
    log_in_space,
    place_texts,
    places_below,
    survey_labels,
)
from uavgram.views.recording.points import log_departures, log_points
from uavgram.views.recording.scene import Scene
from uavgram.views.recording.stream import Recorder
from uavgram.views.survey.drawing import Drawing
from uavgram.views.survey.heights import LEFT, WIDTH, ProfileDrawing, profile_drawings
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.outlines import (
    frusta,
    sample_polyline,
    track,
)

REFERENCES = {
    "known_lengths": ("known_lengths", 5.0, 4.0),
    "control_lines": ("lines_of_known_position", 2.0, 2.0),
}
"""Entities of known lines by their layers, and widths in space and on the map."""

ALL = "survey/footprints"
CURRENT = "survey/footprint_of_this_photo"


def log_footprints(recorder: Recorder, result: Result) -> None:
    """Log all borders on the ground, and that of each frame."""
    rings = {frame: close_ring(ring) for frame, ring in footprints(result).items()}
    if not rings:
        return
    recorder.lines(ALL, list(rings.values()), style.QUIET, 0.8)
    strips = [[rings[k]] if k in rings else [] for k in range(len(result.frames.frame_id))]
    recorder.lines_of_frames(CURRENT, strips, style.OBSERVED, 1.6)


# Dashes of each segment of a dashed line.
DASHES = 15
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
    _flight(recorder, result, scene, "survey/flight_log", result.frames.seed, style.SEED)
    _flight(recorder, result, scene, "survey/refined", result.frames.refined, style.REFINED)
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
    recorder: Recorder, result: Result, scene: Scene, path: str, poses: PoseTable, colour: style.Rgb
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
        recorder.lines(path, cameras, style.FRAME_COLOURS[state], 2.5)


def _only(poses: PoseTable, rows: Bools) -> PoseTable:
    return replace(poses, center_world_m=np.where(rows[:, None], poses.center_world_m, np.nan))


def _measured(recorder: Recorder, result: Result, named: frozenset[int]) -> None:
    """Log labelled lines thick; if there are many, the others are thin and of a dull colour.

    Doubtful and contradicted measurements have a colour and an entity of their own.
    """
    strips, status = measured_strips(result), result.measurements.status
    total = len(strips)
    for doubt in ("doubtful", "contradicted"):
        own = [strip for row, strip in strips.items() if status[row] == doubt]
        if doubt == "contradicted":
            own = [dash for strip in own for dash in _dashes(strip)]
        colour, width = style.MEASURED_COLOURS[doubt], line_width(total)
        recorder.lines(f"survey/measured/{doubt}", own, colour, width)
    strips = {row: s for row, s in strips.items() if status[row] in ("ok", "not-checked")}
    bold = [strips[row] for row in named if row in strips]
    quiet = [strip for row, strip in strips.items() if row not in named]
    recorder.lines("survey/measured/least_certain", bold, style.MEASURED, 3.5)
    colour = style.MEASURED if total <= MANY_LINES else style.MEASURED_QUIET
    recorder.lines("survey/measured/others", quiet, colour, line_width(total))


def _reference_lines(recorder: Recorder, result: Result) -> None:
    """Log known lines, each status apart; lengths that are withheld as checks are dashed."""
    drawn: dict[tuple[str, str], list[Floats]] = {}
    for layer, status, strip in ground_lines(result):
        if layer in REFERENCES:
            is_dashed = layer == "known_lengths" and status == "checked"
            drawn.setdefault((layer, status), []).extend(_dashes(strip) if is_dashed else [strip])
    for (layer, status), strips in drawn.items():
        entity, width, _ = REFERENCES[layer]
        recorder.lines(f"survey/{entity}/{status}", strips, style.LINE_COLOURS[status], width)


def _dashes(strip: Floats) -> list[Floats]:
    """Return every other piece of a polyline's segments, as a dashed line."""
    return list(sample_polyline(strip, 2 * DASHES).reshape(-1, 2, 3))


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


MAP = "map"


def log_map(recorder: Recorder, result: Result) -> None:
    """Log flight, footprints, points and lines in latitude and longitude (double precision)."""
    world, points = result.world, result.points
    origin = world.origin
    if origin is None or not has_map(result):
        return

    def on_earth(strip: Floats) -> Floats:
        latitude, longitude, _ = geodetic_from_enu(strip, origin)
        return np.column_stack([latitude, longitude])

    def log_lines(name: str, strips: list[Floats], colours: list[style.Rgb], width: float) -> None:
        if strips:
            lat_lon = [on_earth(strip) for strip in strips]
            radii = rr.Radius.ui_points(width / 2)
            lines = rr.GeoLineStrings(lat_lon=lat_lon, radii=radii, colors=colours)
            recorder.static(f"{MAP}/{name}", lines)

    borders = [close_ring(ring) for ring in footprints(result).values()]
    log_lines("footprints", borders, [style.QUIET] * len(borders), 1.0)
    for name, poses, colour in (
        ("flight_log", result.frames.seed, style.SEED),
        ("refined", result.frames.refined, style.REFINED),
    ):
        centers = track(result, poses)
        log_lines(name, [centers] if len(centers) > 1 else [], [colour], 2.0)
    measured = list(measured_strips(result).values())
    log_lines("measured", measured, [style.MEASURED] * len(measured), line_width(len(measured)))
    for layer, (entity, _, width) in REFERENCES.items():
        known = [line for line in ground_lines(result) if line.layer == layer]
        colours = [style.LINE_COLOURS[line.status] for line in known]
        log_lines(entity, [line.strip for line in known], colours, width)
    lat_lon = np.column_stack([points.latitude_deg, points.longitude_deg])
    dots = rr.GeoPoints(
        lat_lon=lat_lon[np.isfinite(lat_lon[:, 0])],
        radii=rr.Radius.ui_points(3.0),
        colors=style.OBSERVED,
    )
    recorder.static(f"{MAP}/points", dots)


def has_map(result: Result) -> bool:
    """Return whether the survey has a place on the earth, and points to show there."""
    return result.world.gauge == "world" and bool(np.isfinite(result.points.latitude_deg).any())


def log_origin(recorder: Recorder, result: Result) -> None:
    """Log the origin of the local world among the recording's properties."""
    world = result.world
    place = {} if world.origin is None else world.origin._asdict()
    values = rr.AnyValues(gauge=world.gauge, height_datum=world.height_datum, **place)
    recorder.stream.send_property("survey", values)


PROFILES = "profiles"
# The view opens on as many as fit into this height; the others are below.
MAX_SHOWN = 600.0
# Rerun's letters and lines, in units of the drawing.
HALF_LETTER, LINE, HALF_DOT = 4.5, 24.0, 3.0
TITLE_UP, BAR_UP, NUMBER_AT = 6.0, 8.0, 26.0
GAP = 36.0

LINES: tuple[tuple[str, style.Rgb, float], ...] = (
    ("grid", style.QUIET, 0.5),
    ("ground", style.GROUND, 2.0),
    ("line", style.MEASURED, 2.0),
    ("rulers", style.FREE, 1.0),
    ("bars", style.SPREAD, 3.0),
)
"""Lines of a drawing, with their colours and widths on the screen."""


def opening_height(result: Result) -> float:
    """Return the height of the drawings on which the view opens."""
    heights = np.cumsum([one.drawing.height + GAP for one in profile_drawings(result)])
    return float(heights[heights <= max(MAX_SHOWN, heights[0])][-1])


def log_profiles(recorder: Recorder, result: Result) -> None:
    """Log all profiles, if there are any."""
    drawings = profile_drawings(result)
    if not drawings:
        return
    tops = np.cumsum([0.0, *(one.drawing.height + GAP for one in drawings[:-1])])
    both = list(zip(drawings, tops.tolist(), strict=True))

    for name, colour, width in LINES:
        lines = [_lower(line, top) for one, top in both for line in one.drawing.find_shapes(name)]
        if name == "grid":
            lines += [_scale_bar(one.drawing, top) for one, top in both]
        recorder.lines(f"{PROFILES}/{name}", lines, colour, width)
    dots = [_lower(dot[0], top) for one, top in both for dot in one.drawing.find_shapes("points")]
    recorder.dots(f"{PROFILES}/points", dots, style.OBSERVED, 3.0)
    words = [(at, text, line) for one, top in both for at, text, line in _words(one, top)]
    leaders = [line for _, _, line in words if np.isfinite(line[0, 0])]
    recorder.lines(f"{PROFILES}/texts/lines", leaders, style.QUIET, 1.0)
    recorder.texts(f"{PROFILES}/texts", [at for at, _, _ in words], [text for _, text, _ in words])


def _lower(places: Floats, top: float) -> Floats:
    """Shift the (..., 2) places of one drawing to below the drawings before it."""
    return np.asarray(places + np.array([0.0, top]))


def _scale_bar(drawing: Drawing, top: float) -> Floats:
    below = top + drawing.height - BAR_UP
    return np.array([[LEFT, below], [LEFT + drawing.bar, below]])


def _words(one: ProfileDrawing, top: float) -> Iterator[tuple[Floats, str, Floats]]:
    """Yield title, length of the bar, heights of the level lines, and the names that have room.

    Each has the place (2,) below which it is written, and the (2, 2) line to it, NaN if none.
    """
    drawing, factor = one.drawing, one.exaggeration
    scale = "to one scale" if factor == 1 else f"heights {factor} times too large"
    levels = [line[0, 1] for line in drawing.find_shapes("grid")]
    fixed = [
        ((WIDTH / 2, -TITLE_UP), f"{one.name}: 95 % intervals, {scale}"),
        ((LEFT + drawing.bar / 2, drawing.height + BAR_UP), drawing.bar_text),
        *(((NUMBER_AT, y), text) for y, text in zip(levels, one.levels, strict=True)),
    ]
    tops = [
        (bar[0], text) for bar, text in zip(drawing.find_shapes("bars"), one.labels, strict=True)
    ]
    words = [*fixed, *tops]
    dots = np.concatenate(drawing.find_shapes("points"))
    placed = place_texts(
        np.array([at for at, _ in words]),
        [text for _, text in words],
        np.array([HALF_LETTER, LINE / 2]),
        (np.array([0.0, -GAP]), np.array([WIDTH, drawing.height + GAP])),
        np.column_stack([dots, np.tile([HALF_DOT, HALF_DOT, 0.0], (len(dots), 1))]),
        ranks=[-1] * len(fixed) + list(range(len(tops))),
    )
    hung = places_below(placed)
    for k, (_, text) in enumerate(words):
        if np.isfinite(hung[k, 0]):
            ends = np.stack([placed.leaders[k, 0], hung[k]])
            yield _lower(hung[k], top), text, _lower(ends, top)

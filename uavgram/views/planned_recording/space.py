"""Plan in space: accuracy on the ground, photos in the air, lines to lay out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr

from uavgram.imaging.photos.preview import Pixels
from uavgram.model.arrays import Floats
from uavgram.model.naming import Units
from uavgram.model.planned import FlightPlanned
from uavgram.stages.products.planned_layers import grid_cells, wanted_shapes
from uavgram.views.planned.numbers import centimetres, metres
from uavgram.views.recording.eye import Eye
from uavgram.views.recording.scene import FRUSTUM_SHARE, SPACING_SHARE, TO_THE_EYE
from uavgram.views.recording.stream import Recorder
from uavgram.views.recording.view_texts import log_in_space, place_in_space
from uavgram.views.recording.world.footprint_marks import closed
from uavgram.views.recording.world.marks import polylines
from uavgram.views.style import (
    BAD,
    MEASURED,
    OBSERVED,
    QUIET,
    REFERENCE,
    REFINED,
    scale_colours,
)
from uavgram.views.survey.drawing import corner_rays, longest_middle, pyramids
from uavgram.views.unit_words import in_units

SPACE = "plan"
NAMES, FLAT_NAMES = f"{SPACE}/names", f"{SPACE}/names_from_above"

DIM = 0.6
_DROP = 1e-3
"""Offset of the map below the objects on it, as a share of the size of the scene."""
FROM_ABOVE = 1.15
"""Distance of the eye above the area, relative to the size of the area."""


@dataclass(frozen=True, eq=False)
class PlanScene:
    """Extent of the scene, from which drawings are scaled.

    Attributes
    ----------
    size_m
        Size of the area.
    frusta_m
        (F, 10, 3) frusta of all photos.
    eye, top_eye
        Eye of the first view, which shows area, lines and photos; of the view from above.
    """

    size_m: float
    frusta_m: Floats
    eye: Eye
    top_eye: Eye


def measure_plan(planned: FlightPlanned) -> PlanScene:
    """Measure the extent of a plan."""
    frames, lines, camera = planned.frames, planned.lines, planned.camera
    area = planned.area_world_m
    size = float(np.ptp(area, axis=0).max())
    steps = np.linalg.norm(np.diff(frames.center_world_m, axis=0), axis=1)
    # as deep as frusta of other recordings, but visible even for a single photo
    depth = 2.0 * FRUSTUM_SHARE * planned.flight.height_m
    if len(steps):
        depth = min(depth, SPACING_SHARE * float(np.median(steps)))
    rays = depth * corner_rays(camera.parameters, camera.width_px, camera.height_px)
    frusta = pyramids(frames.center_world_m, frames.world_from_camera, rays)
    shown = [area, lines.start_world_m, lines.end_world_m, frusta.reshape(-1, 3)]
    above = Eye(np.array([0.0, 0.0, 1.0]), area.mean(axis=0), FROM_ABOVE * size)
    return PlanScene(size, frusta, Eye.fitting(np.concatenate(shown), TO_THE_EYE), above)


def log_plan(recorder: Recorder, planned: FlightPlanned, scene: PlanScene, units: Units) -> None:
    """Log all static objects, and the photo of the timeline.

    Parameters
    ----------
    recorder
        The open recording; its frames are the photos of the plan.
    planned
        The plan.
    scene
        Extent of the scene.
    units
        Units of the names.
    """
    recorder.static(SPACE, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    _ground(recorder, planned, scene)
    _flight(recorder, planned, scene)
    lines = planned.lines
    strips = np.stack([lines.start_world_m, lines.end_world_m], axis=1)
    if len(strips):
        recorder.static(f"{SPACE}/lines_to_lay", polylines(strips, REFERENCE, 5.0))
    if planned.plates.name:
        rings = [closed(ring) for ring in planned.plates.corner_world_m]
        recorder.static(f"{SPACE}/plates_to_lay", polylines(rings, REFERENCE, 5.0))
    wanted = [strip for some in wanted_shapes(planned) for strip in some]
    if wanted:
        recorder.static(f"{SPACE}/wanted", polylines(wanted, MEASURED, 3.0))
    if planned.points.label:
        dots = rr.Points3D(planned.points.world_m, colors=MEASURED, radii=rr.Radius.ui_points(3.5))
        recorder.static(f"{SPACE}/points", dots)
    _names(recorder, planned, scene, units)


def accuracy_range(planned: FlightPlanned) -> tuple[float, float] | None:
    """Return the best and worst standard deviation of the map; None if nothing can be measured."""
    known = planned.grid.sigma_m[np.isfinite(planned.grid.sigma_m)]
    return (float(known.min()), float(known.max())) if len(known) else None


def map_colours(share: Floats) -> Pixels:
    """Return (N, 3) dim colours of the map, from the best (0) to the worst (1), as a background."""
    return (DIM * scale_colours(share)).astype(np.uint8)


def _ground(recorder: Recorder, planned: FlightPlanned, scene: PlanScene) -> None:
    area = [closed(planned.area_world_m)]
    recorder.static(f"{SPACE}/area", polylines(area, OBSERVED, 2.0))
    if planned.no_go_world_m:
        rings = [closed(ring) for ring in planned.no_go_world_m]
        recorder.static(f"{SPACE}/keep_out", polylines(rings, BAD, 4.0))
    reach = accuracy_range(planned)
    if reach is None:
        return
    low, high = reach
    known = np.isfinite(planned.grid.sigma_m)
    share = (planned.grid.sigma_m[known] - low) / max(high - low, 1e-12)
    corners = grid_cells(planned)[known] - np.array([0.0, 0.0, _DROP * scene.size_m])
    first = 4 * np.arange(len(corners))[:, None]
    triangles = np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])])
    recorder.static(
        f"{SPACE}/accuracy",
        rr.Mesh3D(
            vertex_positions=corners.reshape(-1, 3),
            triangle_indices=triangles,
            vertex_colors=np.repeat(map_colours(share), 4, axis=0),
        ),
    )


def _flight(recorder: Recorder, planned: FlightPlanned, scene: PlanScene) -> None:
    frames = planned.frames
    if len(frames.name) > 1:
        way = [frames.center_world_m]
        recorder.static(f"{SPACE}/flight", polylines(way, REFINED, 1.5))
    recorder.static(f"{SPACE}/photos", polylines(scene.frusta_m, REFINED, 1.5))
    rings = [closed(ring) for ring in frames.footprint_world_m]
    recorder.static(f"{SPACE}/footprints", polylines(rings, QUIET, 0.8))
    _one_by_one(recorder, f"{SPACE}/this_photo", list(scene.frusta_m), 3.0)
    _one_by_one(recorder, f"{SPACE}/footprint_of_this_photo", rings, 2.0)


def _one_by_one(recorder: Recorder, path: str, strips: list[Floats], width: float) -> None:
    """Log one white polyline for each photo."""
    radius = rr.Radius.ui_points(width / 2)
    recorder.static(path, rr.LineStrips3D.from_fields(colors=OBSERVED, radii=radius))
    recorder.each(path, lambda some: rr.LineStrips3D.columns(strips=[strips[k] for k in some]))


def _named(planned: FlightPlanned, units: Units) -> tuple[list[Floats], list[str]]:
    """Return (3,) places on the ground and their names, the most important first."""
    lines, rows = planned.lines, planned.measurements
    places = list((lines.start_world_m + lines.end_world_m) / 2)
    words = [
        f"{name} {in_units(metres(float(length)), units)}"
        for name, length in zip(lines.name, lines.length_m, strict=True)
    ]
    places += list(planned.plates.center_world_m)
    words += list(planned.plates.name)
    for name, sigma, unit, strips in zip(
        rows.name, rows.sigma, rows.unit, wanted_shapes(planned), strict=True
    ):
        if strips:
            places.append(longest_middle(strips))
            known = f" ± {in_units(centimetres(float(sigma)), units)}" if unit == "m" else ""
            words.append(f"{name}{known}")
    places += [ring.mean(axis=0) for ring in planned.no_go_world_m]
    words += ["keep out"] * len(planned.no_go_world_m)
    places += list(planned.area_world_m)
    words += [f"corner {k}" for k in range(1, len(planned.area_world_m) + 1)]
    return places, words


def _names(recorder: Recorder, planned: FlightPlanned, scene: PlanScene, units: Units) -> None:
    """Log separate names for both views, as their free space differs."""
    places, words = _named(planned, units)
    frames, points = planned.frames, planned.points.world_m
    above = np.array(places)
    log_in_space(recorder, FLAT_NAMES, place_in_space(scene.top_eye, above, words, dots_m=points))
    placed = place_in_space(
        scene.eye,
        np.concatenate([above, frames.center_world_m]),
        [*words, *frames.name],
        dots_m=np.concatenate([points, frames.center_world_m]),
    )
    log_in_space(recorder, NAMES, placed)

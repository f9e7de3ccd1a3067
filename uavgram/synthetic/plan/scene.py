"""Scene of a plan in world axes, from a scenario with a section `plan:`, and its wanted values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.ground.figures import (
    find_long_axis,
    mark_crossing_segments,
    mark_points_inside,
    orient_counterclockwise,
    squares_on_plane,
)
from uavgram.geometry.ground.measurements import polygon_self_intersects
from uavgram.io.area_file import Area, AreaFile, read_areas
from uavgram.model.arrays import Bools, Floats, FrozenArrays, Ints
from uavgram.model.camera import Calibration
from uavgram.model.observations import MeasurementRequest
from uavgram.model.options import (
    GroundOptions,
    MountOptions,
    Project,
    TapeOptions,
    TelemetryOptions,
)
from uavgram.model.planned import Corners, PlanRequest
from uavgram.synthetic.observations import MeanGenerator
from uavgram.synthetic.scenario import PlateSpec, Scenario, Site
from uavgram.synthetic.scenario_file import explain_impossible, read_scenario_camera
from uavgram.synthetic.survey import make_calibration, make_project
from uavgram.synthetic.truth import draw_surface


@dataclass(frozen=True, kw_only=True)
class LoggedAccuracy:
    """Accuracy of the logged pose of each photo, without the errors common to the flight.

    `position_sigma_m` is horizontal and vertical, `attitude_sigma_deg` of roll and pitch, and yaw.
    """

    position_sigma_m: tuple[float, float] = (0.5, 0.8)
    attitude_sigma_deg: tuple[float, float] = (1.0, 2.0)
    mount: MountOptions = field(default_factory=MountOptions)
    telemetry: TelemetryOptions = field(default_factory=TelemetryOptions)


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """Deviation of the drone from the plan: standard deviations of each axis."""

    position_m: float = 2.0
    attitude_deg: float = 1.8


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanScene(FrozenArrays):
    """Scene to be measured.

    Attributes
    ----------
    calibration
        Of the camera.
    height_m, slope, pivot_m
        The ground: height at the pivot (2,), d up / d east and d up / d north (2,).
    area_m
        (V, 2) corners, counterclockwise.
    no_go_m
        Polygons (v, 2).
    label, point_m
        (K,), (K, 2) of the points to be measured.
    requests
        Requested measurements.
    ground, tape
        Priors of ground and tape; the ground's height is `height_m` there too.
    plates
        Size of possible plates, and sigmas of size and corners.
    logged
        The log; None: there is none.
    picks_sigma_px, tape_sigma_m
        Of picks and readings.
    deviation
        Of the flight from the plan.
    """

    calibration: Calibration
    height_m: float = 0.0
    slope: Annotated[Floats, 2] = field(default_factory=lambda: np.zeros(2))
    pivot_m: Annotated[Floats, 2] = field(default_factory=lambda: np.zeros(2))
    area_m: Annotated[Floats, "v", 2]
    no_go_m: tuple[Floats, ...] = ()
    label: Annotated[tuple[str, ...], "k"] = ()
    point_m: Annotated[Floats, "k", 2] = field(default_factory=lambda: np.zeros((0, 2)))
    requests: tuple[MeasurementRequest, ...] = ()
    ground: GroundOptions = field(default_factory=GroundOptions)
    tape: TapeOptions = field(default_factory=TapeOptions)
    plates: PlateSpec = field(default_factory=PlateSpec)
    logged: LoggedAccuracy | None = field(default_factory=LoggedAccuracy)
    picks_sigma_px: float = 0.7
    tape_sigma_m: float = 0.01
    deviation: Deviation = field(default_factory=Deviation)

    def on_ground(self, east_north_m: Floats) -> Floats:
        """Return (..., 3) points on the ground at (..., 2)."""
        up = self.height_m + (east_north_m - self.pivot_m) @ self.slope
        return np.concatenate([east_north_m, up[..., None]], axis=-1)

    def plates_at(self, east_north_m: Floats) -> Floats:
        """Return (N, 4, 3) corners of plates centred at (N, 2), along the area's longer side."""
        _, axis, _ = find_long_axis(self.area_m)
        turn = np.full(len(east_north_m), np.arctan2(axis[1], axis[0]))
        middle = self.on_ground(east_north_m)
        return squares_on_plane(middle, self.slope, turn, self.plates.side_m)


MAX_SITE_DISTANCE_M = 5000.0
"""Distance from the scenario's site beyond which an area is at another site [m]."""

MIN_WIDTH_M = 0.3


def get_site(site: Site, request: PlanRequest, file: AreaFile | None, path: Path) -> Site:
    """Return the scenario's site, or that of the area if its file is at another site.

    Parameters
    ----------
    site, request
        Of the scenario.
    file
        Of the area; None: it is given in metres.
    path
        The scenario, for messages.
    """
    if file is None:
        return site
    middle = file.areas[0].longitude_latitude_deg.mean(axis=0)
    away = np.linalg.norm(convert_to_map(middle[None], site)[0])
    if away <= MAX_SITE_DISTANCE_M:
        return site
    if np.linalg.norm(convert_to_map(middle[None, ::-1], site)[0]) <= MAX_SITE_DISTANCE_M:
        raise InputError(
            path.parent / str(request.area),
            "has latitude and longitude in the wrong order: GeoJSON and KML have the longitude "
            "first",
        )
    by_place = any(not isinstance(one, str) for each in request.wanted for one in each.points)
    if by_place or (request.no_go and not isinstance(request.no_go, str)):
        raise InputError(
            path,
            f"the area is {away / 1000:.0f} km from the scenario's site, so the places that are "
            "given in metres are wrong: write latitude_deg and longitude_deg of `site:`",
        )
    return replace(
        site,
        latitude_deg=float(middle[1]),
        longitude_deg=float(middle[0]),
        scene_east_m=0.0,
        scene_north_m=0.0,
    )


def convert_to_map(longitude_latitude_deg: Floats, site: Site) -> Floats:
    """Convert longitude and latitude to (N, 2) east and north [m]."""
    longitude, latitude = longitude_latitude_deg.T
    height = site.height_msl_m + site.undulation_m
    origin = (site.latitude_deg, site.longitude_deg, height)
    return enu_from_geodetic(latitude, longitude, height, origin)[:, :2]


def get_area(request: PlanRequest, file: AreaFile | None, site: Site, path: Path) -> Floats:
    """Return the (V, 2) corners of the area.

    Parameters
    ----------
    request
        Of the scenario.
    file
        Of the area; None: it is given in metres.
    site
        Position of the world.
    path
        The scenario, for messages.

    Raises
    ------
    InputError
        They enclose no ground, or the outline crosses itself.
    """
    if file is None:
        assert not isinstance(request.area, str)  # noqa: S101  (else there is a file)
        return _polygon(_in_world(request.area, site), "plan.area", path)
    named = [one for one in file.areas if not _is_no_go(one)]
    where = path.parent / str(request.area)
    if len(named) != 1:
        raise InputError(
            where,
            f"holds {len(named)} polygons for the area: leave one, and name the others `no-go` or "
            "put them into a file of their own (plan: no_go)",
        )
    return _polygon(convert_to_map(named[0].longitude_latitude_deg, site), "the area", where)


def _in_world(corners: Corners, site: Site) -> Floats:
    """Convert points in the scene's axes to (N, 2) east and north; N may be 0."""
    return site.in_world(np.array(corners, dtype=np.float64).reshape(-1, 2))


def _polygon(corner: Floats, what: str, path: Path) -> Floats:
    if len(corner) > 1 and np.allclose(corner[0], corner[-1], atol=1e-6):
        corner = corner[:-1]
    if len(corner) < 3 or _width(corner) < MIN_WIDTH_M:
        raise InputError(
            path,
            f"{what} encloses no ground ({len(corner)} different corners): give at least three "
            "that do not lie in one line, one after the other around it",
        )
    if polygon_self_intersects(corner):
        raise InputError(
            path, f"the outline of {what} crosses itself: give its corners one after the other"
        )
    return orient_counterclockwise(corner)


def _width(corner: Floats) -> float:
    """Return the spread of corners across their best-fitting line [m]."""
    return float(np.linalg.svd(corner - corner.mean(axis=0), compute_uv=False).min())


def _is_no_go(area: Area) -> bool:
    return area.name.casefold().replace("-", "").replace("_", "").replace(" ", "") == "nogo"


def list_no_go(request: PlanRequest, site: Site, path: Path) -> tuple[Floats, ...]:
    """Return the no-go polygons: of their own file, of the area's, or in metres.

    Parameters
    ----------
    request, site
        Of the scenario; position of the world.
    path
        The scenario: names of files are relative to it.
    """
    found: list[Floats] = []
    for name, only in ((request.area, True), (request.no_go, False)):
        if isinstance(name, str):
            where = path.parent / name
            found += [
                _polygon(convert_to_map(one.longitude_latitude_deg, site), "a no-go polygon", where)
                for one in read_areas(where).areas
                if _is_no_go(one) or not only
            ]
    if not isinstance(request.no_go, str):
        found += [_polygon(_in_world(one, site), "plan.no_go", path) for one in request.no_go]
    return tuple(found)


class Asked(NamedTuple):
    """Request for a plan, resolved to world axes.

    Attributes
    ----------
    scene
        In the world's axes.
    request
        Request for the plan.
    site
        The scenario's, or that of the area's file.
    """

    scene: PlanScene
    request: PlanRequest
    site: Site


def read_scene(scenario: Scenario, path: Path) -> Asked:
    """Read the inputs of a plan, and convert them to the world's axes.

    Parameters
    ----------
    scenario, path
        The scenario and its file, to which other files' names are relative.

    Raises
    ------
    InputError
        There is no section `plan`, or its area, its points or a file are wrong.
    """
    request = scenario.plan
    if request is None:
        raise InputError(
            path,
            "has no section `plan:` with the area to plan for: add `plan: {area: [[-20, -15], "
            "[20, -15], [20, 15], [-20, 15]]}`, the corners of the scene in metres, or `plan: "
            "{area: area.kml}`",
        )
    file = read_areas(path.parent / request.area) if isinstance(request.area, str) else None
    site = get_site(scenario.site, request, file, path)
    area = get_area(request, file, site, path)
    no_go = list_no_go(request, site, path)
    surface = draw_surface(replace(scenario, site=site), MeanGenerator())
    places = _places(scenario, file, site)
    requests, label, point = _list_requests(request, places, site, path)
    project = make_project(scenario)
    scene = PlanScene(
        calibration=read_scenario_camera(path, scenario.camera)
        or make_calibration(scenario.camera),
        height_m=surface.height_m + float((area.mean(axis=0) - surface.middle_m) @ surface.slope),
        slope=surface.slope,
        pivot_m=area.mean(axis=0),
        area_m=area,
        no_go_m=no_go,
        label=label,
        point_m=point,
        requests=requests,
        ground=replace(project.ground, roughness_sigma_m=request.roughness_m),
        tape=project.tape,
        plates=scenario.plates,
        logged=None if project.log is None else _get_log_accuracy(project),
        picks_sigma_px=project.picks_sigma_px,
        tape_sigma_m=scenario.errors.tape_m,
        deviation=Deviation(position_m=request.deviation_m, attitude_deg=request.deviation_deg),
    )
    return Asked(scene, request, site)


def _get_log_accuracy(project: Project) -> LoggedAccuracy:
    """Return the stated accuracy of the project's log, with defaults for each photo."""
    stated, usual = project.telemetry, LoggedAccuracy()
    position, attitude = stated.position_sigma_m, stated.attitude_sigma_deg
    return LoggedAccuracy(
        position_sigma_m=usual.position_sigma_m if position == "auto" else position,
        attitude_sigma_deg=usual.attitude_sigma_deg if attitude == "auto" else attitude,
        mount=project.mount,
        telemetry=replace(stated, position_sigma_m="auto", attitude_sigma_deg="auto"),
    )


def _places(scenario: Scenario, file: AreaFile | None, site: Site) -> dict[str, Floats]:
    """Return east and north of all labelled points."""
    xy = _in_world(tuple((one.x_m, one.y_m) for one in scenario.points), site)
    places = dict(zip((one.label for one in scenario.points), xy, strict=True))
    if file is not None and file.label:
        at = convert_to_map(file.longitude_latitude_deg, site)
        places |= dict(zip(file.label, at, strict=True))
    return places


def _list_requests(
    request: PlanRequest, places: dict[str, Floats], site: Site, path: Path
) -> tuple[tuple[MeasurementRequest, ...], tuple[str, ...], Floats]:
    """Return the requests, and labels and positions of their points."""
    label: dict[str, Floats] = {}
    requests = []
    for wanted in request.wanted:
        names = []
        for number, one in enumerate(wanted.points, start=1):
            if not isinstance(one, str):
                name, at = f"{wanted.name} {number}", _in_world((one,), site)[0]
            elif one in places:
                name, at = one, places[one]
            else:
                hint = suggest_spelling(one, places)
                raise InputError(
                    path,
                    f"plan.wanted: {wanted.name!r} names the point {one!r}, which is nowhere"
                    f"{f' ({hint})' if hint else ''}: add it to `points:`, or give its place as "
                    "[x, y]",
                )
            label[name] = at
            names.append(name)
        asked = MeasurementRequest(
            name=wanted.name, kind=wanted.kind, points=tuple(names), parameters=wanted.parameters
        )
        if fault := explain_impossible(asked):
            raise InputError(path, f"plan.wanted: {fault}")
        requests.append(asked)
    return tuple(requests), tuple(label), np.array(list(label.values())).reshape(-1, 2)


MAX_SPOTS = 340
STEP_M = 2.0
MIN_CELLS_IN_LINE = 3.0
"""Smallest length of the longest line in grid steps; else hardly any line would be that long."""

RING, RIM = 8, 0.97
"""Number of points on a ring, and its diameter relative to the longest line."""

EDGE_DISTANCE_M = 1.2
"""Distance of line ends from the edge of a scene, where taping is impractical [m]."""


def make_grid(area_m: Floats, step_m: float, from_edge_m: float = 0.0) -> Floats:
    """Return a (N, 2) square grid in a polygon, along its longer side, centred between its edges.

    Parameters
    ----------
    area_m
        (V, 2) the polygon.
    step_m
        Largest distance from node to node.
    from_edge_m
        Margin at the edges of its smallest rectangle.
    """
    middle, axis, size = find_long_axis(area_m)
    room = np.maximum(size - 2.0 * from_edge_m, 0.0)
    count = np.maximum(np.ceil(room / step_m - 1e-9).astype(int), 1)
    along, across = (np.linspace(-r / 2, r / 2, n + 1) for r, n in zip(room, count, strict=True))
    x, y = (part.ravel() for part in np.meshgrid(along, across, indexing="ij"))
    point = middle + x[:, None] * axis + y[:, None] * np.array([-axis[1], axis[0]])
    return np.asarray(point[mark_points_inside(area_m, point)])


def make_spots(
    area_m: Floats, no_go_m: tuple[Floats, ...], longest_m: float, most: int = MAX_SPOTS
) -> Floats:
    """Return (N, 2) possible line ends: a grid; in a large area, rings about the nodes of one.

    Parameters
    ----------
    area_m, no_go_m
        (V, 2), (v, 2) polygons: the area, and no-go areas.
    longest_m
        Longest line.
    most
        Approximate number of ends.
    """
    size = find_long_axis(area_m)[2]
    edge = min(EDGE_DISTANCE_M, 0.1 * float(size.min()))
    step = max(min(STEP_M, 0.2 * float(size.min())), float(np.sqrt(size.prod() / most)))
    if step * MIN_CELLS_IN_LINE <= longest_m:
        point = make_grid(area_m, step, edge)
    else:
        turn = 2.0 * np.pi * np.arange(RING) / RING
        ring = 0.5 * RIM * longest_m * np.column_stack([np.cos(turn), np.sin(turn)])
        middle = make_grid(area_m, step * float(np.sqrt(RING)), 0.5 * longest_m)
        point = (middle[:, None] + ring).reshape(-1, 2)
        point = point[mark_points_inside(area_m, point)]
    for polygon in no_go_m:
        point = point[~mark_points_inside(polygon, point)]
    return point


def join_spots(
    spot_m: Floats,
    no_go_m: tuple[Floats, ...],
    seen_together: Bools,
    lengths_m: tuple[float, float],
) -> Ints:
    """Return (N, 2) pairs of ends that a line can join.

    Parameters
    ----------
    spot_m
        (K, 3) points on the ground, along which the tape is laid.
    no_go_m
        Polygons that no tape may cross.
    seen_together
        (K, K) whether a photo shows both for certain.
    lengths_m
        Shortest and longest line.
    """
    first, second = np.triu_indices(len(spot_m), k=1)
    length = np.linalg.norm(spot_m[second] - spot_m[first], axis=1)
    fits = (length >= lengths_m[0]) & (length <= lengths_m[1]) & seen_together[first, second]
    first, second = first[fits], second[fits]
    for polygon in no_go_m:
        free = ~mark_crossing_segments(polygon, spot_m[first, :2], spot_m[second, :2])
        first, second = first[free], second[free]
    return np.stack([first, second], axis=1)


LENGTH_M = 10.0
"""Length whose standard deviation is mapped; shorter in a small area."""


class WantedValues(NamedTuple):
    """Requests, and their points: (K,) labels, (K, 2) positions."""

    requests: tuple[MeasurementRequest, ...]
    label: tuple[str, ...]
    point_m: Floats


class Map(NamedTuple):
    """Lengths over an area: two requests for each cell, to the east and to the north.

    Attributes
    ----------
    middle_m
        (N, 2) of the cells.
    cell_m, length_m
        Side of a cell; length of each.
    wanted
        2N requests, those of a cell one after the other.
    """

    middle_m: Floats
    cell_m: float
    length_m: float
    wanted: WantedValues


def make_lengths(area_m: Floats, cells: int) -> Map:
    """Return lengths centred on about `cells` cells of an area (V, 2)."""
    _, _, size = find_long_axis(area_m)
    cell = float(np.sqrt(size.prod() / cells))
    middle = make_grid(area_m, cell, min(0.5 * cell, 0.45 * float(size.min())))
    length = min(LENGTH_M, 0.3 * float(size.min()))
    reach = 0.5 * length * np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
    names = [(f"cell{i}w", f"cell{i}e", f"cell{i}s", f"cell{i}n") for i in range(len(middle))]
    requests = tuple(
        MeasurementRequest(name=f"{a} {b}", kind="distance", points=(a, b))
        for w, e, s, n in names
        for a, b in ((w, e), (s, n))
    )
    label = tuple(name for four in names for name in four)
    point = _move_inside(area_m, middle[:, None, None] + reach.reshape(2, 2, 2)).reshape(-1, 2)
    return Map(middle, cell, length, WantedValues(requests, label, point))


def compute_equal_weights(kind: Sequence[str], unit: Sequence[str]) -> Floats:
    """Return (M,) weights for a plain mean of lengths' sigmas; of all values without lengths.

    Coordinates are not lengths: their sigmas are those of the log, metres that no line changes.
    """
    pairs = zip(kind, unit, strict=True)
    counted = np.array([one == "m" and what != "coordinate" for what, one in pairs])
    counted = counted if counted.any() else np.ones(len(counted), dtype=np.bool_)
    return np.asarray(counted / counted.sum())


def _move_inside(area_m: Floats, ends: Floats) -> Floats:
    """Shift lengths (N, 2, 2, 2) along themselves into the area, where they fit into it."""
    along = ends[:, :, 1] - ends[:, :, 0]
    inside = np.zeros(ends.shape[:2], dtype=np.bool_)
    moved = ends.copy()
    for share in (0.0, 0.25, -0.25, 0.5, -0.5):
        tried = ends + share * along[:, :, None]
        fits = (
            mark_points_inside(area_m, tried.reshape(-1, 2)).reshape(*ends.shape[:2], 2).all(axis=2)
        )
        moved = np.where((fits & ~inside)[..., None, None], tried, moved)
        inside |= fits
    return moved


def list_wanted(scene: PlanScene) -> WantedValues:
    """Return the requests of a scene; lengths all over its area if it has none."""
    if scene.requests:
        return WantedValues(scene.requests, scene.label, scene.point_m)
    return make_lengths(scene.area_m, MAX_CELLS).wanted


MAX_CELLS = 30
"""Number of map cells that represent an area while lines are chosen."""

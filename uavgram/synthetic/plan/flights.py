"""Flights that show all of an area, within the limits of drone and law, and their photos."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from uavgram.errors import GeometryError
from uavgram.geometry.camera.projection import back_project, project_with_jacobian
from uavgram.geometry.ground.figures import (
    find_long_axis,
    mark_crossing_segments,
    mark_points_inside,
)
from uavgram.geometry.motion.rotation import (
    ENU_FROM_NED,
    GIMBAL_FROM_CAMERA,
    hat,
    matrix_from_ypr,
)
from uavgram.model.arrays import Bools, Floats
from uavgram.model.camera import Calibration
from uavgram.model.planned import FlightPattern, PlanRequest
from uavgram.synthetic.observations import (
    EDGE_PX,
    compute_corner_rays,
    find_large_plates,
    is_inside,
    shows_horizon,
)
from uavgram.synthetic.plan.scene import Deviation, PlanScene, WantedValues, make_grid

MARGIN_SIGMAS = 1.645
"""One-sided 95 % quantile of the normal distribution [sigma]."""


class PlannedCameras(NamedTuple):
    """F photos in the order of the flight.

    Attributes
    ----------
    center_m
        (F, 3) world.
    heading_deg, pitch_deg
        (F,) of the nose, from north, clockwise; of the optical axis, -90 straight down.
    time_s
        (F,) since the first.
    """

    center_m: Annotated[Floats, "f", 3]
    heading_deg: Annotated[Floats, "f"]
    pitch_deg: Annotated[Floats, "f"]
    time_s: Annotated[Floats, "f"]

    @property
    def world_from_body(self) -> Floats:
        """(F, 3, 3) of the drone, level."""
        level = np.zeros(len(self.heading_deg))
        return ENU_FROM_NED @ matrix_from_ypr(np.deg2rad(self.heading_deg), level, level)

    @property
    def world_from_gimbal(self) -> Floats:
        """(F, 3, 3) x along the optical axis, -z up in the image."""
        yaw, pitch = np.deg2rad(self.heading_deg), np.deg2rad(self.pitch_deg)
        return ENU_FROM_NED @ matrix_from_ypr(yaw, pitch, np.zeros(len(yaw)))

    @property
    def world_from_camera(self) -> Floats:
        """(F, 3, 3) rotations of the camera."""
        return np.asarray(self.world_from_gimbal @ GIMBAL_FROM_CAMERA)


class VisiblePoints(NamedTuple):
    """Points in photos: pixels (F, N, 2), and whether they are visible for certain (F, N)."""

    pixel_px: Floats
    certain: Bools


def find_visible(
    calibration: Calibration, cameras: PlannedCameras, point_m: Floats, deviation: Deviation | None
) -> VisiblePoints:
    """Project points to photos, and mark those that are visible despite the drone's deviation.

    Parameters
    ----------
    calibration
        The lens.
    cameras
        The photos.
    point_m
        (N, 3) world.
    deviation
        Deviation of the drone from the plan; None: not at all.
    """
    rotation = cameras.world_from_camera
    from_center = point_m[None] - cameras.center_m[:, None]
    in_camera = np.einsum("fij,fni->fnj", rotation, from_center)
    pixel, by_point, _ = project_with_jacobian(calibration.model, calibration.parameters, in_camera)
    spread = np.zeros(pixel.shape)
    if deviation is not None:
        spread = compute_spread_px(by_point, in_camera, deviation)
    return VisiblePoints(pixel, is_inside(calibration, pixel, spread))


def remove_small_plates(found: VisiblePoints, first: int) -> VisiblePoints:
    """Return the sightings, without those of plates that are too small in a photo to be found.

    Parameters
    ----------
    found
        Sightings of points, and of the corners of plates behind them.
    first
        Index of the first corner, four for each plate.
    """
    certain = found.certain.copy()
    certain[:, first:] &= find_large_plates(found.pixel_px[:, first:])
    return VisiblePoints(found.pixel_px, certain)


def compute_spread_px(by_point: Floats, in_camera: Floats, deviation: Deviation) -> Floats:
    """Compute the (..., 2) shift of pixels, to `MARGIN_SIGMAS` sigmas, by the drone's deviation.

    Parameters
    ----------
    by_point
        (..., 2, 3) derivatives of the pixels by the points.
    in_camera
        (..., 3) the points, in camera axes.
    deviation
        Of the drone.
    """
    place = deviation.position_m * np.linalg.norm(by_point, axis=-1)
    turn = np.linalg.norm(by_point @ hat(in_camera), axis=-1)
    return np.asarray(MARGIN_SIGMAS * np.hypot(place, np.deg2rad(deviation.attitude_deg) * turn))


VERTICES_PER_SIDE = 4
"""Vertices on each side of a photo, whose edges are curved by the lens."""


def compute_footprints(scene: PlanScene, cameras: PlannedCameras) -> tuple[Floats, Floats]:
    """Compute outlines (F, 16, 3) on the ground: of the photos, and of the certain part.

    Counterclockwise from above, not closed. The certain part is inside the photo's edge by the
    shift of the ground under the drone's deviation.
    """
    camera = scene.calibration
    share = np.arange(VERTICES_PER_SIDE) / VERTICES_PER_SIDE
    zero, one = np.zeros(VERTICES_PER_SIDE), np.ones(VERTICES_PER_SIDE)
    u = np.concatenate([share, one, 1.0 - share, zero])
    v = np.concatenate([zero, share, one, 1.0 - share])
    size = np.array([camera.width_px, camera.height_px]) - 1.0
    rim = np.column_stack([u, v])[::-1]  # v points down: reversed is counterclockwise
    whole = _on_ground(scene, cameras, np.broadcast_to(rim * size, (len(cameras.center_m), 16, 2)))
    inset = _spread(scene, cameras, whole) + EDGE_PX
    inset = np.minimum(inset, 0.45 * size)
    return whole, _on_ground(scene, cameras, rim * size + np.sign(0.5 - rim) * inset)


def _spread(scene: PlanScene, cameras: PlannedCameras, ground_m: Floats) -> Floats:
    """Compute the (F, V, 2) shift of ground points in their photo by the drone's deviation [px]."""
    from_center = ground_m - cameras.center_m[:, None]
    in_camera = np.einsum("fij,fvi->fvj", cameras.world_from_camera, from_center)
    calibration = scene.calibration
    _, by_point, _ = project_with_jacobian(
        calibration.model, calibration.parameters, in_camera, beyond_fold="extend"
    )
    return compute_spread_px(by_point, in_camera, scene.deviation)


def _on_ground(scene: PlanScene, cameras: PlannedCameras, pixel_px: Floats) -> Floats:
    """Project pixels (F, V, 2) of each photo to the ground, (F, V, 3)."""
    camera = scene.calibration
    ray = back_project(camera.model, camera.parameters, pixel_px)
    direction = np.einsum("fij,fvj->fvi", cameras.world_from_camera, ray)
    normal = np.array([*-scene.slope, 1.0])
    foot = scene.on_ground(cameras.center_m[:, :2])
    above = (cameras.center_m - foot) @ normal
    reach = -above[:, None] / (direction @ normal)
    return np.asarray(cameras.center_m[:, None] + reach[..., None] * direction)


CLIMB_M_S = 2.0
USABLE_BATTERY_SHARE = 0.8
"""Usable share of a battery; the rest is reserve for wind and the way home."""

HEIGHTS_M = (12.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 120.0)
"""Default heights to choose from."""

PITCHES_DEG: dict[FlightPattern, tuple[float, ...]] = {
    "single": (-90.0, -75.0),
    "strip": (-90.0, -75.0),
    "grid": (-90.0,),
    "orbit": (-60.0, -45.0),
}
FRAME_COUNTS: dict[FlightPattern, tuple[int, ...]] = {
    "single": (1,),
    "strip": (3, 5, 8),
    "grid": (0,),  # determined by the overlap
    "orbit": (4, 8),
}
OVERLAP = (0.7, 0.5)
"""Overlap of a grid's photos: along a strip, and from strip to strip."""

MIN_BASE_SHARE = 0.5
"""Smallest distance from the first photo of a strip to the last, relative to the height."""

MAX_GRID_PHOTOS = 200


class Flight(NamedTuple):
    """Candidate flight.

    Attributes
    ----------
    pattern, height_m, pitch_deg
        See `FlightFacts`.
    cameras
        Its photos.
    path_m, duration_s
        From photo to photo; from take-off to landing.
    """

    pattern: FlightPattern
    height_m: float
    pitch_deg: float
    cameras: PlannedCameras
    path_m: float
    duration_s: float

    @property
    def photos(self) -> int:
        """Number of photos."""
        return len(self.cameras.center_m)


def list_flights(
    scene: PlanScene, request: PlanRequest, pattern: FlightPattern, height_m: float
) -> list[Flight]:
    """Return all flights of a pattern at a height: each pitch with each number of photos.

    Parameters
    ----------
    scene, request
        Purpose of the plan.
    pattern, height_m
        Pattern, and height above the ground.
    """
    pitches = request.pitches_deg or PITCHES_DEG[pattern]
    if pattern == "orbit":  # an orbit looks inwards
        pitches = tuple(pitch for pitch in pitches if pitch > -85.0)
    counts = FRAME_COUNTS[pattern] if pattern in {"single", "grid"} else _counts(request, pattern)
    found = [
        make_flight(scene, request, (pattern, height_m, pitch), count)
        for pitch in pitches
        for count in counts
    ]
    return [one for one in found if one is not None]


def _counts(request: PlanRequest, pattern: FlightPattern) -> tuple[int, ...]:
    asked = tuple(count for count in request.frames if count > 1)
    return asked or FRAME_COUNTS[pattern]


def make_flight(
    scene: PlanScene,
    request: PlanRequest,
    kind: tuple[FlightPattern, float, float],
    photos: int,
) -> Flight | None:
    """Compute one flight; None where a grid would take far too many photos.

    Parameters
    ----------
    scene, request
        The area, and the drone.
    kind
        Pattern, height above the ground at the middle of the area [m], gimbal pitch [deg].
    photos
        Number of photos; for a grid, the overlap determines it.
    """
    pattern, height, pitch = kind
    middle, axis, size = find_long_axis(scene.area_m)
    across = np.array([-axis[1], axis[0]])
    fx, fy = scene.calibration.parameters[:2]
    # size of a vertical photo on the ground, and offset of its centre behind the view
    shown = np.array([scene.calibration.height_px / fy, scene.calibration.width_px / fx]) * height
    back = height / np.tan(np.deg2rad(-pitch)) if pitch > -90 else 0.0
    if pattern == "single":
        place, look = np.zeros((1, 2)), np.array([[0.0, 1.0]])
    elif pattern == "strip":
        # nose across the path: the photo's long side is along the area's
        place = np.column_stack([_stops(size[0], shown[1], height, photos), np.zeros(photos)])
        look = np.tile([0.0, 1.0], (photos, 1))
    elif pattern == "grid":
        grid = _grid(size, shown, height)
        if grid is None:
            return None
        place, look = grid
    else:
        angle = 2.0 * np.pi * np.arange(photos) / photos
        look = -np.column_stack([np.cos(angle), np.sin(angle)])
        place = np.zeros((photos, 2))
    axes = np.stack([axis, across])
    direction = look @ axes
    foot = middle + place @ axes - back * direction
    up = scene.on_ground(middle)[2] + height
    center = np.column_stack([foot, np.full(len(foot), up)])
    legs = np.linalg.norm(np.diff(center, axis=0), axis=1)
    time = np.concatenate([[0.0], np.cumsum(legs / request.speed_m_s + request.seconds_per_photo)])
    heading = np.rad2deg(np.arctan2(direction[:, 0], direction[:, 1])) % 360.0
    cameras = PlannedCameras(center, heading, np.full(len(foot), float(pitch)), time)
    path = float(legs.sum())
    # take-off and landing next to the area's middle, at most half its length away
    to_and_fro = np.linalg.norm(foot[[0, -1]] - middle, axis=1).sum() + float(size[0])
    duration = time[-1] + request.seconds_per_photo + 2.0 * height / CLIMB_M_S
    return Flight(
        pattern, height, pitch, cameras, path, float(duration + to_and_fro / request.speed_m_s)
    )


def _stops(length: float, shown: float, height: float, count: int) -> Floats:
    """Return positions along a strip, over the area's length less the ground in one photo.

    The strip is at least `MIN_BASE_SHARE` of the height long, or the photos would be nearly
    the same.
    """
    span = max(length - 0.6 * shown, MIN_BASE_SHARE * height)
    return np.linspace(-0.5 * span, 0.5 * span, count) if count > 1 else np.zeros(1)


def _grid(size: Floats, shown: Floats, height: float) -> tuple[Floats, Floats] | None:
    """Return positions and directions of strips there and back that cover an area with overlap."""
    step = shown * (1.0 - np.array(OVERLAP))
    count = np.maximum(np.ceil((size - 0.5 * shown) / step).astype(int) + 1, 2)
    if count.prod() > MAX_GRID_PHOTOS:
        return None
    along, across = (
        np.linspace(-0.5, 0.5, n) * max(s - 0.5 * w, MIN_BASE_SHARE * height)
        for n, s, w in zip(count, size, shown, strict=True)
    )
    place, look = [], []
    for k, y in enumerate(across):
        sense = 1.0 if k % 2 == 0 else -1.0
        place += [(sense * x, y) for x in along]
        look += [(sense, 0.0)] * len(along)
    return np.array(place), np.array(look)


def is_outside_no_go(scene: PlanScene, cameras: PlannedCameras) -> bool:
    """Return whether a flight stays outside all no-go areas."""
    foot = cameras.center_m[:, :2]
    start, end = (foot[:-1], foot[1:]) if len(foot) > 1 else (foot, foot)
    return not any(mark_crossing_segments(polygon, start, end).any() for polygon in scene.no_go_m)


def list_heights(request: PlanRequest) -> tuple[float, ...]:
    """Return the heights to choose from, the lowest first."""
    heights = request.heights_m or HEIGHTS_M
    return tuple(sorted(h for h in heights if request.min_height_m <= h <= request.max_height_m))


HEIGHT_COUNT = 3
"""Number of heights that are compared, from the lowest one at which a pattern shows everything."""

COVERAGE_POINT_COUNT = 60
"""Number of points of the area that photos must show."""


def find_covering_flights(
    scene: PlanScene, request: PlanRequest, wanted: WantedValues
) -> list[Flight]:
    """Return flights that show the area and the wanted points within the battery's time.

    Parameters
    ----------
    scene, request
        Purpose of the plan.
    wanted
        Whose points must be visible.

    Raises
    ------
    GeometryError
        There is none; the message gives the obstacle.
    """
    must = scene.on_ground(np.concatenate([_area_points(scene), wanted.point_m]))
    found, obstacles = [], dict.fromkeys(("cover", "battery", "no-go", "horizon", "height"), 0)
    for pattern in request.patterns:
        heights = 0
        for height in list_heights(request):
            good = 0
            choices = list_flights(scene, request, pattern, height)
            obstacles["battery"] += int(not choices)  # a grid of far too many photos
            for one in choices:
                obstacle = _obstacle(scene, request, one, must)
                if obstacle:
                    obstacles[obstacle] += 1
                else:
                    good += 1
                    found.append(one)
            heights += bool(good)
            if heights == HEIGHT_COUNT and not request.heights_m:
                break
    if not found:
        raise GeometryError(_explain_no_flight(scene, request, obstacles))
    return found


def _area_points(scene: PlanScene) -> Floats:
    size = np.ptp(scene.area_m, axis=0)
    inside = make_grid(scene.area_m, float(np.sqrt(size.prod() / COVERAGE_POINT_COUNT)))
    return np.concatenate([scene.area_m, inside])


def _obstacle(scene: PlanScene, request: PlanRequest, one: Flight, must_m: Floats) -> str:
    ground = scene.on_ground(one.cameras.center_m[:, :2])[:, 2]
    above = one.cameras.center_m[:, 2] - ground
    if above.max() > request.max_height_m + 1e-6 or above.min() < 0.3 * one.height_m:
        return "height"
    if not is_outside_no_go(scene, one.cameras):
        return "no-go"
    if one.duration_s > USABLE_BATTERY_SHARE * 60.0 * request.battery_min:
        return "battery"
    camera = scene.calibration
    ray = compute_corner_rays(camera, camera.parameters, one.cameras.world_from_camera)
    if shows_horizon(ray, scene.slope).any():
        return "horizon"
    shown = find_visible(scene.calibration, one.cameras, must_m, scene.deviation).certain
    return "" if shown.any(axis=0).all() else "cover"


def _explain_no_flight(scene: PlanScene, request: PlanRequest, obstacles: dict[str, int]) -> str:
    size = find_long_axis(scene.area_m)[2]
    area = f"The area is {size[0]:.0f} m by {size[1]:.0f} m"
    tried = ", ".join(request.patterns)
    if not list_heights(request):
        return (
            "no height is left to fly at: heights_m, min_height_m "
            f"({request.min_height_m:g}) and max_height_m ({request.max_height_m:g}) exclude each "
            "other"
        )
    if obstacles["battery"]:
        return (
            f"{area}: no flight ({tried}) that shows all of it ends within "
            f"{USABLE_BATTERY_SHARE:.0%} of the battery's {request.battery_min:g} minutes, "
            f"with at most {MAX_GRID_PHOTOS} photos. Make the area "
            "smaller, fly higher (heights_m), allow more time (battery_min), or plan it in parts"
        )
    if obstacles["no-go"] and not obstacles["cover"]:
        return (
            "every flight crosses a part that is out of bounds for drone and tape (no_go): draw it "
            "as small as it really is, or plan the area in parts beside it"
        )
    if obstacles["horizon"] and not obstacles["cover"]:
        return (
            "the horizon is in every photo: point the camera further down (pitches_deg nearer -90)"
        )
    if obstacles["height"] and not obstacles["cover"]:
        return (
            "the ground is so steep that every flight comes too close to it or above "
            f"{request.max_height_m:g} m over it: make the area smaller, or plan it in parts"
        )
    more = "" if "grid" in request.patterns else " allow the pattern grid,"
    if max(list_heights(request)) < request.max_height_m:
        more = f" fly higher (heights_m),{more}"
    away = np.linalg.norm(scene.point_m - scene.area_m.mean(axis=0), axis=1)
    away[mark_points_inside(scene.area_m, scene.point_m)] = 0.0
    if away.any():
        farthest = scene.label[int(away.argmax())]
        more += f" leave out points outside of the area ({farthest}),"
    return (
        f"{area}: from at most {max(list_heights(request)):g} m up, no flight ({tried}) shows "
        f"all of it for certain, as the drone may depart by {request.deviation_m:g} m and "
        f"{request.deviation_deg:g} degrees. Make the area smaller,{more} or plan it in parts"
    )

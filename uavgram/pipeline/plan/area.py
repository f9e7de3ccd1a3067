"""The area of a plan, and where nobody may go: from metres or maps into the world's axes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.earth.geodesy import enu_from_geodetic
from uavgram.geometry.ground.polygons import counterclockwise
from uavgram.geometry.ground.shapes import polygon_self_intersects
from uavgram.io.area_file import Area, AreaFile, read_areas
from uavgram.model.arrays import Floats
from uavgram.model.planned.request import Corners, PlanRequest
from uavgram.model.scenario.scenario import Site
from uavgram.stages.simulate.route import scene_axes

FAR_M = 5000.0
"""An area farther than that from the scenario's site is another place."""

NARROWEST_M = 0.3


def site_of(site: Site, request: PlanRequest, file: AreaFile | None, path: Path) -> Site:
    """The scenario's site; that of the area, where its file lies somewhere else.

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
    away = np.linalg.norm(on_map(middle[None], site)[0])
    if away <= FAR_M:
        return site
    if np.linalg.norm(on_map(middle[None, ::-1], site)[0]) <= FAR_M:
        raise InputError(
            path.parent / str(request.area),
            "has latitude and longitude in the wrong order: GeoJSON and KML have the longitude "
            "first",
        )
    by_place = any(not isinstance(one, str) for each in request.wanted for one in each.points)
    if by_place or (request.no_go and not isinstance(request.no_go, str)):
        raise InputError(
            path,
            f"the area lies {away / 1000:.0f} km from the scenario's site, so the places that are "
            "given in metres mean nothing: write latitude_deg and longitude_deg of `site:`",
        )
    return replace(
        site,
        latitude_deg=float(middle[1]),
        longitude_deg=float(middle[0]),
        scene_east_m=0.0,
        scene_north_m=0.0,
    )


def on_map(longitude_latitude_deg: Floats, site: Site) -> Floats:
    """(N, 2) east and north of places on a map [m]."""
    longitude, latitude = longitude_latitude_deg.T
    height = site.height_msl_m + site.undulation_m
    origin = (site.latitude_deg, site.longitude_deg, height)
    return enu_from_geodetic(latitude, longitude, height, origin)[:, :2]


def in_scene(corners: Corners | Floats, site: Site) -> Floats:
    """(N, 2) east and north of places in the scene's axes."""
    xy = np.array(corners, dtype=np.float64).reshape(-1, 2)
    return np.asarray(xy @ scene_axes(site).T + [site.scene_east_m, site.scene_north_m])


def area_of(request: PlanRequest, file: AreaFile | None, site: Site, path: Path) -> Floats:
    """(V, 2) corners of the area.

    Parameters
    ----------
    request
        Of the scenario.
    file
        Of the area; None: it is given in metres.
    site
        Where the world lies.
    path
        The scenario, for messages.

    Raises
    ------
    InputError
        They enclose nothing, or the outline crosses itself.
    """
    if file is None:
        assert not isinstance(request.area, str)  # noqa: S101  (else there is a file)
        return _polygon(in_scene(request.area, site), "plan.area", path)
    named = [one for one in file.areas if not _is_no_go(one)]
    where = path.parent / str(request.area)
    if len(named) != 1:
        raise InputError(
            where,
            f"holds {len(named)} polygons for the area: leave one, and name the others `no-go` or "
            "put them into a file of their own (plan: no_go)",
        )
    return _polygon(on_map(named[0].longitude_latitude_deg, site), "the area", where)


def _polygon(corner: Floats, what: str, path: Path) -> Floats:
    if len(corner) > 1 and np.allclose(corner[0], corner[-1], atol=1e-6):
        corner = corner[:-1]
    if len(corner) < 3 or _width(corner) < NARROWEST_M:
        raise InputError(
            path,
            f"{what} encloses no ground ({len(corner)} different corners): give at least three "
            "that do not lie in one line, one after the other around it",
        )
    if polygon_self_intersects(corner):
        raise InputError(
            path, f"the outline of {what} crosses itself: give its corners one after the other"
        )
    return counterclockwise(corner)


def _width(corner: Floats) -> float:
    """How far corners spread across the line that is nearest to all of them [m]."""
    return float(np.linalg.svd(corner - corner.mean(axis=0), compute_uv=False).min())


def _is_no_go(area: Area) -> bool:
    return area.name.casefold().replace("-", "").replace("_", "").replace(" ", "") == "nogo"


def no_go_of(request: PlanRequest, site: Site, path: Path) -> tuple[Floats, ...]:
    """Polygons that nobody may enter: of their own file, of the area's, or in metres.

    Parameters
    ----------
    request, site
        Of the scenario; where the world lies.
    path
        The scenario: names of files are relative to it.
    """
    found: list[Floats] = []
    for name, only in ((request.area, True), (request.no_go, False)):
        if isinstance(name, str):
            where = path.parent / name
            found += [
                _polygon(on_map(one.longitude_latitude_deg, site), "a no-go polygon", where)
                for one in read_areas(where).areas
                if _is_no_go(one) or not only
            ]
    if not isinstance(request.no_go, str):
        found += [_polygon(in_scene(one, site), "plan.no_go", path) for one in request.no_go]
    return tuple(found)

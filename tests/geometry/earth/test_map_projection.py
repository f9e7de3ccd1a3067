"""Which map to take, against PROJ's own database."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info

from uavgram.errors import GeometryError
from uavgram.geometry.earth.geodesy import (
    checked_crs,
    map_scale,
    misfit,
    projected_from_enu,
    utm_crs,
)


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [(48.1, 11.6), (-33.7, 151.3), (0.1, -179.9), (-54.0, 179.9), (35.0, -0.1), (83.9, 45.0)],
)
def test_the_zone_is_that_of_proj(latitude: float, longitude: float) -> None:
    (info,) = query_utm_crs_info(
        datum_name="WGS 84", area_of_interest=AreaOfInterest(*2 * (longitude, latitude))
    )

    assert utm_crs(latitude, longitude) == f"{info.auth_name}:{info.code}"


@pytest.mark.parametrize(
    ("latitude", "longitude", "code"),
    [
        (60.4, 5.3, 32632),  # Bergen: the widened zone 32
        (78.2, 15.6, 32633),  # Longyearbyen: zone 33 reaches from 9 to 21 degrees
        (78.2, 8.9, 32631),
        (86.0, 10.0, 32661),
        (-82.0, 10.0, 32761),
        (50.0, 191.0, 32602),  # longitudes may be counted to 360
    ],
)
def test_the_exceptions_of_the_standard(latitude: float, longitude: float, code: int) -> None:
    assert utm_crs(latitude, longitude) == f"EPSG:{code}"


def test_a_map_distance_is_the_ground_distance_times_the_scale() -> None:
    origin = (48.1, 11.6, 0.0)
    enu = np.array([[0.0, 0.0, 0.0], [300.0, 400.0, 0.0]])
    placed = projected_from_enu(enu, origin, "EPSG:32632")

    ground = np.linalg.norm(enu[1] - enu[0])
    on_map = np.linalg.norm(placed[1, :2] - placed[0, :2])
    assert on_map / ground == pytest.approx(map_scale(origin, "EPSG:32632"), rel=2e-6)
    np.testing.assert_allclose(placed[0, 2], 0.0, atol=1e-6)


@pytest.mark.parametrize("wrong", ["EPSG:4326", "EPSG:2263", "nonsense"])
def test_degrees_feet_and_nonsense_are_refused_by_name(wrong: str) -> None:
    with pytest.raises(GeometryError, match=wrong):
        checked_crs(wrong)


@pytest.mark.parametrize(
    ("crs", "latitude", "longitude", "why", "fitting"),
    [
        ("EPSG:31370", 52.5, 13.4, "latitude 49.50 to 51.51, longitude 2.50 to 6.40", "EPSG:32633"),
        ("EPSG:2193", 40.0, 175.0, "latitude -47.33 to -34.10", "EPSG:32660"),
        ("EPSG:3857", 52.5, 13.4, "1.64", "EPSG:32633"),
        ("+proj=utm +zone=32 +ellps=GRS80", -30.0, 150.0, "1.19", "EPSG:32756"),
    ],
)
def test_a_system_that_does_not_fit_the_site_is_refused(
    crs: str, latitude: float, longitude: float, why: str, fitting: str
) -> None:
    said = misfit(crs, latitude, longitude)

    assert crs in said
    assert why in said
    assert fitting in said
    assert not misfit(fitting, latitude, longitude)


@pytest.mark.parametrize(
    ("crs", "latitude", "longitude"),
    [
        ("EPSG:32701", -17.0, -179.9),  # an area that begins at the 180th meridian
        ("EPSG:3832", 2.0, -179.9),  # and one that reaches over it
        ("EPSG:32661", 89.9, 20.0),
        ("+proj=utm +zone=32 +ellps=GRS80", 48.5, 13.4),  # beyond the zone, on purpose
    ],
)
def test_a_system_that_fits_is_accepted(crs: str, latitude: float, longitude: float) -> None:
    assert not misfit(crs, latitude, longitude)

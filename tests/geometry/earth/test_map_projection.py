"""Which map to take, against PROJ's own database."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info

from uavgram.errors import GeometryError
from uavgram.geometry.earth.map_projection import (
    checked_crs,
    map_scale,
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

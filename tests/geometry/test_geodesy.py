"""Local coordinates against PROJ's geodesics and the defining formulas."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Geod, Transformer
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info

from uavgram.errors import GeometryError
from uavgram.geometry.geodesy import (
    enu_from_geodetic,
    explain_unsuitable_crs,
    geodetic_from_enu,
    map_scale,
    normalise_crs,
    projected_from_enu,
    utm_crs,
)

ORIGIN = (50.445212345678912, -104.61894321987654, 577.0123456789)  # Regina, to the last digit


def test_the_published_example_of_epsg_guidance_note_7_2() -> None:
    # IOGP 373-7-2, "Geocentric/topocentric conversions" (EPSG methods 9836, 9837): WGS 84 point at
    # 53 48 33.820 N, 2 07 46.380 E, 73.0 m seen from the topocentric origin 55 N, 5 E, 200 m.
    latitude, longitude = 53 + 48 / 60 + 33.82 / 3600, 2 + 7 / 60 + 46.38 / 3600
    enu = enu_from_geodetic(latitude, longitude, 73.0, (55.0, 5.0, 200.0))
    np.testing.assert_allclose(enu, [-189013.869, -128642.040, -4220.171], atol=2e-3)


def test_the_origin_is_zero() -> None:
    np.testing.assert_allclose(enu_from_geodetic(*ORIGIN, ORIGIN), 0, atol=1e-8)


def test_equals_the_rotated_geocentric_difference() -> None:
    rng = np.random.default_rng(1)
    lat = ORIGIN[0] + rng.uniform(-0.02, 0.02, 50)
    lon = ORIGIN[1] + rng.uniform(-0.02, 0.02, 50)
    height = rng.uniform(500, 800, 50)
    cart = Transformer.from_crs("EPSG:4979", "EPSG:4978")
    offset = np.stack(cart.transform(lat, lon, height), -1) - np.array(cart.transform(*ORIGIN))
    p, m = np.radians(ORIGIN[:2])
    axes = np.array(
        [
            [-np.sin(m), np.cos(m), 0],
            [-np.sin(p) * np.cos(m), -np.sin(p) * np.sin(m), np.cos(p)],
            [np.cos(p) * np.cos(m), np.cos(p) * np.sin(m), np.sin(p)],
        ]
    )
    np.testing.assert_allclose(
        enu_from_geodetic(lat, lon, height, ORIGIN), offset @ axes.T, atol=1e-7
    )


def test_distances_and_azimuths_are_those_of_geodesics() -> None:
    origin = (*ORIGIN[:2], 0.0)
    azimuth = np.arange(0.0, 360, 30)
    n = len(azimuth)
    lon, lat, _ = Geod(ellps="WGS84").fwd(
        np.full(n, origin[1]), np.full(n, origin[0]), azimuth, np.full(n, 200.0)
    )
    east, north, up = enu_from_geodetic(lat, lon, 0.0, origin).T
    np.testing.assert_allclose(np.hypot(east, north), 200, atol=1e-5)
    turn = np.arctan2(east, north) - np.radians(azimuth)
    np.testing.assert_allclose(np.sin(turn / 2), 0, atol=1e-7)
    np.testing.assert_allclose(up, -(200**2) / (2 * 6.38e6), rtol=0.01)


@pytest.mark.parametrize("origin", [ORIGIN, (0.0, 179.9999, 0.0), (-89.9, 12.0, 2800.0)])
def test_the_way_back_returns_to_the_start(origin: tuple[float, float, float]) -> None:
    enu = np.random.default_rng(2).uniform(-3000, 3000, (100, 3))
    lat, lon, height = geodetic_from_enu(enu, origin)
    np.testing.assert_allclose(enu_from_geodetic(lat, lon, height, origin), enu, atol=1e-6)


def test_no_place_on_earth_is_nan() -> None:
    enu = enu_from_geodetic([95.0, ORIGIN[0]], ORIGIN[1], [0.0, np.nan], ORIGIN)
    assert np.isnan(enu[0]).all()
    assert np.isnan(enu[1]).any()
    back = geodetic_from_enu(np.array([[np.nan] * 3]), ORIGIN)
    assert np.isnan(back).all()


def test_inputs_stay_as_they_were() -> None:
    enu = np.random.default_rng(3).uniform(-300, 300, (10, 3))
    enu.flags.writeable = False
    columns = geodetic_from_enu(enu, ORIGIN)
    kept = [column.copy() for column in columns]
    enu_from_geodetic(*columns, ORIGIN)
    np.testing.assert_array_equal(columns, kept)


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
        normalise_crs(wrong)


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
    said = explain_unsuitable_crs(crs, latitude, longitude)

    assert crs in said
    assert why in said
    assert fitting in said
    assert not explain_unsuitable_crs(fitting, latitude, longitude)


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
    assert not explain_unsuitable_crs(crs, latitude, longitude)

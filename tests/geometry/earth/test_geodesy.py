"""Local coordinates against PROJ's geodesics and the defining formulas."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import Geod, Transformer

from uavgram.geometry.earth.geodesy import enu_from_geodetic, geodetic_from_enu

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

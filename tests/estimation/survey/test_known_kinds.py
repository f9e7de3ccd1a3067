"""Known azimuths against pyproj, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from known_scenes import ground
from pyproj import CRS, Proj, Transformer
from scenes import make_scene

from uavgram.estimation.survey.known_kinds import ALL_KINDS, AlikeThings
from uavgram.model.arrays import Floats
from uavgram.model.observations import KnownThing

ORIGIN = 15.9, 47.2
"""Longitude and latitude [deg], 0.9 degrees east of the meridian of its zone."""
UTM = "EPSG:32633"


def off(world: Floats, value: float, **parameters: float) -> float:
    """By how much an azimuth is not as it is known to be [deg]."""
    thing = KnownThing(
        index=0,
        name="wall",
        kind="azimuth",
        label=(0, 1),
        value=value,
        sigma=0.1,
        parameters=tuple(parameters.items()),
    )
    survey = make_scene(3).survey
    alike = AlikeThings((thing,), world[None], world[None], on_ground=True, survey=survey)
    return float(ALL_KINDS["azimuth"].departures(alike).value[0, 0])


@pytest.mark.parametrize("bearing", [0.0, 37.5, 90.0, 180.0, 263.0, 359.9])
def test_a_grid_bearing_and_its_convergence_are_those_of_pyproj(bearing: float) -> None:
    east, north = Transformer.from_crs(4326, UTM, always_xy=True).transform(*ORIGIN)
    turn = np.deg2rad(bearing)
    far = east + 120.0 * np.sin(turn), north + 120.0 * np.cos(turn)
    geodetic = Transformer.from_crs(UTM, 4979, always_xy=True)
    to_space = Transformer.from_crs(4979, 4978, always_xy=True)
    places = [to_space.transform(*geodetic.transform(*at, 0.0)) for at in ((east, north), far)]
    lon, lat = np.deg2rad(ORIGIN)
    axes = np.array(
        [
            [-np.sin(lon), np.cos(lon), 0.0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
            [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)],
        ]
    )
    world = (np.array(places) - places[0]) @ axes.T
    convergence = Proj(CRS(UTM)).get_factors(*ORIGIN).meridian_convergence

    assert convergence > 0.6  # grid north is east of true north
    assert off(world, bearing, convergence_deg=convergence) == pytest.approx(0.0, abs=2e-4)
    assert off(world, bearing) == pytest.approx(convergence, abs=2e-4)


@pytest.mark.parametrize(
    ("world", "value", "expected"),
    [
        (ground((0, 0), (0, 5)), 359.0, 1.0),
        (ground((0, 0), (-0.1, 5)), 0.5, -0.5 - np.degrees(np.arctan(0.02))),
        (np.array([[1.0, 1.0, 0.0], [4.0, -2.0, 9.0]]), 130.0, 5.0),
        (ground((2, 2), (2, 2)), 77.0, 0.0),
    ],
)
def test_departures_by_hand(world: Floats, value: float, expected: float) -> None:
    assert off(world, value) == pytest.approx(expected, abs=1e-12)

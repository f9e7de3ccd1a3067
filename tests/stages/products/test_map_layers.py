"""How measurements are drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import synthetic_survey as survey
from hypothesis import given
from hypothesis import strategies as st
from raised_survey import RAISED, raised

from uavgram.model.result.tables import NO_PROFILES, ProfileResults
from uavgram.stages.products.map_layers import features_of, measured_strips, profile_sheets, ticks


def test_a_distance_from_a_plane_is_drawn_to_the_plane() -> None:
    result = survey.build()
    rng = np.random.default_rng(2)
    position = rng.normal(size=result.points.position_world_m.shape)
    labels = result.points.label[:4]
    rows = result.measurements
    count = len(rows.name)
    result = replace(
        result,
        points=replace(result.points, position_world_m=position),
        measurements=replace(
            rows, kind=("plane_distance",) * count, points=(labels,) * count, value=np.ones(count)
        ),
    )
    (point, foot) = measured_strips(result)[0]
    np.testing.assert_array_equal(point, position[0])
    legs = position[2:4] - position[1]
    np.testing.assert_allclose(legs @ (foot - point), 0, atol=1e-12)
    assert abs(np.linalg.det([foot - position[1], *legs])) < 1e-12


def test_a_volume_is_drawn_as_what_its_points_enclose() -> None:
    result = survey.build()
    rows = result.measurements
    count = len(rows.name)
    labels = result.points.label[:5]
    rows = replace(
        rows,
        kind=("volume",) * count,
        points=(labels,) * count,
        parameters=("top=1.0",) * count,
        value=np.ones(count),
    )
    strip = measured_strips(replace(result, measurements=rows))[0]
    np.testing.assert_array_equal(strip, result.points.position_world_m[[0, 1, 2, 3, 0]])


def test_a_height_is_drawn_from_the_ground_up() -> None:
    result = raised(survey.build())
    rows = result.measurements
    count = len(rows.name)
    labels = tuple((label,) for label in result.points.label[:count])
    rows = replace(rows, kind=("height",) * count, points=labels, value=np.ones(count))
    strips = measured_strips(replace(result, measurements=rows))
    for k in range(count):
        foot, top = strips[k]
        height = RAISED.get(result.points.label[k], (0.0,))[0]
        np.testing.assert_array_equal(top, result.points.position_world_m[k])
        np.testing.assert_allclose(top - foot, [0.0, 0.0, height], atol=1e-12)


def test_shapes_of_points_off_the_ground_know_their_heights_over_it() -> None:
    """A foot beside the points has the ground of the nearest of them."""
    result = raised(survey.build())
    layers = {layer.name: layer for layer in features_of(result, None).layers}
    measured = layers["measured_lines"]
    row = list(measured.attributes["name"]).index("skid right")  # from P07 to P16

    np.testing.assert_allclose(measured.above_ground_m[row], [0.0, RAISED["P16"][0]], atol=1e-12)
    known = layers["known_lengths"]
    np.testing.assert_allclose(known.above_ground_m[0], [RAISED["P00"][0], 0.0], atol=1e-12)
    assert all(
        len(above) == len(vertices)
        for layer in layers.values()
        if layer.above_ground_m
        for above, vertices in zip(layer.above_ground_m, layer.vertices_m, strict=True)
    )
    flat = features_of(survey.build(), None).layers
    assert not any(layer.above_ground_m for layer in flat)


# Axes of profiles.


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.integers(2, 12))
def test_ticks_are_round_and_hold_everything(low: float, size: float, most: int) -> None:
    high = low + size
    found = ticks(low, high, most)
    step = found[1] - found[0]
    lead = float(f"{step:.0e}") / 10 ** np.floor(np.log10(step) + 1e-6)

    assert found[0] <= low + 1e-8 * step + 1e-9
    assert found[-1] >= high - 1e-8 * step - 1e-9
    assert round(lead) in (1, 2, 5)
    assert 2 <= len(found) <= most + 3


def level(rise: float, sigma: float = 0.0, length: float = 10.0) -> ProfileResults:
    station = np.array([0.0, 0.4, 1.0]) * length
    place = np.column_stack([station, 0 * station, [0.0, rise, 0.0], 0 * station])
    sigmas = np.full((3, 4), sigma)
    return ProfileResults(profile=("a",) * 3, label=("P", "Q", "R"), place_m=place, sigma_m=sigmas)


@pytest.mark.parametrize(
    ("rise", "larger"), [(8.0, 1), (2.9, 1), (1.4, 2), (0.25, 10), (0.002, 100), (0.0, 100)]
)
def test_small_heights_are_drawn_larger(rise: float, larger: int) -> None:
    (sheet,) = profile_sheets(level(rise))

    assert sheet.exaggeration == larger
    drawn = np.ptp(sheet.height_ticks_m) * larger
    assert drawn >= 0.05 * 10.0
    assert sheet.origin == "P"


def test_axes_hold_the_intervals_of_the_heights() -> None:
    (sheet,) = profile_sheets(level(1.0, sigma=0.5))

    assert sheet.height_ticks_m[0] <= -1.96 * 0.5
    assert sheet.height_ticks_m[-1] >= 1.0 + 1.95 * 0.5


def test_no_profile_has_no_sheet() -> None:
    assert profile_sheets(NO_PROFILES) == ()

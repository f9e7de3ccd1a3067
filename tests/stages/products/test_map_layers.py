"""How measurements are drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import synthetic_survey as survey

from uavgram.stages.products.map_layers import measured_strips


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
    ((point, foot),) = measured_strips(result)[0]
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
    (strip,) = measured_strips(replace(result, measurements=rows))[0]
    np.testing.assert_array_equal(strip, result.points.position_world_m[[0, 1, 2, 3, 0]])

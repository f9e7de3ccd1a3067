"""The grid behind drawings seen from above."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.naming import IMPERIAL, METRIC, Units
from uavgram.stages.products.text_places import overlaps
from uavgram.views.survey.sheet import LETTER, grid_lines, lay_sheet


@pytest.mark.parametrize("units", [METRIC, IMPERIAL])
def test_no_name_of_a_grid_line_covers_another(units: Units) -> None:
    rng = np.random.default_rng(34)
    for _ in range(200):
        low = rng.uniform(-2000.0, 2000.0, 2)
        sheet = lay_sheet(low, low + rng.uniform(3.0, 300.0, 2))
        named = [line for line in grid_lines(sheet, units) if line.text]
        boxes = np.array(
            [(line.x, line.y - 3.0, LETTER / 2 * len(line.text), 4.0, 0.0) for line in named]
        )

        assert len(named) > 2
        assert not np.triu(overlaps(boxes, boxes), 1).any()

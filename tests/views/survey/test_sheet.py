"""The grid behind drawings seen from above."""

from __future__ import annotations

import numpy as np
import pytest

from uavgram.model.naming import IMPERIAL, METRIC, Units
from uavgram.stages.products.text_places import overlaps
from uavgram.views.survey.drawing import Drawing
from uavgram.views.survey.sheet import draw_frame, lay_sheet


@pytest.mark.parametrize("units", [METRIC, IMPERIAL])
def test_no_name_of_a_grid_line_covers_another(units: Units) -> None:
    rng = np.random.default_rng(34)
    for _ in range(200):
        low = rng.uniform(-2000.0, 2000.0, 2)
        sheet = lay_sheet(low, low + rng.uniform(3.0, 300.0, 2))
        drawing = Drawing("", sheet.width, sheet.height)
        draw_frame(drawing, sheet, 0.2 * sheet.width / sheet.scale, units, is_north_known=True)
        boxes = np.array(
            [(one.x, one.y - 3.0, one.half_width, 4.0, 0.0) for one in drawing.written]
        )

        assert len([one for one in drawing.written if one.kind == "grid"]) > 2
        assert not np.triu(overlaps(boxes, boxes), 1).any()

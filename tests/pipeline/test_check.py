"""Labels that nobody picked are all named; what may be meant is looked for while that is quick."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from uavgram.pipeline import check
from uavgram.pipeline.measure.inputs import Inputs


@pytest.mark.parametrize(("most", "hint"), [(8, " (did you mean 'P11'?)"), (7, "")])
def test_hints_stop_where_they_would_take_long(
    monkeypatch: pytest.MonkeyPatch, most: int, hint: str
) -> None:
    monkeypatch.setattr(check, "_MAX_COMPARED", most)
    inputs = SimpleNamespace(  # of what was read, all that is asked for
        picks=SimpleNamespace(label=("A", "B", "C", "P11")),
        lines=SimpleNamespace(name=("L",), start=("A",), end=("P1",)),
        control_lines=SimpleNamespace(name=(), points=()),
        known=SimpleNamespace(name=("k",), points=(("A", "P1", "B"),)),
        requests=(SimpleNamespace(name="m", points=("P1", "B")),),
        control=SimpleNamespace(label=("Q77",)),
        check=SimpleNamespace(label=np.array([])),
    )
    texts = [message.text for message in check._find_unpicked(cast("Inputs", inputs))]
    way_out = ": pick it, or correct its name."
    assert texts == [
        f"Point 'P1' of line 'L' is never picked{hint}{way_out}",
        f"Point 'P1' of known thing 'k' is never picked{hint}{way_out}",
        f"Point 'P1' of measurement 'm' is never picked{hint}{way_out}",
        f"Point 'Q77' of the control points is never picked{way_out}",
    ]

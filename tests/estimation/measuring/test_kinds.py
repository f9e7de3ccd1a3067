"""Which points can be measured."""

import pytest

from uavgram.estimation.measuring.propagation import require_picked
from uavgram.geometry.ground.measurements import UnmeasurableError
from uavgram.model.observations import MeasurementRequest


def test_a_picked_label_that_was_left_out_is_no_misspelling() -> None:
    request = MeasurementRequest(name="it", kind="distance", points=("P10", "V10"))
    with pytest.raises(UnmeasurableError, match=r"'V10' has no usable pick \(did you mean 'P10'"):
        require_picked(request, ("P10",))
    with pytest.raises(UnmeasurableError, match=r"'V10' has no usable pick$"):
        require_picked(request, ("P10",), picked=("P10", "V10"))

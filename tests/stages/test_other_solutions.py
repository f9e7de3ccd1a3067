"""Which measured values other solutions would change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.model.result.tables import MeasurementResults
from uavgram.stages.measure import add_alternatives


def measured(values: list[float], sigmas: list[float]) -> MeasurementResults:
    value, sigma = np.array(values), np.array(sigmas)
    count = len(value)
    return MeasurementResults(
        name=tuple(f"M{i}" for i in range(count)),
        kind=("distance",) * count,
        points=(("A", "B"),) * count,
        value=value,
        sigma=sigma,
        unit=("m",) * count,
        interval_95=value[:, None] + 1.96 * sigma[:, None] * [-1, 1],
        correlation=np.eye(count),
    )


def test_a_value_within_its_interval_in_every_solution_is_the_only_one() -> None:
    rows = add_alternatives(measured([20.0, 30.0], [0.1, 0.1]), [(20.19, 30.0), (19.81, 30.21)])

    assert rows.alternative_values == ((), (30.21,))
    assert rows.is_ambiguous.tolist() == [False, True]


def test_other_values_are_in_order_and_those_of_one_value_stand_once() -> None:
    others = [(31.2,), (44.9,), (12.0,), (44.95,), (31.35,)]
    rows = add_alternatives(measured([20.0], [0.1]), others)

    assert rows.alternative_values == ((12.0, 31.2, 31.35, 44.9),)


def test_what_has_no_value_here_or_there_is_not_marked() -> None:
    rows = add_alternatives(measured([np.nan, 20.0], [np.nan, 0.1]), [(5.0, np.nan)])

    assert rows.alternative_values == ((), ())


def test_one_solution_leaves_all_as_it_was() -> None:
    rows = add_alternatives(measured([20.0, 30.0], [0.1, 0.1]), ())

    assert rows.alternative_values == ((), ())
    assert not rows.is_ambiguous.any()


def test_a_table_has_the_other_values_of_each_of_its_rows() -> None:
    with pytest.raises(ValueError, match=r"alternative_values: expected shape \(3,\), got \(1,\)"):
        replace(measured([20.0, 30.0, 40.0], [0.1] * 3), alternative_values=((1.0,),))

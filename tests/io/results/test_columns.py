"""One annotation names a column in results.json, in its schema and in data frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pytest

from uavgram.io.results.codec import Table
from uavgram.io.results.schema import row_schema
from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays
from uavgram.model.naming import Column
from uavgram.views.notebook.tables import columns


@dataclass(frozen=True, kw_only=True, eq=False)
class Marks(FrozenArrays):
    """Two marks.

    Attributes
    ----------
    start
        Where it begins.
    pixel_px, drift_m
        (N, 2) in the photo; by how much it moved.
    """

    name: Annotated[tuple[str, ...], "n"]
    start: Annotated[tuple[str, ...], "n", Column("from")]
    pixel_px: Annotated[Floats, "n", 2, Column(keys=("u_px", "v_px"), axes=("u", "v"), stem="")]
    drift_m: Annotated[Floats, "n", 2, NAN_IS_NONE]
    age_s: Annotated[Floats, "n", NAN_IS_NONE]


MARKS = Marks(
    name=("a", "b"),
    start=("P", "Q"),
    pixel_px=np.array([[1.0, 2.0], [3.0, 4.0]]),
    drift_m=np.array([[0.1, 0.2], [np.nan, np.nan]]),
    age_s=np.array([5.0, np.nan]),
)


def test_its_keys_are_those_of_the_file_in_both_directions() -> None:
    table = Table(Marks)
    first, second = table.dump(MARKS)

    assert first == {
        "name": "a",
        "from": "P",
        "u_px": 1.0,
        "v_px": 2.0,
        "drift_m": [0.1, 0.2],
        "age_s": 5.0,
    }
    assert (second["drift_m"], second["age_s"]) == ([None, None], None)
    again = table.load([first, second])
    np.testing.assert_array_equal(again.pixel_px, MARKS.pixel_px, strict=True)
    np.testing.assert_array_equal(again.drift_m, MARKS.drift_m, strict=True)
    assert again.start == MARKS.start


def test_the_schema_has_the_same_keys_with_the_words_of_the_docstring() -> None:
    row = row_schema(Table(Marks))

    assert list(row) == ["name", "from", "u_px", "v_px", "drift_m", "age_s"]
    assert row["from"] == {"type": "string", "description": "Where it begins."}
    assert row["u_px"]["type"] == "number"
    assert row["drift_m"]["items"] == {"type": ["number", "null"]}
    assert (row["drift_m"]["minItems"], row["drift_m"]["maxItems"]) == (2, 2)


def test_data_frames_have_a_column_for_each_entry() -> None:
    assert list(dict(columns(MARKS))) == [
        *("name", "start", "u_px", "v_px", "drift_east_m", "drift_north_m", "age_s")
    ]


def test_a_name_for_each_row_is_still_asked_for() -> None:
    with pytest.raises(ValueError, match=r"Marks\.start"):
        Marks(
            name=("a",),
            start=(),
            pixel_px=np.zeros((1, 2)),
            drift_m=np.zeros((1, 2)),
            age_s=np.zeros(1),
        )

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import pytest

from uavgram.model.arrays import (
    NAN_IS_NONE,
    Bools,
    Floats,
    FrozenArrays,
    Ints,
    freeze,
    rows_of,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Marks(FrozenArrays):
    name: Annotated[tuple[str, ...], "n"]
    place_m: Annotated[Floats, "n", 2]
    height_m: Annotated[Floats, "n", NAN_IS_NONE]
    area: Annotated[Ints, "n"]
    seen: Annotated[Bools, "n"]
    pivot_m: Annotated[Floats, 2]
    source: str = ""


@dataclass(frozen=True, eq=False)
class Grid:
    rows: int
    value: Annotated[Floats, "r", "c"]

    def __post_init__(self) -> None:
        freeze(self, r=self.rows)


def marks(**changes: Floats | list[int]) -> Marks:
    given = {"name": ("a", "b"), "place_m": np.zeros((2, 2)), "height_m": [np.nan, 1]}
    given |= {"area": [0, 1], "seen": [True, False], "pivot_m": (0, 0)}
    return Marks(**given | changes)


def test_arrays_are_copied_typed_and_read_only() -> None:
    place = np.zeros((2, 2))
    found = marks(place_m=place)
    place[:] = 7.0
    assert not found.place_m.any()
    assert [a.dtype.kind for a in (found.height_m, found.area, found.seen)] == ["f", "i", "b"]
    for name in ("place_m", "height_m", "area", "seen", "pivot_m"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(found, name)[0] = 1


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"place_m": np.zeros((3, 2))}, r"Marks.place_m: expected shape \(2, 2\), got \(3, 2\)"),
        ({"place_m": np.zeros(2)}, r"Marks.place_m: expected shape \(2, 2\), got \(2,\)"),
        ({"area": [0]}, r"Marks.area: expected shape \(2,\), got \(1,\)"),
        ({"pivot_m": np.zeros(3)}, r"Marks.pivot_m: expected shape \(2,\), got \(3,\)"),
        ({"place_m": [[0, 0], [0, np.nan]]}, r"Marks.place_m: not finite at index \(1, 1\)"),
        ({"height_m": [0, np.inf]}, r"Marks.height_m: not finite at index \(1,\)"),
    ],
)
def test_a_wrong_array_is_named(
    changes: dict[str, Floats] | dict[str, list[int]], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        marks(**changes)


def test_a_size_may_come_from_elsewhere() -> None:
    assert Grid(2, np.zeros((2, 5))).value.shape == (2, 5)
    with pytest.raises(ValueError, match=r"Grid.value: expected shape \(3, 5\), got \(2, 5\)"):
        Grid(3, np.zeros((2, 5)))


def test_rows_are_taken_of_all_columns_of_one_length() -> None:
    last = replace(marks(), **rows_of(marks(), np.array([1])))
    assert (last.name, last.area.tolist(), last.seen.tolist()) == (("b",), [1], [False])
    assert last.pivot_m.shape == (2,)

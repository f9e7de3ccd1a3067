"""Suggestions in messages."""

from __future__ import annotations

import pytest

from uavgram.errors import suggest_spelling


@pytest.mark.parametrize(
    ("word", "known", "suggested"),
    [
        ("r1", ["R1", "R2"], "R1"),
        ("P01", ["P1", "P10"], "P1"),
        ("kerb nord", ["kerb north", "kerb south"], "kerb north"),
        ("IMG_0003.JPG", ["IMG_0003.jpg", "IMG_0004.jpg"], "IMG_0003.jpg"),
        ("heigth_m", ["height_m", "length_m"], "height_m"),
        ("skid", ["R1"], None),
    ],
)
def test_a_near_miss_is_a_spelling_of_the_same_thing(
    word: str, known: list[str], suggested: str | None
) -> None:
    assert suggest_spelling(word, known) == (f"did you mean {suggested!r}?" if suggested else "")

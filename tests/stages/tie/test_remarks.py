"""What is said of tie points: how many, which photos they miss, which hang apart."""

from __future__ import annotations

import numpy as np

from uavgram.model.survey import NO_TIES, TiePicks
from uavgram.stages.tie.remarks import remarks


def ties(*pairs: tuple[str, str]) -> TiePicks:
    """One tie point for each pair of photos."""
    image = tuple(name for pair in pairs for name in pair)
    return TiePicks(
        image=image,
        tie=tuple(f"t{k // 2}" for k in range(len(image))),
        pixel_px=np.zeros((len(image), 2)),
        sigma_px=np.full(len(image), 0.1),
    )


def test_all_photos_in_one_group_need_one_sentence() -> None:
    (message,) = remarks(ties(("a", "b"), ("b", "c"), ("a", "b")), ["a", "b", "c"], "ties.csv")

    assert message.code == "ties-found"
    assert "3 tie points were found in 3 of 3 photos, 1 to 3 in each: ties.csv" in message.text


def test_a_photo_that_nothing_ties_is_named() -> None:
    _, message = remarks(ties(("a", "b")), ["a", "b", "c"], "ties.csv")

    assert message.code == "photo-untied"
    assert message.frames == ("c",)


def test_groups_that_nothing_joins_are_told() -> None:
    pairs = [("a", "b"), ("b", "c"), ("d", "e")]

    _, message = remarks(ties(*pairs), list("abcde"), "ties.csv")

    assert message.code == "ties-apart"
    assert message.frames == ("d", "e")
    assert "2 groups" in message.text


def test_no_tie_point_at_all_is_a_warning() -> None:
    (message,) = remarks(NO_TIES, ["a", "b"], "ties.csv")

    assert (message.code, message.level) == ("ties-none", "warning")

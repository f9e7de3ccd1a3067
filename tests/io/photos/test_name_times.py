"""Times in the names of photos: found where all names are of one form, and nowhere else."""

from __future__ import annotations

from datetime import datetime

import pytest

from uavgram.io.photos.catalogue import name_format


@pytest.mark.parametrize(
    ("stems", "form"),
    [
        (["20180805_010050", "20180805_010051"], "%Y%m%d_%H%M%S"),
        (["2018080501005009Z", "2018080501005094Z"], "%Y%m%d%H%M%S%fZ"),
        (["IMG_2024-03-01T12-30-05", "IMG_2024-03-01T12-30-06"], "IMG_%Y-%m-%dT%H-%M-%S"),
        (["100% 20240301_123005.25", "100% 20240301_123005.75"], "100%% %Y%m%d_%H%M%S.%f"),
    ],
)
def test_the_form_of_a_time_is_found(stems: list[str], form: str) -> None:
    assert name_format(stems) == form
    datetime.strptime(stems[0], form)  # noqa: DTZ007


@pytest.mark.parametrize(
    "stems",
    [
        [],
        ["IMG_0041", "IMG_0042"],
        ["DJI_20240301123005_0001", "DJI_20240301123007_0002"],  # a counter, too: no one form
        ["20240301_123005", "other"],
        ["20240301_123005_a", "20240301_123005_a"],  # the same moment
        ["20241301_123005", "20241301_123006"],  # no thirteenth month
        ["2024030112", "2024030113"],
    ],
)
def test_what_is_no_time_of_one_form_is_none(stems: list[str]) -> None:
    assert name_format(stems) is None

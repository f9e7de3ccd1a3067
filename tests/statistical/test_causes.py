"""Is the cause of a misfit named, and can the verdict be trusted? A small part of the study.

All of it: `tests/benchmarks/study_causes.py`. Each survey here has one fault that takes what is
measured beyond twice its sigma where nothing is done of it (the study's raw z is above 2).
"""

from __future__ import annotations

import pytest
from cause_outcomes import REMOVED, Outcome, run_case

pytestmark = pytest.mark.statistical

NAMED, GREEN, MENDED = 0.8, 0.05, 0.95
BAD_Z, MENDED_Z = 2.0, 1.3
DUE = {
    "labels_swapped": 3000,
    "pick_60px": 3000,
    "raised_1_3m": 3000,
    "raised_40_100cm": 3000,
    "length_in_feet": 3000,
    "length_1m": 3000,
    "length_20cm": 3000,
    "length_transposed": 3000,
    "length_other_ends": 3000,
    "lengths_exchanged": 3000,
    "lengths_in_feet": 3000,
    "lengths_5_percent": 3000,
    "lengths_20cm": 3000,
    "photos_zoomed": 3001,
    "gimbal_yaw_180": 3000,
    "gps_jump_3m_untaped": 3000,
    "rough_10cm": 3000,
    "bank_1m": 3000,
    "crown_2": 3000,
    "shutter_60": 3000,
    "zoom_1.3": 3000,
    "zoom_1.1": 3000,
}
"""Each promised cause, with the first survey from 3000 on in which it matters and shows; but for
labels swapped everywhere, which take too long."""
MENDED_SURVEYS = tuple(
    (name, 3000) for name in ("labels_swapped", "length_in_feet", "raised_1_3m", "pick_60px")
)


def said(outcome: Outcome) -> str:
    """Which survey, and what is said of it first."""
    first = outcome.told[0].text[:90] if outcome.told else "nothing"
    return f"{outcome.case} {outcome.seed}: z {outcome.z:.1f}, {outcome.level}, {first}"


def test_causes_are_named_first_and_nothing_bad_is_green() -> None:
    found = [run_case(job, {}, compared=False) for job in DUE.items()]
    unnamed = [said(one) for one in found if not one.named]
    assert len(unnamed) <= (1 - NAMED) * len(found), "\n".join(unnamed)
    assert [said(one) for one in found if one.accused] == []  # a right tape: at most 1 %
    bad = [one for one in found if not one.z < BAD_Z]
    green = [said(one) for one in bad if one.level == "green"]
    assert len(green) <= GREEN * len(bad), green


def test_what_remove_mends_is_as_it_was_without_the_fault() -> None:
    found = [run_case(job, REMOVED, compared=False) for job in MENDED_SURVEYS]
    right = [one for one in found if one.repaired and one.z < MENDED_Z]
    wrong = [said(one) for one in found if one not in right]
    assert len(wrong) <= (1 - MENDED) * len(found), "\n".join(wrong)

"""What is remarked of plans."""

from __future__ import annotations

from dataclasses import replace

import pytest
from planned_sample import sample_plan

from uavgram.model.planned import PlannedLines, PlannedPlates
from uavgram.synthetic.plan.make import list_remarks

PLAN = sample_plan()


def laid(count: int) -> PlannedLines:
    lines = PLAN.lines
    return replace(lines, **{name: value[:count] for name, value in vars(lines).items()})


@pytest.mark.parametrize(
    ("lines", "photos", "told"),
    [(0, 1, False), (1, 1, True), (2, 1, True), (3, 1, False), (2, 3, False)],
)
def test_few_lines_in_a_single_photo_are_warned_of(lines: int, photos: int, told: bool) -> None:  # noqa: FBT001
    found = list_remarks((laid(lines), PlannedPlates()), PLAN.measurements, 0.5, photos)
    codes = {message.code for message in found}
    assert ("plan-few-lines" in codes) == told

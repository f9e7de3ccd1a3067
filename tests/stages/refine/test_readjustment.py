"""A pick more on an adjustment: what it says of other photos is what the full adjustment says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from uavgram.estimation.measuring.predicted_pixels import (
    PickedPixels,
    TransferredPixels,
    transfer_pixels,
)
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.observations import Picks
from uavgram.pipeline.pick.live_survey import LiveAdjustment, LiveSurvey, Observations
from uavgram.stages.refine.readjustment import MorePicks, add_picks, readjust

NEW = "P22"
SIGMA_PX = np.array([1.0])


def some(picks: Picks, rows: list[int]) -> Picks:
    return Picks(
        image=tuple(picks.image[i] for i in rows),
        label=tuple(picks.label[i] for i in rows),
        pixel_px=picks.pixel_px[rows],
        sigma_px=picks.sigma_px[rows],
        height_m=picks.height_m[rows],
    )


@pytest.fixture(scope="module")
def survey(data_dir: Path) -> LiveSurvey:
    return LiveSurvey.open(data_dir / "calm_nadir" / "project.yaml")


@pytest.fixture(scope="module")
def rows(survey: LiveSurvey) -> tuple[list[int], int]:
    """Some picks without one label, and one pick of it."""
    labels = survey.inputs.picks.label
    first = labels.index(NEW)
    kept = [i for i, label in enumerate(labels) if label != NEW and (label[0] == "R" or i % 4 == 0)]
    return kept, first


@pytest.fixture(scope="module")
def base(survey: LiveSurvey, rows: tuple[list[int], int]) -> LiveAdjustment:
    inputs = survey.inputs
    return survey.adjust(
        Observations(picks=some(inputs.picks, rows[0]), lines=inputs.lines, requests=())
    )


def more(survey: LiveSurvey, base: LiveAdjustment, row: int) -> MorePicks:
    picks = survey.inputs.picks
    frame = base.adjustment.survey.frame_id.index(picks.image[row])
    return MorePicks((picks.label[row],), np.array([frame]), picks.pixel_px[[row]], SIGMA_PX)


def carried(adjustment: Adjustment, new: MorePicks, survey: LiveSurvey) -> TransferredPixels:
    click = PickedPixels(new.frame, adjustment.label_rows(new.label), new.pixel_px)
    return transfer_pixels(adjustment, survey.flight(), click)


def test_a_new_label_is_expected_where_the_full_adjustment_expects_it(
    survey: LiveSurvey, base: LiveAdjustment, rows: tuple[list[int], int]
) -> None:
    kept, row = rows
    new = more(survey, base, row)
    quick = add_picks(base.adjustment, new, 0.0)
    inputs = survey.inputs
    full = survey.adjust(
        Observations(picks=some(inputs.picks, [*kept, row]), lines=inputs.lines, requests=())
    ).adjustment
    here, there = carried(quick, new, survey), carried(full, new, survey)
    assert here.frame_id == there.frame_id
    assert len(here.frame_id) > 3
    # One pick of a new label says nothing of anything else: the sums of squares are the same.
    assert np.abs(here.pixel_px - there.pixel_px).max() < 0.01
    assert np.allclose(here.covariance_px2, there.covariance_px2, rtol=0.02)
    assert np.allclose(here.affine, there.affine, atol=1e-4)


def test_a_pick_that_moved_is_where_it_is_now(
    survey: LiveSurvey, base: LiveAdjustment, rows: tuple[list[int], int]
) -> None:
    row = rows[0][0]
    here = more(survey, base, row)
    moved = replace(here, pixel_px=here.pixel_px + 3.0)
    after = add_picks(base.adjustment, moved, 0.0).survey
    before = base.adjustment.survey
    assert len(after.pick_frame) == len(before.pick_frame)
    changed = np.abs(after.pixel_px - before.pixel_px).max(axis=1) > 0
    assert np.count_nonzero(changed) == 1
    assert after.pixel_px[changed] == pytest.approx(moved.pixel_px)


def test_uneven_ground_widens_the_region(
    survey: LiveSurvey, base: LiveAdjustment, rows: tuple[list[int], int]
) -> None:
    new = more(survey, base, rows[1])
    even, uneven = (
        carried(add_picks(base.adjustment, new, rough), new, survey) for rough in (0.0, 0.5)
    )
    wider = np.linalg.det(uneven.covariance_px2) / np.linalg.det(even.covariance_px2)
    assert wider.min() > 1.0  # least in a photo that the log alone places
    assert np.median(wider) > 4.0


def test_a_camera_that_looks_at_the_sky_tells_nothing(base: LiveAdjustment) -> None:
    state = base.adjustment.state
    upward = replace(
        base.adjustment,
        minimum=replace(
            base.adjustment.minimum,
            state=replace(state, rotation=state.rotation @ np.diag([1.0, -1.0, -1.0])),
        ),
    )
    new = MorePicks(("sky",), np.array([0]), np.array([[1500.0, 1100.0]]), SIGMA_PX)
    with pytest.raises(ValueError, match="impossible"):
        add_picks(upward, new, 0.0)


def test_what_was_learnt_of_uneven_ground_holds_for_a_new_label(
    survey: LiveSurvey, base: LiveAdjustment, rows: tuple[list[int], int]
) -> None:
    even, new = base.adjustment, more(survey, base, rows[1])
    departs = np.full(len(even.survey.label), 0.5)
    learnt = readjust(even, replace(even.survey, height_sigma_m=departs))
    assert add_picks(learnt, new, 0.0).survey.height_sigma_m[-1] == 0.5
    assert add_picks(even, new, 0.0).survey.height_sigma_m[-1] == 0.0

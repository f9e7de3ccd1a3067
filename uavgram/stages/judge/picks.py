"""Residual, test statistic and status of every pick, and who made the picks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_reliability
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.model.observations import Picks
from uavgram.model.result.reliability import Effects
from uavgram.model.result.tables import (
    MeasurementResults,
    PickResults,
    PickStatus,
    is_only_by_program,
)
from uavgram.stages.judge.tested_survey import TestedSurvey


def judge_picks(
    examined: TestedSurvey, picks: Picks, sigma_px: Floats, survey_index: Ints
) -> tuple[PickResults, Effects]:
    """Compute residual, w, redundancy and status of every pick, and effects of undetected errors.

    w is that of the coordinate where it is larger, the redundancy the mean of the two.

    Parameters
    ----------
    examined
        The adjusted survey under test.
    picks, sigma_px
        All P picks of the project, and their sigmas (P,) with defaults filled in [px].
    survey_index
        (P,) rows in the picks of the survey given to refine; -1 for those of unmatched frames.
    """
    refined, group = examined.refined, examined.groups["pixels"]
    count = len(picks.image)
    residual, w = np.full((count, 2), np.nan), np.full(count, np.nan)
    redundancy = np.full(count, np.nan)
    row = find_rows(survey_index, refined.pick_index, len(refined.pick_removed))
    used = np.flatnonzero(row >= 0)
    at = row[used]
    residual[used] = examined.residuals("pixels")[at]
    w[used] = group.w[at, np.abs(group.w[at]).argmax(axis=1)]
    redundancy[used] = group.redundancy[at].mean(axis=1)
    status: list[PickStatus] = ["unused"] * count
    suspect = examined.suspect("pixels")
    for i in used:
        status[i] = "suspect" if suspect[row[i]] else "used"
    # Gross errors, and matches that were left out, count as removed.
    given = np.flatnonzero(survey_index >= 0)
    removed = refined.pick_removed.copy()
    removed[[k for k, why in refined.pick_reason.items() if why.cause is LeftOutCause.GROSS]] = True
    for i in given[removed[survey_index[given]]]:
        status[i] = "removed"
    for left in refined.matches_left_out:
        status[left] = "removed"
    found, matches = _matches(refined.adjustment, picks)
    residual[found], w[found], redundancy[found] = matches
    for match in found.tolist():
        status[match] = "used"
    results = PickResults(
        image=picks.image,
        label=picks.label,
        pixel_px=picks.pixel_px,
        sigma_px=sigma_px,
        residual_px=residual,
        w=w,
        redundancy=redundancy,
        status=tuple(status),
        source=picks.source,
        score=picks.score,
    )
    return results, examined.effects("pixels", row)


def _matches(adjustment: Adjustment, picks: Picks) -> tuple[Ints, tuple[Floats, Floats, Floats]]:
    """Return picks (n,) by matching that take part; residuals (n, 2) [px], w and redundancy."""
    sightings = adjustment.survey.matches
    at = np.flatnonzero(picks.of_source("match")[sightings.row])
    if not len(at):
        return at, (np.zeros((0, 2)), np.zeros(0), np.zeros(0))
    block = adjustment.minimum.blocks["matches"]
    numbers = compute_reliability(block, adjustment.covariance)
    residual = (block.residual * sightings.sigma_px[:, None])[at]
    w = numbers.w[at]
    larger = w[np.arange(len(at)), np.abs(w).argmax(axis=1)]
    return sightings.row[at], (residual, larger, numbers.redundancy[at].mean(axis=1))


def find_rows(survey_index: Ints, used_index: Ints, count: int) -> Ints:
    """Return the row among the observations for each row of a survey; -1 without one.

    Parameters
    ----------
    survey_index
        (P,) rows of the survey; -1 for none.
    used_index
        (n,) row of the survey of each observation.
    count
        Number of picks, or lengths, of the survey.
    """
    row = np.full(count + 1, -1)  # the last one for -1
    row[used_index] = np.arange(len(used_index))
    return row[survey_index]


def judge_makers(picks: PickResults, measured: MeasurementResults) -> Iterator[Message]:
    """Report measurements that are based on picks by the program only.

    Parameters
    ----------
    picks
        All picks of the project, judged.
    measured
        All measurements; those that could not be computed are not reported.
    """
    alone = is_only_by_program(picks, measured.points) & np.isfinite(measured.value)
    rows = np.flatnonzero(alone).tolist()
    if not rows:
        return
    names = tuple(measured.name[i] for i in rows)
    labels = tuple(dict.fromkeys(label for i in rows for label in measured.points[i]))
    text = (
        f"No person picked any point of {join_names(map(repr, names))}: the program found all of "
        f"them. "
        "Look at them in the photos before you use the value."
    )
    yield Message("info", "only-program-picks", text, labels=labels, measurements=names)

"""What rests on picks of the program alone is told; nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from uavgram.model.observations import Source
from uavgram.model.result.tables import (
    MeasurementResults,
    PickResults,
    PickStatus,
    count_picks_by_source,
    find_sources,
)
from uavgram.stages.judge import judge_makers

MADE: tuple[tuple[str, Source, PickStatus], ...] = (
    ("K", "hand", "used"),
    ("K", "match", "used"),
    ("K", "match", "used"),
    ("T1", "target", "used"),
    ("T2", "target", "suspect"),
    ("M", "hand", "removed"),
    ("M", "match", "used"),
)


def picks(made: tuple[tuple[str, Source, PickStatus], ...] = MADE) -> PickResults:
    n = len(made)
    labels, sources, statuses = zip(*made, strict=True)
    return PickResults(
        image=tuple(f"{k}.jpg" for k in range(n)),
        label=labels,
        pixel_px=np.zeros((n, 2)),
        sigma_px=np.ones(n),
        residual_px=np.zeros((n, 2)),
        w=np.zeros(n),
        redundancy=np.full(n, 0.5),
        status=statuses,
        source=sources,
    )


def measured(*points: tuple[str, ...]) -> MeasurementResults:
    n = len(points)
    return MeasurementResults(
        name=tuple("-".join(one) for one in points),
        kind=("distance",) * n,
        points=points,
        value=np.ones(n),
        sigma=np.ones(n),
        unit=("m",) * n,
        interval_95=np.zeros((n, 2)),
        correlation=np.eye(n),
    )


def test_only_what_used_picks_of_the_program_alone_make_is_told() -> None:
    asked = measured(("T1", "T2"), ("K", "T1"), ("M", "T1"), ("K", "M"), ("gone", "away"))
    (message,) = judge_makers(picks(), asked)

    assert (message.level, message.code) == ("info", "only-program-picks")
    assert message.measurements == ("T1-T2", "M-T1")
    assert message.labels == ("T1", "T2", "M")
    assert message.text.startswith("No person picked any point of 'T1-T2' and 'M-T1': ")


def test_what_could_not_be_computed_is_not_told() -> None:
    asked = replace(measured(("T1", "T2")), value=np.array([np.nan]), sigma=np.array([np.nan]))
    assert not list(judge_makers(picks(), asked))


def test_surveys_that_people_picked_are_as_before() -> None:
    by_hand = tuple((label, "hand", status) for label, _, status in MADE)
    assert not list(judge_makers(picks(by_hand), measured(("T1", "T2"))))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("points", "behind"),
    [(("K",), ("hand", "match")), (("T1", "K"), ("hand", "match", "target")), (("no",), ())],
)
def test_who_stands_behind_a_measurement(points: tuple[str, ...], behind: tuple[str, ...]) -> None:
    assert find_sources(picks(), [points]) == (behind,)
    assert count_picks_by_source(picks())["K"] == {"hand": 1, "match": 2}

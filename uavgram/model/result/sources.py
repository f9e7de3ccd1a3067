"""Who made the picks that points and measurements rest on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np

from uavgram.model.arrays import Bools
from uavgram.model.result.tables import PickResults
from uavgram.model.survey.observations import Source

SOURCES: tuple[Source, ...] = get_args(Source)


def picks_by_source(picks: PickResults) -> dict[str, dict[Source, int]]:
    """How many picks of each label took part, by who made them."""
    found: dict[str, dict[Source, int]] = {}
    for label, source, status in zip(picks.label, picks.source, picks.status, strict=True):
        if status in ("used", "suspect"):
            counts = found.setdefault(label, {})
            counts[source] = counts.get(source, 0) + 1
    return {label: {s: n[s] for s in SOURCES if s in n} for label, n in found.items()}


def sources_behind(
    picks: PickResults, points: Sequence[Sequence[str]]
) -> tuple[tuple[Source, ...], ...]:
    """Who made the picks behind each of some groups of labels.

    Parameters
    ----------
    picks
        All of the project.
    points
        (M,) groups of labels, such as those of measurements.
    """
    by_label = picks_by_source(picks)
    made = [{source for label in labels for source in by_label.get(label, {})} for labels in points]
    return tuple(tuple(source for source in SOURCES if source in one) for one in made)


def only_by_program(picks: PickResults, points: Sequence[Sequence[str]]) -> Bools:
    """(M,) which groups of labels rest on picks, but on none that a person made.

    Parameters
    ----------
    picks, points
        As for `sources_behind`.
    """
    behind = sources_behind(picks, points)
    return np.array([bool(one) and "hand" not in one for one in behind], dtype=np.bool_)

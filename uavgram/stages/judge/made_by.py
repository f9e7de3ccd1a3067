"""Measurements without any pick by a person."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.model.message import Message
from uavgram.model.naming import listed
from uavgram.model.result.tables import MeasurementResults, PickResults, is_only_by_program


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
        f"No person picked any point of {listed(map(repr, names))}: the program found all of them. "
        "Look at them in the photos before you use the value."
    )
    yield Message("info", "only-program-picks", text, labels=labels, measurements=names)

"""Known lengths that could be wrong: by what slip, and which."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.model.survey.mend import Mend
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing

MOST_WRONG = 4
"""Single wrong lengths that are proposed."""


def wrong_lengths(standing: Standing) -> Iterator[Hypothesis]:
    """The lengths that take part and fit worst: each reading is wrong by any amount."""
    adjustment = standing.adjustment
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return
    lines = standing.refined.line_index[adjustment.problem.line_index]
    fall = falls_without(block, adjustment.covariance)
    for row in np.argsort(-fall, kind="stable")[:MOST_WRONG].tolist():
        yield Hypothesis(
            tell=None,
            mend=Mend(without_lines=frozenset([int(lines[row])])),
            promise=float(fall[row]),
            unknowns=1,
            price=PRICE + float(np.log(len(lines))),
        )

"""Limits of test statistics beyond which a run suspects observations: see `level_of_each`."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_critical_value, compute_level
from uavgram.model.arrays import Floats
from uavgram.model.options import SolveOptions
from uavgram.model.result.result import Result


def significance_of(result: Result) -> float:
    """Return the significance that a run used; the default if its result does not state it."""
    stated = dict(result.provenance.options).get("solve.significance")
    return stated if isinstance(stated, float) else SolveOptions().significance


def pick_limit(result: Result) -> float:
    """Return the critical absolute w of the picks under test, of two coordinates each.

    For a significance of one in a thousand: 3.29 up to five picks, 4.1 for a hundred.
    """
    return _limit(result, 2 * int(np.isfinite(result.picks.w).sum()))


def line_limits(result: Result) -> Floats:
    """Return the (L,) critical absolute w of known lengths; each withheld one is tested alone."""
    checked = np.array([status == "checked" for status in result.lines.status], dtype=bool)
    together = int((np.isfinite(result.lines.w) & ~checked).sum())
    return np.where(checked, _limit(result, 1), _limit(result, together))


def prior_limits(result: Result) -> Floats:
    """Return the (N,) critical absolute w of priors; control points share a limit of their own."""
    if result.evidence is None:
        return np.zeros(0)
    control = np.array([kind == "control" for kind in result.evidence.priors.kind], dtype=bool)
    counts = int(control.sum()), int((~control).sum())
    return np.where(control, *(_limit(result, count) for count in counts))


def _limit(result: Result, tests: int) -> float:
    return compute_critical_value(compute_level(significance_of(result), tests))

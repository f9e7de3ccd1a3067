"""Sigmas of an estimator that knows the true sizes of all errors."""

from __future__ import annotations

from trust_world import Survey


def oracle_sigmas(survey: Survey) -> list[float | None]:
    """Sigma of each measurement; None where it is not known."""
    return [None] * len(survey.measure)

"""An observation that does not fit, and what else could be wrong instead."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Member:
    """One observation: group of the likelihood, row in it, and the axis that tells most."""

    kind: str
    row: int
    axis: int


@dataclass(frozen=True)
class Suspicion:
    """An observation that does not fit, and what else could be wrong instead.

    Attributes
    ----------
    accused
        With the largest test statistic `w`.
    w
        Signed, given earlier suspicions.
    group
        Observations that no test can part from it.
    rivals
        Others whose odds against it are more than 1 in 20.
    """

    accused: Member
    w: float
    group: tuple[Member, ...]
    rivals: tuple[Member, ...]

"""What one more reference line would have brought to a survey that was made, and one less taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays


@dataclass(frozen=True, kw_only=True, eq=False)
class NextLines(FrozenArrays):
    """Gains and losses of a survey's reference lines, by the mean sigma of its measurements.

    Attributes
    ----------
    mean_sigma
        Of the survey as it is: of lengths [m], where any are measured.
    unit
        Of `mean_sigma`.
    start_world_m, end_world_m
        (N, 3) lines that would have helped most, the best first; each is reckoned alone.
    near
        (N,) pairs of the labels that the two ends lie nearest to.
    near_m
        (N, 2) and how far from them.
    with_it
        (N,) the mean sigma with each.
    name, without_it
        (L,) the survey's lines, and the mean sigma without each; NaN where nothing holds it then.
    """

    mean_sigma: float
    unit: str
    start_world_m: Annotated[Floats, "n", 3]
    end_world_m: Annotated[Floats, "n", 3]
    near: Annotated[tuple[tuple[str, str], ...], "n"]
    near_m: Annotated[Floats, "n", 2]
    with_it: Annotated[Floats, "n"]
    name: Annotated[tuple[str, ...], "l"]
    without_it: Annotated[Floats, "l", NAN_IS_NONE]

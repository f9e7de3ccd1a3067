"""What a file may say of the repetition of a real survey: the schema beside `--from`."""

from __future__ import annotations

from dataclasses import dataclass

from uavgram.model.scenario.checks import require
from uavgram.model.scenario.road import SceneLine


@dataclass(frozen=True, kw_only=True)
class RepeatedSurvey:
    """A real survey, repeated with the same flight and other errors.

    Attributes
    ----------
    name, seed
        Of the simulation.
    lines
        Lengths that were not taped, between points that were picked: what would they have brought?
    tape_m
        Standard deviation of these.
    """

    name: str = "repeated survey"
    seed: int = 0
    lines: tuple[SceneLine, ...] = ()
    tape_m: float = 0.01

    def __post_init__(self) -> None:
        require(self.seed >= 0, "seed must not be negative")
        require(self.tape_m > 0, "tape_m must be greater than 0")

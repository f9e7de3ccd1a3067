"""What can be repeated: a scenario, each time with other draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from uavgram.model.arrays import Floats
from uavgram.model.camera.calibration import Calibration
from uavgram.model.scenario.scenario import Scenario
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.pipeline.measure.pose import Posed
from uavgram.pipeline.simulate.in_memory import inputs_of
from uavgram.stages.simulate.survey import simulate


class Drawn(NamedTuple):
    """One draw: what a project would hold, and the true values of what it measures.

    `posed` are the frames where no log has to be read for them; `name`, `unit` (M,) and `true`
    (M,) are of the values.
    """

    inputs: Inputs
    posed: Posed | None
    name: tuple[str, ...]
    unit: tuple[str, ...]
    true: Floats


class World(Protocol):
    """A survey that can be repeated."""

    def drawn(self, number: int) -> Drawn:
        """One repetition; the same number gives the same one."""

    def exact(self) -> Drawn:
        """The survey without any error, its sigmas being as stated."""

    def named(self) -> tuple[str, int]:
        """Name and seed."""


@dataclass(frozen=True)
class ScenarioWorld:
    """Repetitions of a scenario with a camera of its own, or with one from a file."""

    scenario: Scenario
    calibration: Calibration | None = None

    def drawn(self, number: int) -> Drawn:
        """One repetition; the same number gives the same one."""
        survey = simulate(self.scenario, self.calibration, repetition=number)
        truth = survey.truth
        return Drawn(
            inputs_of(survey),
            None,
            truth.measurement_name,
            truth.measurement_unit,
            truth.measurement_value,
        )

    def exact(self) -> Drawn:
        """The survey without any error, its sigmas being as stated."""
        survey = simulate(self.scenario, self.calibration, exact=True)
        truth = survey.truth
        return Drawn(
            inputs_of(survey, noise="stated"),
            None,
            truth.measurement_name,
            truth.measurement_unit,
            truth.measurement_value,
        )

    def named(self) -> tuple[str, int]:
        """Name and seed."""
        return self.scenario.name, self.scenario.seed

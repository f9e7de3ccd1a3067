"""Registry of the kinds of observations, in the order of the likelihood's groups.

To add a kind, write its class in a file of this folder and name it here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from uavgram.estimation.survey.observations.camera import Calibration, Readout, Turning
from uavgram.estimation.survey.observations.control import Control
from uavgram.estimation.survey.observations.ground import Departures, Plane, Relief
from uavgram.estimation.survey.observations.known import Known
from uavgram.estimation.survey.observations.lengths import Lengths, TapeScales
from uavgram.estimation.survey.observations.observation import Kind, Observation
from uavgram.estimation.survey.observations.pixels import Identification, LinkedHeights, Pixels
from uavgram.estimation.survey.observations.priors import Gauge
from uavgram.estimation.survey.observations.telemetry import ClockDriftPrior, FlightPrior, Telemetry
from uavgram.estimation.survey.observations.tied import (
    InterpolatedHeights,
    Matches,
    TieHeights,
    Ties,
)

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

OBSERVATIONS: tuple[type[Observation], ...] = (
    Pixels,
    Matches,
    Ties,
    TieHeights,
    InterpolatedHeights,
    Calibration,
    Lengths,
    TapeScales,
    Known,
    Control,
    Departures,
    Relief,
    Plane,
    Identification,
    LinkedHeights,
    Readout,
    Turning,
    Gauge,
    Telemetry,
    FlightPrior,
    ClockDriftPrior,
)

KINDS: dict[str, Kind] = {
    kind.name: kind for one in OBSERVATIONS for kind in one.kinds or (one.kind,)
}
"""Kinds by name."""

READINGS = tuple(
    one.name for one in sorted(KINDS.values(), key=lambda one: one.rank) if one.role == "reading"
)
"""Kinds of readings, which people take and can misread, by rank.

They are suspected before priors are, unless the odds of a prior are better than 20 to 1 (the nine
axes of a calibration, for example, mimic many errors of a single length). The first of these kinds
represents a group of inseparable observations.
"""


def get_kind(group: str) -> Kind:
    """Return the kind of a group of the likelihood, by the name of the group."""
    return KINDS[group.partition(" of ")[0]]


def list_observations(problem: SurveyProblem) -> dict[str, Observation]:
    """Return all observations of a survey, by the names of their groups."""
    return {one.name: one for kind in OBSERVATIONS for one in kind.of(problem)}

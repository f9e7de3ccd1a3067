"""A scenario file -> `Scenario`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from uavgram.config.strict_yaml import Document, Plain, read_yaml
from uavgram.config.validation import validate
from uavgram.model.scenario.errors import USUAL, USUALLY_LOST
from uavgram.model.scenario.repeated import RepeatedSurvey
from uavgram.model.scenario.scenario import Scenario

MOST_ITEMS = 2000
"""Of all lists of a scenario together."""


def load_scenario(path: str | Path) -> Scenario:
    """Read the scenario of a simulated survey; what it leaves out is the demo's.

    Raises
    ------
    InputError
        Names file, line and key of every mistake.
    """
    return scenario_document(path)[0]


def scenario_document(path: str | Path) -> tuple[Scenario, Document]:
    """Read a scenario as `load_scenario` does, and where in its file everything stands."""
    path = Path(path).absolute()
    document = _nothing_lost(_with_usual(read_yaml(path, MOST_ITEMS)))
    scenario = validate(Scenario, document)
    camera = scenario.camera
    if camera.file is not None:
        file = str(path.parent / camera.file)
        scenario = replace(scenario, camera=replace(camera, file=file))
    return scenario, document


def load_repeated(path: str | Path) -> RepeatedSurvey:
    """Read what shall be repeated of a real survey.

    Raises
    ------
    InputError
        Names file, line and key of every mistake.
    """
    return validate(RepeatedSurvey, read_yaml(Path(path).absolute(), MOST_ITEMS))


def _nothing_lost(document: Document) -> Document:
    """The document; of a flight shorter than the demo's no exposure is lost unless it says so."""
    data = document.data
    flight = data.get("flight") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(flight, dict):
        return document
    errors, photos = data.get("errors", {}), flight.get("photos_per_strip")
    short = isinstance(photos, int) and 2 * photos <= USUALLY_LOST
    if not short or not isinstance(errors, dict) or "lost_exposure" in errors:
        return document
    return replace(document, data={**data, "errors": {**errors, "lost_exposure": None}})


def _with_usual(document: Document) -> Document:
    """The document with what is usual of its class of telemetry, where it writes nothing."""
    data = document.data
    kind = data.get("telemetry") if isinstance(data, dict) else None
    if not isinstance(data, dict) or not isinstance(kind, str) or kind not in USUAL:
        return document
    filled: dict[str, Plain] = dict(data)
    for section, usual in USUAL[kind].items():
        written = data.get(section, {})
        if isinstance(written, dict):
            own: dict[str, Plain] = {key: list(value) for key, value in usual.items()}
            filled[section] = own | written
    return replace(document, data=filled)

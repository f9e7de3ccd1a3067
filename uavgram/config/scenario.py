"""A scenario file -> `Scenario`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from uavgram.config.strict_yaml import Document, Plain, read_yaml
from uavgram.config.validation import validate
from uavgram.model.scenario.errors import USUAL
from uavgram.model.scenario.scenario import Scenario


def load_scenario(path: str | Path) -> Scenario:
    """Read the scenario of a simulated survey; what it leaves out is the demo's.

    Raises
    ------
    InputError
        Names file, line and key of every mistake.
    """
    path = Path(path).absolute()
    scenario = validate(Scenario, _with_usual(read_yaml(path)))
    camera = scenario.camera
    if camera.file is None:
        return scenario
    return replace(scenario, camera=replace(camera, file=str(path.parent / camera.file)))


def _with_usual(document: Document) -> Document:
    """The document with what is usual of its class of telemetry, where it writes nothing."""
    data = document.data
    kind = data.get("telemetry") if isinstance(data, dict) else None
    if not isinstance(data, dict) or kind not in USUAL:
        return document
    filled: dict[str, Plain] = dict(data)
    for section, usual in USUAL[kind].items():
        written = data.get(section, {})
        if isinstance(written, dict):
            filled[section] = {**usual, **written}
    return replace(document, data=filled)

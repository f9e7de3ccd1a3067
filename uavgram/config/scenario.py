"""A scenario file -> `Scenario`."""

from __future__ import annotations

from pathlib import Path

from uavgram.config.strict_yaml import read_yaml
from uavgram.config.validation import validate
from uavgram.model.scenario.scenario import Scenario


def load_scenario(path: str | Path) -> Scenario:
    """Read the scenario of a simulated survey; what it leaves out is the demo's.

    Raises
    ------
    InputError
        Names file, line and key of every mistake.
    """
    return validate(Scenario, read_yaml(Path(path).absolute()))

"""Truth of the simulated flights."""

import json

import pytest


@pytest.fixture
def truth(data_dir):
    """Load what the simulator knows of a flight."""

    def load(name):
        return json.loads((data_dir / "truth" / f"{name}.json").read_text())

    return load

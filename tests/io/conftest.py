"""Truth of the simulated flights."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import sample_results

from uavgram.model.result.result import Result


@pytest.fixture
def truth(data_dir: Path) -> Callable[[str], dict[str, Any]]:
    """Load what the simulator knows of a flight."""

    def load(name: str) -> dict[str, Any]:
        known: dict[str, Any] = json.loads((data_dir / "truth" / f"{name}.json").read_text())
        return known

    return load


@pytest.fixture
def sample_result() -> Result:
    """A result in which everything is different from everything else."""
    return sample_results.sample_result()

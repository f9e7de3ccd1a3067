"""Truth of the simulated flights."""

import json
from pathlib import Path

import pytest
import sample_results


@pytest.fixture
def truth(data_dir: Path):
    """Load what the simulator knows of a flight."""

    def load(name):
        return json.loads((data_dir / "truth" / f"{name}.json").read_text())

    return load


@pytest.fixture(scope="session")
def tagged_jpeg():
    """Helpers that make small JPEGs with tags."""
    import tagged_jpeg as module

    return module


@pytest.fixture(scope="session")
def ulog_writer():
    """Writer of small ULogs, with the topics of a flight."""
    import ulog_writer as module

    return module


@pytest.fixture
def sample_result():
    """A result in which everything is different from everything else."""
    return sample_results.sample_result()

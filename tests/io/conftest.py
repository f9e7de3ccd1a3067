"""Truth of the simulated flights."""

import importlib.util
import json
from pathlib import Path

import pytest


@pytest.fixture
def truth(data_dir):
    """Load what the simulator knows of a flight."""

    def load(name):
        return json.loads((data_dir / "truth" / f"{name}.json").read_text())

    return load


@pytest.fixture(scope="session")
def tagged_jpeg():
    """Helpers that make small JPEGs with tags."""
    path = Path(__file__).with_name("tagged_jpeg.py")
    spec = importlib.util.spec_from_file_location("uavgram_tests_tagged_jpeg", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def ulog_writer():
    """Writer of small ULogs, with the topics of a flight."""
    path = Path(__file__).with_name("ulog_writer.py")
    spec = importlib.util.spec_from_file_location("uavgram_tests_ulog_writer", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module

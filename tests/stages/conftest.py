"""Scenes with known truth."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest


def load_scenes():
    """The module tests/estimation/scenes.py, by its path."""
    name = "uavgram_test_scenes"
    path = Path(__file__).parents[1] / "estimation" / "scenes.py"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, path)
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


@pytest.fixture(scope="session")
def scenes():
    """The module of scenes: its sigmas and helpers."""
    return load_scenes()


@pytest.fixture(scope="session")
def scene_factory(scenes):
    """``make_scene``."""
    return scenes.make_scene

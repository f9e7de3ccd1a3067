"""The synthetic survey for every test of the views."""

from __future__ import annotations

import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest


@pytest.fixture(scope="session")
def survey() -> SimpleNamespace:
    """Functions of synthetic_survey.py: build, render, jpeg, project..."""
    return SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("synthetic_survey.py"))))

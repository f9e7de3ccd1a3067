"""The synthetic survey for every test of the views."""

from __future__ import annotations

from types import ModuleType

import pytest


@pytest.fixture(scope="session")
def survey() -> ModuleType:
    """Functions of synthetic_survey.py: build, render, jpeg, project..."""
    import synthetic_survey

    return synthetic_survey

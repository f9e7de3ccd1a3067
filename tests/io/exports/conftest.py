"""A survey with known shapes, and its layers."""

from __future__ import annotations

from dataclasses import replace

import pytest
import synthetic_survey

from uavgram.geometry.geodesy import utm_crs
from uavgram.model.maps import Features
from uavgram.model.result.result import Result
from uavgram.stages.products.map_layers import features_of


@pytest.fixture(scope="session")
def result() -> Result:
    made = synthetic_survey.build()
    assert made.world.origin is not None
    crs = utm_crs(made.world.origin.latitude_deg, made.world.origin.longitude_deg)
    return replace(made, world=replace(made.world, crs=crs))


@pytest.fixture(scope="session")
def features(result: Result) -> Features:
    return features_of(result, result.world.crs)


@pytest.fixture(scope="session")
def adrift() -> Features:
    """The layers of a survey that nothing ties to the earth."""
    return features_of(synthetic_survey.build(telemetry=False), None)

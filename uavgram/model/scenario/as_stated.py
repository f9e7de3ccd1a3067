"""What a scenario draws beside what its project states of the same thing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.model.scenario.scenario import Scenario

OF_THE_LOG = {
    "position_bias_m": "position_bias_sigma_m",
    "heading_bias_deg": "heading_bias_sigma_deg",
    "boresight_deg": "boresight_sigma_deg",
    "lever_arm_sigma_m": "lever_arm_sigma_m",
}
"""Keys of ``errors`` and of ``stated`` that are one thing, of which only a log's user asks."""

TAPE = {"tape_scale": "tape_scale_sigma"}
SAME = 1e-3
"""Shares of a sigma by which two are the same."""


@dataclass(frozen=True)
class Unlike:
    """A thing that is drawn otherwise than stated: its key, and both sigmas, of each coordinate."""

    key: str
    drawn: tuple[float, ...]
    stated: tuple[float, ...]


def unlike_stated(scenario: Scenario) -> tuple[Unlike, ...]:
    """What a scenario draws otherwise than its project states it: its ± is wrong by that.

    Parameters
    ----------
    scenario
        Its errors, its site, its ground, and what it states.
    """
    errors, stated, site, ground = scenario.errors, scenario.stated, scenario.site, scenario.ground
    pairs = {
        f"errors.{key}": (getattr(errors, key), getattr(stated, other))
        for key, other in _keys(scenario).items()
    }
    if scenario.telemetry != "none":
        # Stated is level ground at the height of home; where it always lies is an error too.
        height = np.hypot(ground.height_sigma_m, site.ground_height_m)
        slope = np.hypot(ground.slope_sigma_deg, np.linalg.norm(site.ground_slope_deg) / np.sqrt(2))
        pairs["ground.height_sigma_m"] = float(height), stated.ground_height_sigma_m
        pairs["ground.slope_sigma_deg"] = float(slope), stated.ground_slope_sigma_deg
    found = (Unlike(key, _each(drawn), _each(says)) for key, (drawn, says) in pairs.items())
    return tuple(one for one in found if not np.allclose(one.drawn, one.stated, rtol=SAME))


def as_stated(scenario: Scenario) -> Scenario:
    """The scenario, with each thing drawn from what the project states of it.

    Parameters
    ----------
    scenario
        What is taken from `unlike_stated` is replaced.
    """
    errors, stated, ground = scenario.errors, scenario.stated, scenario.ground
    drawn = {key: getattr(stated, other) for key, other in _keys(scenario).items()}
    scenario = replace(scenario, errors=replace(errors, **drawn))
    if scenario.telemetry == "none":
        return scenario
    return replace(
        scenario,
        site=replace(scenario.site, ground_height_m=0.0, ground_slope_deg=(0.0, 0.0)),
        ground=replace(
            ground,
            height_sigma_m=stated.ground_height_sigma_m,
            slope_sigma_deg=stated.ground_slope_sigma_deg,
        ),
    )


def _keys(scenario: Scenario) -> dict[str, str]:
    return TAPE if scenario.telemetry == "none" else OF_THE_LOG | TAPE


def _each(value: float | tuple[float, ...]) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)

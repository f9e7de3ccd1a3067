"""A `Scenario` as the text of its file: what differs from the defaults."""

from __future__ import annotations

from dataclasses import MISSING, fields, is_dataclass
from typing import Any

import yaml

from uavgram.config.strict_yaml import Plain
from uavgram.model.scenario.scenario import Scenario

WIDTH = 110


def scenario_text(scenario: Scenario, remark: str = "") -> str:
    """The text of a scenario file that reads back as the same scenario.

    Parameters
    ----------
    scenario
        What to write.
    remark
        First line, behind ``#``.
    """
    dumped: str = yaml.safe_dump(
        _plain(scenario), sort_keys=False, allow_unicode=True, width=WIDTH, default_flow_style=None
    )
    return (f"# {remark}\n" if remark else "") + dumped


def _plain(value: object) -> Plain:
    if is_dataclass(value):
        return {
            one.name: _plain(getattr(value, one.name))
            for one in fields(value)
            if getattr(value, one.name) != _default(one)
        }
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    raise TypeError(f"{type(value).__name__} has no place in a scenario file")


def _default(one: Any) -> object:  # noqa: ANN401  (a field of any class)
    if one.default is not MISSING:
        return one.default
    return one.default_factory() if one.default_factory is not MISSING else MISSING

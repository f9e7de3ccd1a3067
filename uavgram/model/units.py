"""Units in which people read lengths and speeds; whatever computes keeps metres and seconds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

LengthUnit = Literal["m", "ft", "ft-in"]
SpeedUnit = Literal["km/h", "mph", "m/s"]

FOOT_M = 0.3048
"""The international foot, exactly. The US survey foot is two millionths longer, which shows in
coordinates of a state and never in a scene; it was given up in 2022, and is not offered."""


@dataclass(frozen=True, kw_only=True)
class Units:
    """Units of all that is shown: page, terminal, report, drawing and recording.

    Attributes
    ----------
    length
        ``m``; ``ft``: feet with decimals; ``ft-in``: feet, inches and fractions of an inch.
    speed
        ``km/h``, ``mph`` or ``m/s``.
    """

    length: LengthUnit = "m"
    speed: SpeedUnit = "km/h"


METRIC = Units()
IMPERIAL = Units(length="ft-in", speed="mph")
SHORT_FORMS = {"metric": METRIC, "imperial": IMPERIAL}
"""What project.yaml may say in one word."""


def units_from_options(options: tuple[tuple[str, object], ...]) -> Units:
    """Units as the options of a result name them; metric where none are named.

    Parameters
    ----------
    options
        Pairs of dotted key and value.
    """
    named = dict(options)
    length, speed = named.get("units.length"), named.get("units.speed")
    return Units(
        length=next((u for u in get_args(LengthUnit) if u == length), METRIC.length),
        speed=next((u for u in get_args(SpeedUnit) if u == speed), METRIC.speed),
    )

"""Sentences with their lengths and speeds in the units of the project.

Messages and tables are made in metres: they say ``1.40 m``, number, blank, unit. Where people read
them, `in_units` puts that into other units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from uavgram.model.case import case_from_options
from uavgram.model.result.result import Result
from uavgram.model.units import FOOT_M, Units
from uavgram.views.units import INCH_M, INCHES, feet_inches, fixed, quantity, shown, step_in_of

_NUMBER = r"[+\-−]?\d+(?:\.\d+)?(?:e[+\-]?\d+)?"
_SURE = r"\s?(?:±|\+-|×|–)\s?| x | to "
_PATTERN = re.compile(
    rf"(?<![\w.\-/'\"])(?P<numbers>{_NUMBER}(?:(?:{_SURE}|, | and | or ){_NUMBER})*)[ \u00a0]"
    r"(?P<unit>km/h|m/s|mm|cm|km|m²|m³|m2|m3|m)(?![\w²³/^])(?!-\w)(?!\.\w)"
)
_QUOTED = re.compile(r"(?<!\w)'[^'\n]*'(?!\w)|\"[^\"\n]*\"|`[^`\n]*`")
_OPTICS = re.compile(r"focal|film|35 mm|EXIF|lens\b|drone camera", re.IGNORECASE)
_SCALES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "m/s": 1.0, "km/h": 1 / 3.6}
_POWERS = {"m²": "m2", "m2": "m2", "m³": "m3", "m3": "m3"}
_SPEEDS = {"m/s", "km/h"}
_MILE_M = 5280 * FOOT_M


def in_units(text: str, units: Units, keep: Iterable[str] = ()) -> str:
    """A sentence with its lengths and speeds in other units; what is quoted stays as it is.

    Parameters
    ----------
    text
        Says numbers as ``1.40 m``: number, blank, unit.
    units
        Of the project.
    keep
        Names that people gave, which stay as they are though they look like lengths.
    """
    if units.length == "m" and not any(speed in text for speed in _SPEEDS - {units.speed}):
        return text
    if not _PATTERN.search(text):
        return text
    kept = [match.span() for match in _QUOTED.finditer(text)]
    kept += [m.span() for name in keep if name for m in re.finditer(re.escape(name), text)]
    is_optical = _OPTICS.search(text) is not None

    def replaced(match: re.Match[str]) -> str:
        start, end = match.span()
        if any(a <= start and end <= b for a, b in kept):
            return match[0]
        if match["unit"] == "mm" and is_optical:
            return match[0]
        return _converted(match["numbers"], match["unit"], units) or match[0]

    return _PATTERN.sub(replaced, text)


def names_like_lengths(result: Result) -> tuple[str, ...]:
    """Names of a survey that `in_units` would take for lengths, such as a line ``wall 4 m``."""
    named = (
        *result.points.label,
        *result.lines.name,
        *result.measurements.name,
        *result.known.name,
        *result.frames.frame_id,
        result.name,
        *(text for row in case_from_options(result.provenance.options) for text in row),
    )
    return like_lengths(named)


def like_lengths(names: Iterable[str]) -> tuple[str, ...]:
    """Those names that `in_units` would take for lengths."""
    return tuple(name for name in names if _PATTERN.search(name))


def _converted(numbers: str, unit: str, units: Units) -> str:
    """The same in other units; empty where it stays."""
    is_speed = unit in _SPEEDS
    if (is_speed and unit == units.speed) or (not is_speed and units.length == "m"):
        return ""
    parts = re.split(rf"({_SURE}|, | and | or )(?={_NUMBER})", numbers)
    told, between = parts[::2], parts[1::2]
    if any(b in (", ", " and ", " or ") for b in between) and not _alike(told):
        # "in photos 3 and 5.2 m": only the last belongs to the unit
        lead = numbers[: len(numbers) - len(told[-1])]
        return lead + _converted(told[-1], unit, units)
    if (
        len(told) == 2
        and between[0].strip() in ("±", "+-")
        and not is_speed
        and unit not in _POWERS
    ):
        value, sigma = (float(_plain(t)) * _SCALES[unit] for t in told)
        sign = "+" if told[0].startswith("+") else ""
        return sign + quantity(value, sigma, "m", units).replace("±", between[0].strip())
    return _one_by_one(told, between, unit, units)


def _alike(told: list[str]) -> bool:
    places = {len(text.partition(".")[2]) for text in told}
    return len(places) == 1 and places != {0}


def _plain(text: str) -> str:
    return text.replace("−", "-")


def _one_by_one(told: list[str], between: list[str], unit: str, units: Units) -> str:
    if units.length == "ft-in" and unit in ("m", "cm", "mm"):
        words = [_sentence_in(text, _SCALES[unit] / INCH_M) for text in told]
        return "".join(w + b for w, b in zip(words, [*between, ""], strict=True))
    if unit in _POWERS:
        one = shown(_POWERS[unit], units, max(abs(float(_plain(t))) for t in told))
        factor, symbol = one.factor, one.symbol
    elif unit == "km":
        factor, symbol = 1000.0 / _MILE_M, "mi"
    else:
        one = shown("m/s" if unit in ("m/s", "km/h") else "m", units)
        factor, symbol = one.factor * _SCALES[unit], one.symbol
    places = max(_places(text, factor) for text in told)
    words = [_rescaled(text, factor, places) for text in told]
    return "".join(w + b for w, b in zip(words, [*between, ""], strict=True)) + f" {symbol}"


def _places(text: str, factor: float) -> int:
    """Decimals of a number times a factor: about as exact as it was told, and two digits of it."""
    value = float(_plain(text)) * factor
    places = max(0, math.ceil(-math.log10(_resolution(text) * factor) - 1e-9))
    return min(max(places, 1 - math.floor(math.log10(abs(value)))), 6) if value else places


def _rescaled(text: str, factor: float, places: int) -> str:
    value = float(_plain(text)) * factor
    return ("+" if text.startswith("+") and value else "") + fixed(value, places)


def _resolution(text: str) -> float:
    mantissa, _, power = text.partition("e")
    return 10.0 ** (int(power or 0) - len(mantissa.partition(".")[2]))


def _sentence_in(text: str, inches: float) -> str:
    value, exact = float(_plain(text)) * inches, _resolution(text) * inches
    if abs(value) < INCHES:
        return f"{_rescaled(text, inches, _places(text, inches))} in"
    step = step_in_of(exact)
    while step > abs(value) / 10 and step > 1 / 16:
        step = 1.0 if step > 1.0 else step / 2
    return feet_inches(value, step, signed=text.startswith("+"))

"""Numbers as people type them: a decimal comma is taken where it can mean nothing else."""

from __future__ import annotations

import re

from uavgram.model.units import FOOT_M

_IMPERIAL = re.compile(r"(\d+(?:\.\d*)?)\s*(ft|feet|foot|'|in|inch|inches|\"|yd)", re.IGNORECASE)
_SCALES_M = {
    **dict.fromkeys(("ft", "feet", "foot", "'"), FOOT_M),
    **dict.fromkeys(("in", "inch", "inches", '"'), FOOT_M / 12),
    "yd": 3 * FOOT_M,
}
_COMMA = re.compile(r"[-+]?([0-9]*),([0-9]+)([eE][-+]?[0-9]+)?")
_THOUSANDS = re.compile(r"[1-9][0-9]{0,2}")


def has_decimal_comma(text: str) -> bool:
    """Whether a comma in a number can only be a decimal one: ``1,5`` and ``0,010``.

    Not in ``12,001``, which may be twelve thousand and one, nor beside a point.
    """
    found = _COMMA.fullmatch(text)
    if found is None:
        return False
    return len(found[2]) != 3 or bool(found[3]) or _THOUSANDS.fullmatch(found[1]) is None


def with_point(text: str) -> str:
    """``1.5`` for ``1,5``; any other text as it is."""
    return text.replace(",", ".") if "," in text and has_decimal_comma(text) else text


def comma_question(text: str) -> str:
    """What is asked of ``12,001``, as the end of a sentence; empty where nothing is unclear."""
    if _COMMA.fullmatch(text) is None or has_decimal_comma(text):
        return ""
    return f": is it {text.replace(',', '.')} or {text.replace(',', '')}? Write it without a comma"


def number_hint(text: str, whose: str) -> str:
    """Say why some text that looks like a number is none, as the end of a sentence.

    Parameters
    ----------
    text
        As a person typed it.
    whose
        Whose name states the unit, such as ``the column``.
    """
    if question := comma_question(text):
        return question
    digits = text.lstrip("+-")
    if "," in digits and digits.replace(",", "").replace(".", "").isdigit():
        return ": write it with one decimal point, and no comma"
    if digits.startswith("0") and digits.isdigit():
        return ": write it without the leading zero"
    if in_metres := _metres(digits):
        return f": write it in metres, {in_metres} (`uavgram pick` takes feet and inches too)"
    if digits[:1].isdigit() and (digits[-1].isalpha() or digits[-1] == "°"):
        return f": write the number alone, {whose}'s name says the unit"
    return ""


def _metres(text: str) -> str:
    """``4.02336`` for ``13.2 ft``; empty for what is not in feet, yards or inches."""
    found = _IMPERIAL.fullmatch(text)
    return "" if found is None else f"{float(found[1]) * _SCALES_M[found[2].lower()]:.7g}"


def number_text(value: float) -> str:
    """Shortest text that gives a float back, with a point in it: no parser takes it for text."""
    text = repr(value)
    mantissa, mark, exponent = text.partition("e")
    return text if "." in mantissa or not mark else f"{mantissa}.0e{exponent}"

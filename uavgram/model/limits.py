"""Numbers and names of a person's files: how they are typed, and their limits."""

from __future__ import annotations

import re
import unicodedata

from uavgram.model.naming import FOOT_M

LARGEST_NUMBER = 1e10
"""Of any number: metres, pixels, degrees and seconds since 1970 stay below it; beyond it they
overflow what follows."""

SMALLEST_SIGMA, LARGEST_SIGMA = 1e-6, 1e6
"""In metres, pixels, degrees and seconds: beyond them weights lose all digits of what they are
added to."""


def sigma_fault(value: float) -> str:
    """Say why a number can be no standard deviation; empty where it can."""
    if value <= 0:
        return "must be greater than 0"
    if not SMALLEST_SIGMA <= value <= LARGEST_SIGMA:
        return f"must lie between {SMALLEST_SIGMA:g} and {LARGEST_SIGMA:g}"
    return ""


def require(condition: bool, message: str) -> None:  # noqa: FBT001
    """Refuse a value, in words that name its key.

    Raises
    ------
    ValueError
        The condition does not hold.
    """
    if not condition:
        raise ValueError(message)


def require_sizes(owner: object, *names: str) -> None:
    """Refuse standard deviations and sizes below 0.

    Raises
    ------
    ValueError
        One of the named values, or of the values in it, is negative.
    """
    for name in names:
        value = getattr(owner, name)
        values = value if isinstance(value, tuple) else (value,)
        require(min(values, default=0.0) >= 0, f"{name} must not be negative")


UNSHOWABLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff"  # break lines, drive terminals
    "\u202a-\u202e\u2066-\u2069\u200e\u200f\u061c"  # turn the order of what is read
    # unseen
    "\u00ad\u180e\u200b\u2060-\u2065\u206a-\u206f\ufeff\ufff9-\ufffb\U000e0000-\U000e007f]"
    # Joiners belong to Persian, Indic scripts and emoji; behind a Latin letter they only hide.
    "|(?<![^\x00-\u02ff])[\u200c\u200d]"
)
"""Characters that no name can hold: they break lines, are no XML, or make what is read differ from
what is there (Unicode Technical Report 36, 2.6: bidirectional text spoofing)."""


def unshowable(text: str) -> str:
    """Say which character of a text no name can hold; empty where there is none."""
    found = UNSHOWABLE.search(text)
    if found is None:
        return ""
    character = found[0]
    if character in "\r\n":
        return "a line break"
    name = unicodedata.name(character, "").lower()
    if not name:
        return f"the control character {character!r}"
    return f"the invisible character U+{ord(character):04X} ({name})"


def shown(text: str) -> str:
    """Write a text for a message: what cannot be shown stands as its code point."""
    return UNSHOWABLE.sub(lambda found: ascii(found[0])[1:-1], text)


LONGEST_NAME = 200
"""Characters of a label, a photo, a length or a measurement."""


def length_fault(value: float) -> str:
    """Say why a number can be no length in metres; empty where it can."""
    return "must be greater than 0" if value <= 0 else number_fault(value)


def number_fault(value: float) -> str:
    """Say why a number can be none of a person's; empty where it can."""
    if not abs(value) <= LARGEST_NUMBER:
        return f"must lie between {-LARGEST_NUMBER:g} and {LARGEST_NUMBER:g}"
    return ""


def name_fault(name: str) -> str:
    """Say why a name is too long; empty where it is not."""
    if len(name) > LONGEST_NAME:
        return f"may have {LONGEST_NAME} characters, and this one has {len(name)}: shorten it"
    return ""


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

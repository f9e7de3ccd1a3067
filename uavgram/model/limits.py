"""Limits of numbers and names in a user's files, and how they are typed."""

from __future__ import annotations

import datetime as dt
import re
import unicodedata
from collections.abc import Collection

from uavgram.errors import suggest_spelling
from uavgram.model.naming import FOOT_M, format_digits

LARGEST_NUMBER = 1e10
"""Largest magnitude of any number.

Metres, pixels, degrees and seconds since 1970 are below it; larger values would overflow later
computations.
"""

LEAP_YEAR = 2024
"""Year of a date that is written without one: it has a 29 February."""

YEAR_DIGITS = 4
"""Digits of a year that is written in full."""

SMALLEST_SIGMA, LARGEST_SIGMA = 1e-6, 1e6
"""Limits of a standard deviation in metres, pixels, degrees or seconds.

Weights beyond them make the other terms of a sum lose all their digits.
"""

LARGEST_READING_SIGMA_M = 1.0
"""Largest standard deviation of a tape reading: a larger one is in another unit than metres."""

LARGEST_LENGTH_M = 1e5
"""Largest known length: a larger one is in another unit than metres."""

RANGES = (
    (re.compile(r"^reading_sigma_m$"), SMALLEST_SIGMA, LARGEST_READING_SIGMA_M),
    (re.compile(r"sigma|straightness"), SMALLEST_SIGMA, LARGEST_SIGMA),
    (re.compile(r"latitude_deg$"), -90.0, 90.0),
    (re.compile(r"longitude_deg$"), -360.0, 360.0),
    (re.compile(r"^length_m$"), SMALLEST_SIGMA, LARGEST_LENGTH_M),
    (re.compile(r""), -LARGEST_NUMBER, LARGEST_NUMBER),
)
"""Least and greatest number in a field of a file or of the page, by a pattern of its name."""


def range_of(field: str) -> tuple[float, float]:
    """Return the least and the greatest number that a field may have, by its name."""
    return next((least, most) for pattern, least, most in RANGES if pattern.search(field))


def find_value_fault(field: str, value: float) -> str:
    """Return why a field cannot have a number, by its name; empty where it can.

    It holds for project files, tables and the page alike.
    """
    least, most = range_of(field)
    if least > 0 and value <= 0:
        return "must be greater than 0"
    if not least <= value <= most:
        return f"must lie between {format_digits(least, 6)} and {format_digits(most, 6)}"
    return ""


def find_number_fault(value: float) -> str:
    """Return why a number of any unit is out of range; empty where it is not."""
    return find_value_fault("", value)


def find_length_fault(value: float) -> str:
    """Return why a number cannot be a length in metres; empty where it can."""
    return find_value_fault("length_m", value)


def find_choice_fault(word: str, known: Collection[str]) -> str:
    """Return why a word is none of those that a field may have; empty where it is."""
    if word in known:
        return ""
    hint = f": {guess}" if (guess := suggest_spelling(word, known)) else ""
    return f"must be {' or '.join(known)} (got {word!r}){hint}"


def require(condition: bool, message: str) -> None:  # noqa: FBT001
    """Raise an error whose message names the key, unless a condition holds.

    Raises
    ------
    ValueError
        The condition does not hold.
    """
    if not condition:
        raise ValueError(message)


def require_sizes(owner: object, *names: str) -> None:
    """Reject negative standard deviations and sizes.

    Raises
    ------
    ValueError
        One of the named values, or an entry of a named tuple, is negative.
    """
    for name in names:
        value = getattr(owner, name)
        values = value if isinstance(value, tuple) else (value,)
        require(min(values, default=0.0) >= 0, f"{name} must not be negative")


UNSHOWABLE = re.compile(
    "[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufffe\uffff"  # line breaks, control characters
    "\u202a-\u202e\u2066-\u2069\u200e\u200f\u061c"  # reverse the reading direction
    # invisible characters
    "\u00ad\u180e\u200b\u2060-\u2065\u206a-\u206f\ufeff\ufff9-\ufffb\U000e0000-\U000e007f]"
    # Joiners are part of Persian, Indic scripts and emoji; after a Latin letter they are only
    # invisible.
    "|(?<![^\x00-\u02ff])[\u200c\u200d]"
)
"""Characters forbidden in names.

Line breaks, characters invalid in XML, and characters that make the displayed text differ from the
stored one (Unicode Technical Report 36, 2.6: bidirectional text spoofing).
"""


def find_unshowable(text: str) -> str:
    """Return the first character of a text that is forbidden in names; empty without any."""
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


_DATE = re.compile(r"(\d{1,4})([-./])\s*(\d{1,2})(?:\2\s*(\d{2,4})?)?")


def find_date_fault(text: str) -> str:
    """Return why a text is no date; empty for dates, in any words with numbers, and for no text."""
    if text.strip() and not any(map(str.isdigit, text)):
        return f"{text.strip()} is no date: write day, month and year, such as 2026-05-09"
    written = _DATE.fullmatch(text.strip())
    if written is None:
        return ""
    first, second, third = int(written[1]), int(written[3]), int(written[4] or LEAP_YEAR)
    is_year_first = len(written[1]) == YEAR_DIGITS
    orders = (third, second, first), (third, first, second), (first, second, third)
    for year, month, day in orders[2:] if is_year_first else orders[:2]:
        try:
            dt.date(year, month, day)
        except ValueError:
            continue
        return ""
    return f"there is no such date as {text.strip()}: check day and month"


def escape_unshowable(text: str) -> str:
    """Replace the forbidden characters of a text by their code points, for a message."""
    return UNSHOWABLE.sub(lambda found: ascii(found[0])[1:-1], text)


LONGEST_NAME = 200
"""Largest number of characters in a label, or in the name of a photo, length or measurement."""


def find_name_fault(name: str) -> str:
    """Return why a name is too long; empty where it is not."""
    if len(name) > LONGEST_NAME:
        return f"may have {LONGEST_NAME} characters, and this one has {len(name)}: shorten it"
    return ""


_IMPERIAL = re.compile(r"(\d+(?:\.\d*)?)\s*(ft|feet|foot|'|inches|inch|in|\"|yd)", re.IGNORECASE)
_SCALES_M = {
    **dict.fromkeys(("ft", "feet", "foot", "'"), FOOT_M),
    **dict.fromkeys(("in", "inch", "inches", '"'), FOOT_M / 12),
    "yd": 3 * FOOT_M,
}
_COMMA = re.compile(r"[-+]?([0-9]*),([0-9]+)([eE][-+]?[0-9]+)?")
_THOUSANDS = re.compile(r"[1-9][0-9]{0,2}")


def has_decimal_comma(text: str) -> bool:
    """Return whether a comma in a number can only be a decimal comma: ``1,5`` and ``0,010``.

    False for ``12,001``, which may mean twelve thousand and one, and next to a decimal point.
    """
    found = _COMMA.fullmatch(text)
    if found is None:
        return False
    return len(found[2]) != 3 or bool(found[3]) or _THOUSANDS.fullmatch(found[1]) is None


def replace_decimal_comma(text: str) -> str:
    """Replace a decimal comma by a point: ``1.5`` for ``1,5``; other texts are unchanged."""
    return text.replace(",", ".") if "," in text and has_decimal_comma(text) else text


def comma_question(text: str) -> str:
    """Return the question about an ambiguous comma, as in ``12,001``; empty where it is clear."""
    if _COMMA.fullmatch(text) is None or has_decimal_comma(text):
        return ""
    return f": is it {text.replace(',', '.')} or {text.replace(',', '')}? Write it without a comma"


def number_hint(text: str, whose: str) -> str:
    """Return why a text that looks like a number is not one, as the end of a sentence.

    Parameters
    ----------
    text
        Text as typed by the user.
    whose
        Thing whose name states the unit, such as ``the column``.
    """
    if question := comma_question(text):
        return question
    digits = text.lstrip("+-")
    if "," in digits and digits.replace(",", "").replace(".", "").isdigit():
        return ": write it with one decimal point, and no comma"
    if digits.startswith("0") and digits.isdigit():
        return ": write it without the leading zero"
    if digits and (in_metres := _metres(digits)):
        return f": write it in metres, {in_metres} (`uavgram pick` takes feet and inches too)"
    if digits[:1].isdigit() and (digits[-1].isalpha() or digits[-1] == "°"):
        return f": write the number alone, {whose}'s name says the unit"
    return ": write a number, such as 12.5" if text else ""


def _metres(text: str) -> str:
    """Convert feet, yards, inches to metres: ``4.02336`` for ``13.2 ft``; empty otherwise."""
    if _IMPERIAL.sub("", text).strip():
        return ""
    parts = _IMPERIAL.finditer(text)
    return f"{format_digits(sum(float(one[1]) * _SCALES_M[one[2].lower()] for one in parts), 7)}"


def number_text(value: float) -> str:
    """Return the shortest text that gives a float back, with a point: YAML reads a number."""
    text = repr(value)
    mantissa, mark, exponent = text.partition("e")
    return text if "." in mantissa or not mark else f"{mantissa}.0e{exponent}"

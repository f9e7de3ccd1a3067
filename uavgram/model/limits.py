"""What numbers of a person's files can be: beyond it they are slips, and overflow what follows."""

LARGEST_NUMBER = 1e10
"""Of any number: metres, pixels, degrees and seconds since 1970 stay below it."""

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

"""How many readings of a kind may be gross errors before none of them can be trusted.

A robust estimate follows the majority (Hampel 1971, "A general qualitative definition of
robustness"): with about half of the readings wrong, these may be the ones that it follows.
"""

from __future__ import annotations

MOST_OF_A_KIND = 0.4
"""Share of a kind's observations, or of the frames, that may be gross errors: were there more, the
kind would be less exact than stated, or nothing would show which of them are right."""


def most_gross(count: int) -> int:
    """Count how many of so many observations may be gross errors: a few, and one in any case."""
    return max(1, int(MOST_OF_A_KIND * count))

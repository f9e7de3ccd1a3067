"""Lengths as the sheet says them: as exact as they are needed in the field.

In metric units; `views.unit_words.in_units` puts what is shown into others.
"""

from __future__ import annotations

import math


def metres(length_m: float) -> str:
    """``14.2 m``; ``40 m``."""
    return f"{round(length_m, 1):g} m" if length_m < 100 else f"{length_m:.0f} m"


def centimetres(*several_m: float) -> str:
    """``1.2 to 1.4 cm``; from a metre on ``1.3 m``; an en dash where there is none."""
    if not all(map(math.isfinite, several_m)):
        return "–"
    is_large = max(several_m) >= 1.0
    scale, unit = (1.0, "m") if is_large else (100.0, "cm")
    return " to ".join(f"{scale * one:.1f}" for one in several_m) + f" {unit}"

"""Lengths as text, as exact as they are needed in the field.

They are metric; `views.unit_words.in_units` converts the shown texts to other units.
"""

from __future__ import annotations

import math


def metres(length_m: float) -> str:
    """Format a length in metres: ``14.2 m``; ``40 m``."""
    return f"{round(length_m, 1):g} m" if length_m < 100 else f"{length_m:.0f} m"


def centimetres(*several_m: float) -> str:
    """Format lengths: ``1.2 to 1.4 cm``; from a metre on ``1.3 m``; an en dash if not finite."""
    if not all(map(math.isfinite, several_m)):
        return "–"
    is_large = max(several_m) >= 1.0
    scale, unit = (1.0, "m") if is_large else (100.0, "cm")
    return " to ".join(f"{scale * one:.1f}" for one in several_m) + f" {unit}"

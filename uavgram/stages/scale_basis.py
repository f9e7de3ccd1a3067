"""What the scale of a survey rests on, in one sentence that every result has."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.measuring.scale import NOTHING, scale_sigmas
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.model.message import Message
from uavgram.model.naming import figures


def scale_basis(adjustment: Adjustment) -> tuple[Message, ...]:
    """One message: what gives the scale, and how well all else confirms it."""
    found = scale_sigmas(adjustment)
    witnesses = _witnesses(adjustment)
    rest = " and ".join([", ".join(witnesses[:-1])] * (len(witnesses) > 1) + witnesses[-1:])
    verb = "confirm" if len(witnesses) > 1 or rest.endswith("s") else "confirms"
    if not np.isfinite(found.lengths):
        alone = "alone" if len(witnesses) == 1 else "together, without a length"
        text = f"The scale rests on {rest} {alone}: ± {_percent(found.all)} %."
        return (Message("info", "scale-basis", text),)
    own = f"your lengths (± {_percent(found.lengths)} %)"
    if not found.others < NOTHING:
        text = (
            f"The scale rests on {own}; nothing else confirms it: a tape that is 1 % wrong makes "
            "every result 1 % wrong, and nothing shows it."
        )
    elif found.others < found.lengths:
        text = f"The scale rests on {rest} (± {_percent(found.others)} %) more than on {own}."
    else:
        text = f"The scale rests on {own}; {rest} {verb} it to ± {_percent(found.others)} %."
    return (Message("info", "scale-basis", text),)


def _witnesses(adjustment: Adjustment) -> list[str]:
    """Name what else may confirm the scale."""
    observations = reversed(adjustment.problem.observations.values())
    names = [name for observation in observations for name in observation.witness()]
    return names or ["the stated heights"]


def _percent(share: float) -> str:
    """Two digits of a share, in per cent."""
    return f"{figures(100.0 * share)}" if share < 1.0 else "100 or more"

"""What the page is sent, with the lengths in its sentences in the units of the project.

Numbers stay in metres, as they are sent: the page shows them in these units itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from uavgram.model.units import Units
from uavgram.picking.document.state import State
from uavgram.views.unit_words import in_units, like_lengths

SENTENCES = frozenset({"text", "plain", "words", "why", "fault", "reason", "shows", "unseen"})
"""Keys of what people read."""

_WITHOUT = frozenset({"state", "diff", "picks", "predicted", "expected", "found", "asked"})
"""Keys below which there are no sentences, but much else."""


def names_to_keep(state: State) -> tuple[str, ...]:
    """Names that people gave, and that look like lengths."""
    named = (
        *(pick.label for pick in state.picks),
        *(line.name for line in state.lines),
        *(request.name for request in state.requests),
    )
    return like_lengths(dict.fromkeys(named))


def in_project_units(message: Any, units: Units, keep: Iterable[str]) -> Any:  # noqa: ANN401 (JSON)
    """A message with its sentences in other units.

    Parameters
    ----------
    message
        JSON.
    units
        Of the project.
    keep
        Names that stay as they are.
    """
    if isinstance(message, list):
        return [in_project_units(one, units, keep) for one in message]
    if not isinstance(message, dict):
        return message
    return {key: _value(key, value, units, keep) for key, value in message.items()}


def _value(key: str, value: Any, units: Units, keep: Iterable[str]) -> Any:  # noqa: ANN401 (JSON)
    if isinstance(value, str):
        return in_units(value, units, keep) if key in SENTENCES else value
    if key in _WITHOUT or not isinstance(value, dict | list):
        return value
    if key in SENTENCES and all(isinstance(one, str) for one in value):  # several sentences
        return [in_units(one, units, keep) for one in value]
    return in_project_units(value, units, keep)

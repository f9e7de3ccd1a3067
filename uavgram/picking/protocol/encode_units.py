"""Numbers and sentences in messages to the page, in the project's units.

A function in a message is the text of a number: `convert_units` calls it with the units. The page
gets numbers in metres beside it where it draws them or where people edit them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

from uavgram.model.naming import Units
from uavgram.picking.document.state import State
from uavgram.picking.protocol.messages import Words
from uavgram.views.units import (
    convert_sentence,
    format_fixed,
    quantity,
    select_like_lengths,
    sorted_magnitudes,
    table_unit,
    value_text,
)

SENTENCES = frozenset({"text", "plain", "words", "why", "fault", "reason", "shows", "unseen"})
"""Keys of sentences for people."""

_WITHOUT = frozenset({"state", "diff", "picks", "predicted", "expected", "found", "asked"})
"""Keys below which there are no sentences, but much other data."""


def quantity_words(value: float, sigma: float, unit: str) -> Words:
    """Return the text of a value with its sigma; alone without one, empty without a value.

    Parameters
    ----------
    value, sigma
        NaN where there is none.
    unit
        Unit of both, as in results.json.
    """
    if not math.isfinite(value):
        return lambda _: ""
    return partial(quantity if math.isfinite(sigma) else value_text, value, sigma, unit)


def table_words(value_m: float, places: int) -> Words:
    """Return the text of a length in a column that has its unit in the head; empty for NaN."""

    def words(units: Units) -> str:
        known = math.isfinite(value_m)
        return format_fixed(value_m * table_unit(units).factor, places) if known else ""

    return words


def list_kept_names(state: State) -> tuple[str, ...]:
    """Return names given by people that look like lengths."""
    named = (
        *(pick.label for pick in state.picks),
        *(line.name for line in state.lines),
        *(request.name for request in state.requests),
    )
    return select_like_lengths(dict.fromkeys(named))


def collect_lengths(message: Any, state: State) -> tuple[float, ...]:  # noqa: ANN401 (JSON)
    """Return the lengths that the sentences of a message give rounded [m], ascending.

    Parameters
    ----------
    message
        Message as sent.
    state
        Picked state.
    """
    values = [value for line in state.lines for value in (line.length_m, line.sigma_m)]
    if message.get("mode") == "adjusted":
        values += [line["adjusted_m"] for line in message["lines"].values()]
        measured = [one for one in message["measurements"].values() if one["unit"] == "m"]
        values += [one[key] for one in measured for key in ("value", "sigma")]
    return sorted_magnitudes(values)


def convert_units(
    message: Any,  # noqa: ANN401 (JSON)
    units: Units,
    keep: Iterable[str],
    exact: Sequence[float] = (),
) -> Any:  # noqa: ANN401 (JSON)
    """Return a message with its sentences in other units.

    Parameters
    ----------
    message
        JSON.
    units
        Units of the project.
    keep
        Names that stay unchanged.
    exact
        Exact lengths [m], ascending, that the sentences give rounded.
    """
    worded = partial(convert_sentence, units=units, keep=keep, exact=exact)
    inner = partial(convert_units, units=units, keep=keep)

    def value_of(key: str, value: Any) -> Any:  # noqa: ANN401 (JSON)
        if callable(value):
            return value(units)
        if isinstance(value, str):
            return worded(value) if key in SENTENCES else value
        if key in _WITHOUT or not isinstance(value, dict | list):
            return value
        if key in SENTENCES and all(isinstance(one, str) for one in value):  # a list of sentences
            return [worded(one) for one in value]
        return inner(value, exact=exact)

    if callable(message):
        return message(units)
    if isinstance(message, list):
        return [inner(one, exact=exact) for one in message]
    if not isinstance(message, dict):
        return message
    if "changes" in message:  # a button's text gives the length that it would set
        made = [change.get("length_m") for change in message["changes"]]
        exact = sorted_magnitudes([*exact, *made])
        worded = partial(convert_sentence, units=units, keep=keep, exact=exact)
    return {key: value_of(key, value) for key, value in message.items()}

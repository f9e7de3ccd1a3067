"""Numbers, places and sentences as JSON for the page, in the project's units; NaN becomes null.

A function in a message is the text of a number: `word_for_page` calls it with the units. The page
gets numbers in metres beside it where it draws them or where people edit them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import PredictedPixels
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.model.arrays import Floats
from uavgram.model.naming import METRIC, Units
from uavgram.picking.document.state import State
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.ways_on_page import name_on_page
from uavgram.pipeline.pick.live_survey import LiveAdjustment
from uavgram.views.units import (
    convert_sentence,
    format_fixed,
    format_quantity,
    format_value,
    select_like_lengths,
    sort_magnitudes,
    table_unit,
)

_DIGITS = 7
DEGREE_DIGITS = 9
"""Decimals of a degree: a tenth of a millimetre."""

SENTENCES = frozenset(
    {"text", "plain", "words", "why", "fault", "reason", "reasons", "shows", "unseen", "unusable"}
)
"""Keys of sentences for people."""

_WITHOUT = frozenset({"state", "diff", "picks", "predicted", "expected", "found", "asked"})
"""Keys below which there are no sentences, but much other data."""


def number(value: float, digits: int = _DIGITS) -> float | None:
    """Return a number rounded for JSON; None if it is not finite."""
    return round(float(value), digits) if math.isfinite(value) else None


def numbers(values: Iterable[float], digits: int = _DIGITS) -> list[float | None]:
    """Return numbers rounded for JSON."""
    return [number(value, digits) for value in values]


def places_json(places: PredictedPixels, index: Mapping[str, int]) -> list[m.Predicted]:
    """Return labels in photos in which they are not picked, with error ellipses.

    Parameters
    ----------
    places
        Pixels with covariances.
    index
        Numbers of the photos by name.
    """
    pixels = places.pixel_px.round(3).tolist()
    rows = zip(places.frame_id, places.label, pixels, places.covariance_px2, strict=True)
    return [
        {
            "image": index[frame],
            "label": label,
            "pixel_px": (u, v),
            "spread": ellipse_json(covariance),
        }
        for frame, label, (u, v), covariance in rows
    ]


def ellipse_json(covariance_px2: Floats) -> m.Spread:
    """Return one-sigma half-axes [px] and the direction of the major one from u towards v [deg]."""
    # eigenvalues in ascending order: variances along the minor and the major axis
    value, vector = np.linalg.eigh(covariance_px2)
    minor, major = np.sqrt(np.maximum(value, 0.0))
    turn_deg = math.degrees(math.atan2(vector[1, 1], vector[0, 1]))
    return {
        "major_px": number(major, 3),
        "minor_px": number(minor, 3),
        "turn_deg": number(turn_deg, 3),
    }


def places_on_earth(
    adjusted: LiveAdjustment, label: Sequence[str], position_world_m: Floats
) -> dict[str, list[float]]:
    """Return latitude and longitude [deg] by label.

    Parameters
    ----------
    adjusted
        Adjustment with the requested points and the origin of the local world.
    label, position_world_m
        (K,), (K, 3) points, as adjusted or moved since.

    Returns
    -------
    places
        Empty if the survey is not tied to the earth.
    """
    world, requests = adjusted.result.world, adjusted.observed.requests
    asked = {request.points[0] for request in requests if request.kind == "coordinate"}
    rows = [k for k, name in enumerate(label) if name in asked]
    if world.origin is None:
        return {}
    latitude, longitude, _ = geodetic_from_enu(position_world_m[rows], world.origin)
    return {
        label[k]: [round(degrees, DEGREE_DIGITS) for degrees in place]
        for k, *place in zip(rows, latitude.tolist(), longitude.tolist(), strict=True)
        if np.isfinite(place).all()
    }


def quantity_words(value: float, sigma: float, unit: str) -> m.Words:
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
    return partial(format_quantity if math.isfinite(sigma) else format_value, value, sigma, unit)


def table_words(value_m: float, places: int) -> m.Words:
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
    return sort_magnitudes(values)


def word_for_page(
    message: Any,  # noqa: ANN401 (JSON)
    units: Units = METRIC,
    keep: Iterable[str] = (),
    exact: Sequence[float] = (),
) -> Any:  # noqa: ANN401 (JSON)
    """Return a message with its sentences in the project's units, and in the words of the page.

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
    if isinstance(message, dict) and "changes" in message:
        # The text of a button gives the length that it would set.
        made = [change.get("length_m") for change in message["changes"]]
        exact = sort_magnitudes([*exact, *made])
    inner = partial(word_for_page, units=units, keep=keep, exact=exact)
    worded = partial(_word_sentence, units=units, keep=keep, exact=exact)

    def value_of(key: str, value: Any) -> Any:  # noqa: ANN401 (JSON)
        if callable(value):
            return value(units)
        if isinstance(value, str):
            return worded(value) if key in SENTENCES else value
        if key in _WITHOUT or not isinstance(value, dict | list):
            return value
        if key in SENTENCES and all(isinstance(one, str) for one in value):  # a list of sentences
            return [worded(one) for one in value]
        return inner(value)

    if callable(message):
        return message(units)
    if isinstance(message, list):
        return [inner(one) for one in message]
    if not isinstance(message, dict):
        return message
    return {key: value_of(key, value) for key, value in message.items()}


def _word_sentence(sentence: str, units: Units, keep: Iterable[str], exact: Sequence[float]) -> str:
    return name_on_page(convert_sentence(sentence, units, keep, exact))

"""Numbers and results in words, the same in the terminal, the report and the recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.known_kinds import ALL_KINDS
from uavgram.estimation.survey.observations.kinds import KINDS
from uavgram.model.arrays import Floats, Ints
from uavgram.model.naming import METRIC, Units, format_digits
from uavgram.model.observations import MEASUREMENT_FORMS
from uavgram.model.result.result import Result
from uavgram.model.result.tables import HeightSource, MeasurementResults
from uavgram.views import units as shown_units

NOT_COMPUTED = "not computed"

NOT_UNIQUE = (
    'Values with "or" are not unique: other explanations of the observations give the other '
    "values. Sigma and interval include the likely ones."
)

LEVEL_RANK = {"error": 0, "warning": 1, "info": 2}
"""Order in which messages are shown."""

MIN_SHIFT = 1e-4
"""Smallest shift that is shown with two digits, in the unit of its value."""

UNIT_WORDS = {"m": "m", "m2": "m²", "m3": "m³", "deg": "°", "m/s": "m/s"}

KIND_WORDS = {str(name): form.words for name, form in MEASUREMENT_FORMS.items()}
KNOWN_WORDS = {name: kind.shown for name, kind in ALL_KINDS.items() if kind.shown}

SIGNED_KINDS = frozenset(name for name, form in MEASUREMENT_FORMS.items() if form.is_signed)

LINE_STATUS_WORDS = {
    "used": "used",
    "suspect": "SUSPECT",
    "removed": "removed",
    "checked": "withheld, judged",
    "unseen": "not seen",
}
KNOWN_STATUS_WORDS = LINE_STATUS_WORDS | {"idle": "no effect"}

FRAME_STATUS_WORDS = {
    "refined": "refined",
    "seeded": "no picks",
    "unmatched": "not in the log",
    "rejected": "rejected",
}

GROUP_WORDS = {name: kind.words for name, kind in KINDS.items()}
"""Names of groups of observations; further areas of the ground are called ``plane of NAME``."""

FRAME_STATE_WORDS = {**FRAME_STATUS_WORDS, "check": "to check"}

BRIGHTENED = "brightened for display"
"""Note for a picture that is shown brighter than its file, which is not changed."""

WHY_TO_NEIGHBOURS = (
    "The accuracy of a point is that of its distances to the points next to it: ± is the "
    "standard deviation of such a distance, the middle one of up to five. Points far away do not "
    "change it."
)

WHY_TWO_ELLIPSES = (
    "Ellipses within the survey are free of the shift and turn that all points have in common, "
    "such as the bias of the flight's receiver; ellipses on the earth contain it. It cancels in "
    "lengths, areas and angles."
)


def number(value: float, decimals: int = 3, *, signed: bool = False) -> str:
    """Format a number with fixed decimals; an en dash for NaN, and no negative zero.

    Parameters
    ----------
    value
        Any number.
    decimals
        Number of decimals.
    signed
        Whether a positive value has a plus sign.
    """
    if not math.isfinite(value):
        return "–"
    return shown_units.format_fixed(value, decimals, signed=signed)


def size_text(length_m: float, units: Units = METRIC) -> str:
    """Format a length: ``4.2 cm`` or ``4.92 m``."""
    decimals: tuple[int, str] = (1, "cm") if length_m < 1.0 else (2, "m")
    return shown_units.format_length(length_m, units, *decimals)


def axes_text(semi_axes_m: Floats, units: Units = METRIC) -> str:
    """Format the half axes of an ellipse: ``3.0 cm × 2.2 cm``; an en dash if it has no shape."""
    if not semi_axes_m[0] > 0:
        return "–"
    return " × ".join(size_text(float(axis), units) for axis in semi_axes_m)


def chance(probability: float) -> str:
    """Format a probability to three decimals; smaller ones give ``< 0.001``."""
    return "< 0.001" if probability < 0.001 else number(probability, 3)


def plus_minus(value: float, sigma: float, decimals: int = 3, *, signed: bool = False) -> str:
    """Format a value and its standard deviation to the same decimals: ``12.345 ± 0.021``.

    Parameters
    ----------
    value, sigma
        In one unit; NaN: an en dash.
    decimals
        Decimals of both.
    signed
        Whether a positive value has a plus sign.
    """
    return f"{number(value, decimals, signed=signed)} ± {number(sigma, decimals)}"


def each_plus_minus(values: Floats, sigmas: Floats, decimals: int = 3) -> str:
    """Format several values with their standard deviations: ``0.12 ± 0.02, 1.50 ± 0.03``.

    Parameters
    ----------
    values, sigmas
        (n,) in one unit.
    decimals
        Decimals of all.
    """
    pairs = zip(values, sigmas, strict=True)
    return ", ".join(plus_minus(*pair, decimals) for pair in pairs)


def height_text(height_m: float, sigma_m: float, source: HeightSource) -> str:
    """Format a point's height above the ground with its source: ``1.402 ± 0.021 m, found``.

    Parameters
    ----------
    height_m, sigma_m
        Height above the ground below, and its standard deviation.
    source
        Source of the height.
    """
    if source == "ground":
        return "on it"
    if source in ("free", "found"):
        unasked = "" if source == "free" else ", though its picks have it on the ground"
        return f"{plus_minus(height_m, sigma_m)} m, found{unasked}"
    if sigma_m > 0:
        return f"{plus_minus(height_m, sigma_m)} m, stated and adjusted"
    return f"{number(height_m)} m, as stated"


def parameter_text(value: float, sigma: float) -> str:
    """Format a camera parameter: two digits of the sigma, and the value to as many decimals."""
    if not sigma > 0:
        return f"{format_digits(value, 6)}, held"
    return plus_minus(value, sigma, max(0, 1 - math.floor(math.log10(sigma))))


def format_with_sigma(value: float, sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format a value with its sigma: ``12.345 ± 0.021 m``, or in other units.

    Parameters
    ----------
    value, sigma
        NaN if not computed.
    unit
        Unit of both, as in results.json.
    units
        Units in which they are shown.
    """
    if not math.isfinite(value):
        return NOT_COMPUTED
    return shown_units.format_quantity(value, sigma, unit, units)


def format_interval(low: float, high: float, sigma: float, unit: str, units: Units = METRIC) -> str:
    """Format an interval: ``12.304 to 12.386 m``, or an en dash.

    Parameters
    ----------
    low, high
        Its ends; NaN if there is none.
    sigma
        Standard deviation of the value: it defines the number of decimals.
    unit
        Unit of all three, as in results.json.
    units
        Units in which they are shown.
    """
    if not (math.isfinite(low) and math.isfinite(high)):
        return "–"
    return shown_units.format_values((low, high), sigma, unit, units, " to ")


def alternatives_text(measurements: MeasurementResults, row: int, units: Units = METRIC) -> str:
    """Format the values of other solutions that fit as well: ``or 31.25, 44.91 m``; empty if none.

    Parameters
    ----------
    measurements
        Measurements of a result.
    row
        Row of the measurement.
    units
        Units in which they are shown.
    """
    values, unit = measurements.alternative_values[row], measurements.unit[row]
    if not values:
        return ""
    return (
        f"or {shown_units.format_values(values, float(measurements.sigma[row]), unit, units, ', ')}"
    )


class MeasurementText(NamedTuple):
    """Measurement in words, the same in every table that shows it.

    Attributes
    ----------
    name, kind
        Name and kind of the measurement.
    points
        Labels.
    value
        Value with standard deviation and unit.
    interval
        95 % interval.
    relative
        Standard deviation in percent of the value.
    others
        Values of other solutions that fit as well; empty if there are none.
    """

    name: str
    kind: str
    points: tuple[str, ...]
    value: str
    interval: str
    relative: str
    others: str


def measurement_text(rows: MeasurementResults, row: int, units: Units = METRIC) -> MeasurementText:
    """Describe a measurement in words.

    Parameters
    ----------
    rows
        Measurements of a result.
    row
        Row of the measurement.
    units
        Units in which it is shown.
    """
    value, sigma, unit = float(rows.value[row]), float(rows.sigma[row]), rows.unit[row]
    low, high = map(float, rows.interval_95[row])
    return MeasurementText(
        name=rows.name[row],
        kind=KIND_WORDS.get(rows.kind[row], rows.kind[row]),
        points=rows.points[row],
        value=format_with_sigma(value, sigma, unit, units),
        interval=format_interval(low, high, sigma, unit, units),
        relative="–"
        if rows.kind[row] in SIGNED_KINDS
        else format_relative_sigma(value, sigma, unit),
        others=alternatives_text(rows, row, units),
    )


def format_relative_sigma(value: float, sigma: float, unit: str) -> str:
    """Format sigma in percent of the value; an en dash for angles, zero and NaN.

    Parameters
    ----------
    value, sigma
        In one unit.
    unit
        As in results.json.
    """
    if unit == "deg" or not math.isfinite(value) or value == 0:
        return "–"
    return f"{100 * sigma / abs(value):.2f} %"


def shift_text(shift: float, unit: str) -> str:
    """Format a shift with two digits and its unit; an en dash if there is none."""
    if not math.isfinite(shift):
        return "–"
    places = max(0, 1 - math.floor(math.log10(abs(shift)))) if abs(shift) > MIN_SHIFT else 3
    return f"{abs(shift):.{places}f} {UNIT_WORDS.get(unit, unit)}"


def relief_text(units: Units) -> str:
    """Return the relief to which shifts in results.json refer: 10 cm, or the same in inches."""
    return "10 cm" if units.length == "m" else "3.9 in"


def utc(time_utc_s: float) -> str:
    """Format a time as ``2026-01-05 11:00:02.40`` or an en dash."""
    if not math.isfinite(time_utc_s):
        return "–"
    return datetime.fromtimestamp(time_utc_s, tz=UTC).strftime("%Y-%m-%d %H:%M:%S.%f")[:-4]


def describe_origin(result: Result) -> str:
    """Describe the origin of the world in one sentence."""
    world = result.world
    if world.origin is None and world.gauge == "world":
        return (
            "Coordinates are those of the control points and lines. Their position on the earth "
            "is unknown, so there is no map."
        )
    if world.origin is None:
        return (
            "No telemetry ties this survey to the earth. Shapes, lengths and angles are valid; "
            "position and north are arbitrary, so there is no map."
        )
    datum = {"msl": "mean sea level", "ellipsoid": "the WGS 84 ellipsoid"}[world.height_datum]
    latitude, longitude, height = world.origin
    return (
        f"Origin: latitude {latitude:.7f}°, longitude {longitude:.7f}°, "
        f"{height:.2f} m above {datum}."
    )


def order_worst_first(measurements: MeasurementResults) -> Ints:
    """Order the measurements: without value, not unique, then the least certain.

    Uncertainty is compared relative to the value; for angles as the angle itself in radians; for
    coordinates and heights, whose value is no measure of scale, relative to the median measured
    distance. If other solutions give other values, the largest difference replaces sigma.

    Returns
    -------
    (M,) indices; ties keep the order of the request.
    """
    value, sigma = np.abs(measurements.value), measurements.sigma
    kind, unit = np.array(measurements.kind, dtype=str), np.array(measurements.unit, dtype=str)
    signed = np.isin(kind, list(SIGNED_KINDS))
    lengths = value[(unit == "m") & ~signed & np.isfinite(value)]
    typical_m = float(np.median(lengths)) if lengths.size else 1.0
    scale = np.where(signed, max(typical_m, 1e-9), np.maximum(value, 1e-9))
    away = [
        max((abs(other - here) for other in others), default=0.0)
        for others, here in zip(measurements.alternative_values, measurements.value, strict=True)
    ]
    unsure, is_known = measurements.is_ambiguous, np.isfinite(value)
    # spread: sigma, or the distance to the farthest alternative value
    spread = np.where(unsure, np.array(away), sigma)
    badness = np.where(unit == "deg", np.radians(spread), spread / scale)
    badness = np.where(is_known, badness, np.inf)
    return np.lexsort((-badness, is_known & ~unsure, is_known)).astype(np.int64)


def order_worst_fit_first(w: Floats) -> Ints:
    """Return (N,) rows by absolute test statistic, the largest first; rows without one are last."""
    return np.argsort(-np.nan_to_num(np.abs(w), nan=-1.0), kind="stable").astype(np.int64)


def order_computed_first(measurements: MeasurementResults) -> Ints:
    """Return (M,) the order of the project, values not computed at the end: for pages."""
    return np.argsort(np.isnan(measurements.value), kind="stable").astype(np.int64)


def order_shapes_first(rows: MeasurementResults) -> tuple[int, ...]:
    """Return the rows in the order of `order_computed_first`, but with coordinates last.

    A coordinate contains the error of the drone's receiver, metres, which no length contains: at
    the head of a table it would give a wrong impression of all other values.
    """
    order = [int(i) for i in order_computed_first(rows)]
    return tuple(sorted(order, key=lambda i: rows.kind[i] == "coordinate"))


def select_least_certain(
    measurements: MeasurementResults, rows: Sequence[int], most: int
) -> tuple[int, ...]:
    """Select rows where there are too many: those that are not ok, then the least certain.

    Coordinates are selected last, see `order_shapes_first`.

    Parameters
    ----------
    measurements
        The M measurements.
    rows
        Rows to select from; the selected ones keep their order.
    most
        Largest number of rows.
    """
    kind, status = measurements.kind, measurements.status
    worst = order_worst_first(measurements).tolist()
    ranked = sorted(
        (i for i in worst if i in rows),
        key=lambda i: (
            not math.isfinite(measurements.value[i]),
            kind[i] == "coordinate",
            status[i] == "ok",
        ),
    )
    chosen = set(ranked[:most])
    return tuple(i for i in rows if i in chosen)

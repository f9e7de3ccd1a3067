"""States, changes and adjustments as plain JSON for the page; NaN becomes null."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import cast

import numpy as np

from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.naming import Units, format_digits
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result.result import Result
from uavgram.picking.document.state import Pick, State
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_quantities import (
    ellipse_json,
    number,
    numbers,
    places_json,
    places_on_earth,
    quantity_words,
    table_words,
)
from uavgram.picking.protocol.encode_verdict import (
    describe_unchecked,
    encode_length_statuses,
    encode_measurement_statuses,
    encode_photo_statuses,
    encode_point_statuses,
    verdict_json,
)
from uavgram.pipeline.pick.live_survey import LinearUpdate, LiveAdjustment
from uavgram.stages.messages import order_messages
from uavgram.views.formatting import KNOWN_STATUS_WORDS, alternatives_text
from uavgram.views.survey.verdict import list_named_picks
from uavgram.views.units import INCH_M, format_sigma, format_value

_PIXEL_DIGITS = 4
_ORIGIN = ("source", "score", "from_image", "from_u_px", "from_v_px")
METRES_OF_A_DEGREE = 111_320.0
"""Length of a degree of a great circle."""
TAG_M = 0.1
"""Sigma to which the height beside a label is rounded, at least."""


def state_json(state: State, index: Mapping[str, int]) -> m.PickedState:
    """Return a whole state; `index` numbers the photos."""
    return {
        "picks": [_pick(pick, index) for pick in state.picks if not pick.again],
        "repeated": _repeated(state, index),
        "lines": [{**vars(line)} for line in state.lines],
        "measurements": [_request(request) for request in state.requests],
    }


def difference_json(before: State, after: State, index: Mapping[str, int]) -> m.Difference:
    """Return the changes that turn one displayed state into another.

    Parameters
    ----------
    before, after
        Displayed state, and the state to display.
    index
        Numbers of the photos by name.
    """
    difference: m.Difference = {}
    old = {pick.key: pick for pick in before.picks if not pick.again}
    new = {pick.key: pick for pick in after.picks if not pick.again}
    put = [_pick(pick, index) for key, pick in new.items() if old.get(key) != pick]
    gone = [(index[image], label) for image, label in old if (image, label) not in new]
    if put or gone:
        difference["picks"] = {"put": put, "gone": gone}
    if (repeated := _repeated(after, index)) != _repeated(before, index):
        difference["repeated"] = repeated
    if before.lines != after.lines:
        difference["lines"] = [{**vars(line)} for line in after.lines]
    if before.requests != after.requests:
        difference["measurements"] = [_request(request) for request in after.requests]
    return difference


def _repeated(state: State, index: Mapping[str, int]) -> list[m.Pair]:
    """Return photo and label of each repeated click, in their order."""
    return [(index[pick.image], pick.label) for pick in state.picks if pick.again]


def _pick(pick: Pick, index: Mapping[str, int]) -> m.Pick:
    """Encode a pick; fields on its origin are left out for a person's pick."""
    left_out = {"again", *(_ORIGIN if pick.source == "hand" else ())}
    fields = vars(pick) | {"image": index[pick.image], "from_image": index.get(pick.from_image)}
    return cast("m.Pick", {name: fields[name] for name in fields if name not in left_out})


def _request(request: MeasurementRequest) -> m.Measurement:
    return {
        "name": request.name,
        "kind": request.kind,
        "points": list(request.points),
        "parameters": dict(request.parameters),
    }


def adjusted_json(adjusted: LiveAdjustment, index: Mapping[str, int]) -> m.Adjusted:
    """Encode a full adjustment."""
    result = adjusted.result
    return {
        "mode": "adjusted",
        "seconds": round(adjusted.seconds, 3),
        "verdict": verdict_json(result, adjusted.observed.lines, index),
        "points": _points(adjusted),
        "picks": _picks(adjusted, index),
        "predicted": places_json(adjusted.predicted, index),
        "lines": _lines(adjusted),
        "measurements": _measurements(adjusted),
        "checks": _checks(adjusted),
        "control_lines": _control_lines(result),
        "frames": _frames(result, index),
        "clock": _clock(result),
        "advice": _advice(adjusted),
        "messages": messages_json(result.messages),
        "stopped": "",
    }


def messages_json(messages: Iterable[Message]) -> list[m.Note]:
    """Return remarks without duplicates, warnings and errors first, grouped by kind."""
    return [
        {"level": one.level, "code": one.code, "text": one.text, "labels": list(one.labels)}
        for one in order_messages(*messages)
    ]


def linearised_json(quick: LinearUpdate, index: Mapping[str, int]) -> m.Linearised:
    """Encode a first-order update: new values only; everything else stays unchanged."""
    base = quick.base.result
    survey = quick.base.adjustment.survey
    picks = zip(survey.pick_frame, survey.pick_label, quick.residual_px, strict=True)
    places = places_on_earth(quick.base, survey.label, quick.world_m)
    points, row = base.points, {label: k for k, label in enumerate(survey.label)}
    return {
        "mode": "linearised",
        "residuals_px": [
            (
                index[survey.frame_id[f]],
                survey.label[k],
                number(u, _PIXEL_DIGITS),
                number(v, _PIXEL_DIGITS),
            )
            for f, k, (u, v) in picks
        ],
        "lines": _length_words(base, quick.length_m),
        "measurements": _value_words(base, quick.value, places),
        "heights": {
            points.label[k]: _height_words(
                float(quick.height_m[row[points.label[k]]]), float(points.height_sigma_m[k])
            )
            for k in np.flatnonzero(points.is_off_ground)
        },
    }


def _length_words(result: Result, length_m: Floats) -> dict[str, m.LengthWords]:
    """Return the adjusted length of each line, in a table and beside it."""
    lines = result.lines
    return {
        name: {
            "adjusted": table_words(float(length_m[i]), 3),
            "text": quantity_words(float(length_m[i]), float(lines.adjusted_sigma_m[i]), "m"),
        }
        for i, name in enumerate(lines.name)
    }


def _value_words(
    result: Result, value: Floats, places: Mapping[str, Sequence[float]]
) -> dict[str, m.ValueWords]:
    """Return each measured value with its sigma, and latitude or longitude of a coordinate."""
    rows = result.measurements
    words: dict[str, m.ValueWords] = {}
    for i, name in enumerate(rows.name):
        one, sigma = float(value[i]), float(rows.sigma[i])
        words[name] = {"text": quantity_words(one, sigma, rows.unit[i]), "grade": "", "earth": ""}
        if rows.kind[i] == "slope" and np.isfinite(one):  # as on a road sign
            angle, spread = np.deg2rad([one, sigma])
            grade, sigma = 100.0 * np.tan(angle), 100.0 * spread / np.cos(angle) ** 2
            words[name]["grade"] = quantity_words(float(grade), float(sigma), "%")
        if rows.kind[i] == "coordinate" and rows.points[i][0] in places:
            latitude, longitude = places[rows.points[i][0]]
            is_east = name.endswith(" east")
            axis, degrees = ("lon", longitude) if is_east else ("lat", latitude)
            words[name]["earth"] = f"{axis} {degrees:.{_degree_places(sigma)}f}\u00b0"
    return words


def _degree_places(sigma_m: float) -> int:
    """Return the decimals of a degree that a sigma on the ground justifies."""
    if not sigma_m > 0:
        return 7
    return min(max(1 - math.floor(math.log10(sigma_m / METRES_OF_A_DEGREE)), 4), 8)


def _height_words(height_m: float, sigma_m: float) -> m.HeightWords:
    """Return the height of a point off the ground: in a table, in a sentence, beside its label."""
    if not math.isfinite(height_m):
        return {"height": "", "sentence": "", "tag": ""}
    away, is_below = abs(height_m), height_m < 0
    side = f"{'below' if is_below else 'above'} the ground"

    def sentence(units: Units) -> str:
        spread = f", \u00b1 {format_sigma(sigma_m, 'm', units)}" if sigma_m > 0 else ""
        return f"{format_value(away, sigma_m, 'm', units)} {side}{spread}"

    def tag(units: Units) -> str:
        arrow = "\u2193" if is_below else "\u2191"
        return arrow + format_value(away, max(sigma_m, TAG_M), "m", units)

    return {"height": quantity_words(height_m, sigma_m, "m"), "sentence": sentence, "tag": tag}


def unadjusted_json(why: str, messages: Iterable[Message]) -> m.Unadjusted:
    """Return the answer when no adjustment is possible yet, with the reason."""
    return {"mode": "none", "why": why, "messages": messages_json(messages)}


def _points(adjusted: LiveAdjustment) -> dict[str, m.AdjustedPoint]:
    """Return sigmas of the points in the survey and relative to neighbours, and their heights."""
    points, standings = adjusted.result.points, encode_point_statuses(adjusted.result)
    sigma = np.sqrt(np.einsum("kii->ki", points.relative.covariance_m2))
    height_m = np.where(points.is_off_ground, points.height_above_ground_m, np.nan)
    return {
        label: {
            "sigma_m": numbers(sigma[k]),
            "sigma": partial(_small_words, float(points.neighbour_sigma_m[k])),
            "neighbours": list(points.neighbours[k]),
            **standings[label],
            **_height_words(float(height_m[k]), float(points.height_sigma_m[k])),
        }
        for k, label in enumerate(points.label)
    }


def _small_words(sigma_m: float, units: Units) -> str:
    """Return a sigma in millimetres or inches, as in a column that has this in its head."""
    if not math.isfinite(sigma_m):
        return ""
    if units.length != "m":
        return f"{sigma_m / INCH_M:.2f}"
    return f"{1000.0 * sigma_m:.{1 if sigma_m < 0.01 else 0}f}"


def _picks(adjusted: LiveAdjustment, index: Mapping[str, int]) -> list[m.Fit]:
    picks, survey = adjusted.result.picks, adjusted.adjustment.survey
    named = list_named_picks(adjusted.result.verdict)
    spread = {
        (survey.frame_id[f], survey.label[k]): ellipse_json(covariance)
        for f, k, covariance in zip(
            survey.pick_frame, survey.pick_label, adjusted.picked_covariance_px2, strict=True
        )
    }
    return [
        {
            "image": index[image],
            "label": label,
            "residual_px": numbers(picks.residual_px[i], _PIXEL_DIGITS),
            "w": number(picks.w[i], 3),
            "status": "suspect" if (image, label) in named else picks.status[i],
            "spread": spread.get((image, label)),
        }
        for i, (image, label) in enumerate(zip(picks.image, picks.label, strict=True))
    ]


def _frames(result: Result, index: Mapping[str, int]) -> dict[str, m.PhotoFit]:
    """Return status by photo; for adjusted ones the sigmas of the centre (e n u) and its shift."""
    frames, standings = result.frames, encode_photo_statuses(result)
    sigma = np.sqrt(np.einsum("fii->fi", frames.refined.covariance))
    moved = np.linalg.norm(frames.refined.center_world_m - frames.seed.center_world_m, axis=1)
    return {
        str(index[name]): {
            "status": frames.status[k],
            "sigma": table_words(float(sigma[k, :3].max()), 2),
            "moved": quantity_words(float(moved[k]), math.nan, "m"),
            "standing": standings[k],
        }
        for k, name in enumerate(frames.frame_id)
    }


def _clock(result: Result) -> m.ClockOffset | None:
    """Return the camera clock minus UTC after the adjustment; None without a log."""
    offset = result.shared.clock_offset_s
    if offset is None:
        return None
    return {"text": quantity_words(float(offset.value[0]), float(offset.sigma[0]), "s")}


def _lines(adjusted: LiveAdjustment) -> dict[str, m.LengthFit]:
    lines, standings = adjusted.result.lines, encode_length_statuses(adjusted.result)
    words = _length_words(adjusted.result, lines.adjusted_m)
    return {
        name: {
            **words[name],
            "adjusted_m": number(lines.adjusted_m[i]),
            "sigma": table_words(float(lines.adjusted_sigma_m[i]), 3),
            "w": number(lines.w[i], 3),
            **standings[i],
        }
        for i, name in enumerate(lines.name)
    }


def _measurements(adjusted: LiveAdjustment) -> dict[str, m.Measured]:
    result = adjusted.result
    found, standings = result.measurements, encode_measurement_statuses(result)
    evidence = result.evidence
    shows = describe_unchecked(found, None if evidence is None else evidence.weakest)
    places = places_on_earth(adjusted, result.points.label, result.points.position_world_m)
    words = _value_words(result, found.value, places)
    return {
        name: {
            **words[name],
            "value": number(found.value[i]),
            "sigma": number(found.sigma[i]),
            "unit": found.unit[i],
            "others": partial(alternatives_text, found, i),
            **standings[i],
            "shows": shows[i],
        }
        for i, name in enumerate(found.name)
    }


def _checks(adjusted: LiveAdjustment) -> list[m.Check]:
    points = adjusted.result.point_checks
    return [
        {
            "label": label,
            "errors": [table_words(one, 3) for one in points.error_m[i].tolist()],
            "quantities": [
                quantity_words(error, sigma, "m")
                for error, sigma in zip(
                    points.error_m[i].tolist(), points.sigma_m[i].tolist(), strict=True
                )
            ],
        }
        for i, label in enumerate(points.label)
    ]


def _control_lines(result: Result) -> dict[str, m.ControlLineFit]:
    """Return the offset of the points picked on each known line from it, and its fit, by name."""
    lines = result.control_lines
    return {
        name: {
            "offset": table_words(float(lines.offset_m[i]), 3),
            "w": number(lines.w[i], 1),
            "status": KNOWN_STATUS_WORDS[lines.status[i]],
            "fits": lines.status[i] not in ("suspect", "removed"),
        }
        for i, name in enumerate(lines.name)
    }


def _advice(adjusted: LiveAdjustment) -> m.Advice | None:
    advice, label = adjusted.advice, adjusted.adjustment.survey.label
    if advice is None or not advice.relative_sigma_after < advice.relative_sigma:
        return None
    start, end = label[advice.start], label[advice.end]
    before, after = (
        f"{format_digits(100 * part)} %"
        for part in (advice.relative_sigma, advice.relative_sigma_after)
    )

    def words(units: Units) -> str:
        about = format_value(float(advice.length_m), math.nan, "m", units)
        return (
            f"Tape {start} \u2013 {end} (about {about}) next: distances between the points would "
            f"be known to {after} instead of {before}. "
        )

    return {"start": start, "end": end, "text": words}

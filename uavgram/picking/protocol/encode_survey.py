"""States, changes and adjustments as plain JSON for the page; NaN becomes null."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from uavgram.model.message import Message
from uavgram.model.observations import MeasurementRequest
from uavgram.model.result.result import Result
from uavgram.picking.document.state import Pick, State
from uavgram.picking.protocol.encode_places import (
    ellipse_json,
    number,
    numbers,
    places_json,
    places_on_earth,
)
from uavgram.picking.protocol.encode_statuses import (
    describe_unchecked,
    describe_undetectable,
    encode_length_statuses,
    encode_photo_statuses,
    encode_point_statuses,
)
from uavgram.picking.protocol.encode_verdict import encode_measurement_statuses, verdict_json
from uavgram.pipeline.pick.live_survey import LinearUpdate, LiveAdjustment
from uavgram.stages.messages import order_messages
from uavgram.views.formatting import KNOWN_STATUS_WORDS
from uavgram.views.survey.verdict import list_named_picks

Json = dict[str, Any]

_PIXEL_DIGITS = 4


def state_json(state: State, index: Mapping[str, int]) -> Json:
    """Return a whole state; `index` numbers the photos."""
    return {
        "picks": [_pick(pick, index) for pick in state.picks if not pick.again],
        "repeated": _repeated(state, index),
        "lines": [{**vars(line)} for line in state.lines],
        "measurements": [_request(request) for request in state.requests],
    }


def difference_json(before: State, after: State, index: Mapping[str, int]) -> Json:
    """Return the changes that turn one displayed state into another.

    Parameters
    ----------
    before, after
        Displayed state, and the state to display.
    index
        Numbers of the photos by name.
    """
    difference: Json = {}
    old = {pick.key: pick for pick in before.picks if not pick.again}
    new = {pick.key: pick for pick in after.picks if not pick.again}
    put = [_pick(pick, index) for key, pick in new.items() if old.get(key) != pick]
    gone = [[index[image], label] for image, label in old if (image, label) not in new]
    if put or gone:
        difference["picks"] = {"put": put, "gone": gone}
    if (repeated := _repeated(after, index)) != _repeated(before, index):
        difference["repeated"] = repeated
    if before.lines != after.lines:
        difference["lines"] = [{**vars(line)} for line in after.lines]
    if before.requests != after.requests:
        difference["measurements"] = [_request(request) for request in after.requests]
    return difference


def _repeated(state: State, index: Mapping[str, int]) -> list[tuple[int, str]]:
    """Return photo and label of each repeated click, in their order."""
    return [(index[pick.image], pick.label) for pick in state.picks if pick.again]


def _pick(pick: Pick, index: Mapping[str, int]) -> Json:
    """Encode a pick; fields on its origin are left out for a person's pick."""
    told = {**vars(pick), "image": index[pick.image], "from_image": index.get(pick.from_image)}
    del told["again"]
    if pick.source == "hand":
        for name in ("source", "score", "from_image", "from_u_px", "from_v_px"):
            del told[name]
    return told


def _request(request: MeasurementRequest) -> Json:
    parameters = dict(request.parameters)
    return {**vars(request), "points": list(request.points), "parameters": parameters}


def adjusted_json(adjusted: LiveAdjustment, index: Mapping[str, int]) -> Json:
    """Encode a full adjustment."""
    result = adjusted.result
    return {
        "mode": "adjusted",
        "seconds": number(adjusted.seconds, 3),
        "verdict": {
            **verdict_json(result, adjusted.observed.lines, index),
            "reasons": len(result.verdict.reasons),
            "unseen": describe_undetectable(result),
        },
        "points": _points(adjusted),
        "earth_deg": places_on_earth(adjusted, result.points.label, result.points.position_world_m),
        "picks": _picks(adjusted, index),
        "predicted": places_json(
            adjusted.predicted.frame_id,
            [adjusted.adjustment.survey.label[k] for k in adjusted.predicted.label],
            adjusted.predicted,
            index,
        ),
        "lines": _lines(adjusted),
        "measurements": _measurements(adjusted),
        "checks": _checks(adjusted),
        "control_lines": _control_lines(result),
        "frames": _frames(result, index),
        "clock": _clock(result),
        "advice": _advice(adjusted),
        "messages": messages_json(result.messages),
    }


def messages_json(messages: Iterable[Message]) -> list[Json]:
    """Return remarks without duplicates, warnings and errors first, grouped by kind."""
    return [
        {"level": m.level, "code": m.code, "text": m.text, "labels": list(m.labels)}
        for m in order_messages(*messages)
    ]


def linearised_json(quick: LinearUpdate, index: Mapping[str, int]) -> Json:
    """Encode a first-order update: new values only; everything else stays unchanged."""
    base = quick.base.result
    survey = quick.base.adjustment.survey
    picks = zip(survey.pick_frame, survey.pick_label, quick.residual_px, strict=True)
    return {
        "mode": "linearised",
        "residuals_px": [
            [index[survey.frame_id[f]], survey.label[k], *numbers(residual, _PIXEL_DIGITS)]
            for f, k, residual in picks
        ],
        "lengths_m": dict(zip(base.lines.name, numbers(quick.length_m), strict=True)),
        "values": dict(zip(base.measurements.name, numbers(quick.value), strict=True)),
        "heights_m": {
            survey.label[k]: number(quick.height_m[k])
            for k in np.flatnonzero(base.points.is_off_ground)
        },
        "earth_deg": places_on_earth(quick.base, survey.label, quick.world_m),
    }


def unadjusted_json(why: str, messages: Iterable[Message]) -> Json:
    """Return the answer when no adjustment is possible yet, with the reason."""
    return {"mode": "none", "why": why, "messages": messages_json(messages)}


def _points(adjusted: LiveAdjustment) -> Json:
    """Return sigmas of the points in the survey and relative to neighbours, and their heights."""
    points, standings = adjusted.result.points, encode_point_statuses(adjusted.result)
    sigma = np.sqrt(np.einsum("kii->ki", points.relative.covariance_m2))
    found: Json = {
        label: {
            "sigma_m": numbers(sigma[k]),
            "neighbour_sigma_m": number(points.neighbour_sigma_m[k]),
            "neighbours": list(points.neighbours[k]),
            **standings[label],
        }
        for k, label in enumerate(points.label)
    }
    for k in np.flatnonzero(points.is_off_ground):
        found[points.label[k]] |= {
            "height_m": number(points.height_above_ground_m[k]),
            "height_sigma_m": number(points.height_sigma_m[k]),
        }
    return found


def _picks(adjusted: LiveAdjustment, index: Mapping[str, int]) -> list[Json]:
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


def _frames(result: Result, index: Mapping[str, int]) -> Json:
    """Return status by photo; for adjusted ones the sigmas of the centre (e n u) and its shift."""
    frames, standings = result.frames, encode_photo_statuses(result)
    sigma = np.sqrt(np.einsum("fii->fi", frames.refined.covariance))
    moved = np.linalg.norm(frames.refined.center_world_m - frames.seed.center_world_m, axis=1)
    return {
        str(index[name]): {
            "status": frames.status[k],
            "sigma_m": numbers(sigma[k, :3], 3),
            "moved_m": number(moved[k], 3),
            "standing": standings[k],
        }
        for k, name in enumerate(frames.frame_id)
    }


def _clock(result: Result) -> Json | None:
    """Return the camera clock minus UTC after the adjustment; None without a log."""
    offset = result.shared.clock_offset_s
    if offset is None:
        return None
    return {"offset_s": number(offset.value[0]), "sigma_s": number(offset.sigma[0])}


def _lines(adjusted: LiveAdjustment) -> Json:
    lines, standings = adjusted.result.lines, encode_length_statuses(adjusted.result)
    return {
        name: {
            "adjusted_m": number(lines.adjusted_m[i]),
            "sigma_m": number(lines.adjusted_sigma_m[i]),
            "w": number(lines.w[i], 3),
            **standings[i],
        }
        for i, name in enumerate(lines.name)
    }


def _measurements(adjusted: LiveAdjustment) -> Json:
    result = adjusted.result
    found, standings = result.measurements, encode_measurement_statuses(result)
    evidence = result.evidence
    shows = describe_unchecked(found, None if evidence is None else evidence.weakest)
    return {
        name: {
            "value": number(found.value[i]),
            "sigma": number(found.sigma[i]),
            "unit": found.unit[i],
            "alternatives": numbers(found.alternative_values[i]),
            **standings[i],
            "shows": shows[i],
        }
        for i, name in enumerate(found.name)
    }


def _checks(adjusted: LiveAdjustment) -> list[Json]:
    points = adjusted.result.point_checks
    return [
        {
            "label": label,
            "error_m": numbers(points.error_m[i]),
            "sigma_m": numbers(points.sigma_m[i]),
        }
        for i, label in enumerate(points.label)
    ]


def _control_lines(result: Result) -> Json:
    """Return the offset of the points picked on each known line from it, and its fit, by name."""
    lines = result.control_lines
    return {
        name: {
            "offset_m": number(lines.offset_m[i]),
            "w": number(lines.w[i], 1),
            "status": KNOWN_STATUS_WORDS[lines.status[i]],
            "fits": lines.status[i] not in ("suspect", "removed"),
        }
        for i, name in enumerate(lines.name)
    }


def _advice(adjusted: LiveAdjustment) -> Json | None:
    advice, label = adjusted.advice, adjusted.adjustment.survey.label
    if advice is None or not advice.relative_sigma_after < advice.relative_sigma:
        return None
    return {
        "start": label[advice.start],
        "end": label[advice.end],
        "length_m": number(advice.length_m, 2),
        "relative_sigma": number(advice.relative_sigma),
        "relative_sigma_after": number(advice.relative_sigma_after),
    }

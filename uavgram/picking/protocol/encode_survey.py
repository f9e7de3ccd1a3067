"""States, changes and adjustments as plain JSON for the page; NaN becomes null."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from uavgram.estimation.measuring.predicted_pixels import PredictedPixels
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.result.result import Result
from uavgram.model.survey.observations import MeasurementRequest
from uavgram.picking.document.state import Pick, State
from uavgram.picking.protocol.encode_verdict import (
    length_whys,
    measurement_standings,
    verdict_json,
)
from uavgram.picking.protocol.geodetic import places_on_earth
from uavgram.pipeline.pick.live import Adjusted, Linearised
from uavgram.pipeline.pick.other_photos import KnownPlaces
from uavgram.stages.messages import in_order
from uavgram.views.survey.verdict import named_picks

Json = dict[str, Any]

_PIXEL_DIGITS = 4
_DIGITS = 7


def number(value: float, digits: int = _DIGITS) -> float | None:
    """A number as JSON can hold it; None where it is none."""
    return round(float(value), digits) if math.isfinite(value) else None


def numbers(values: Iterable[float], digits: int = _DIGITS) -> list[float | None]:
    """Numbers as JSON can hold them."""
    return [number(value, digits) for value in values]


def state_json(state: State, index: Mapping[str, int]) -> Json:
    """All of a state; `index` numbers the photos."""
    return {
        "picks": [_pick(pick, index) for pick in state.picks],
        "lines": [{**vars(line)} for line in state.lines],
        "measurements": [_request(request) for request in state.requests],
    }


def difference_json(before: State, after: State, index: Mapping[str, int]) -> Json:
    """What the page must change to show another state.

    Parameters
    ----------
    before, after
        What it shows, and what it is to show.
    index
        Numbers of the photos by name.
    """
    difference: Json = {}
    old = {pick.key: pick for pick in before.picks}
    new = {pick.key: pick for pick in after.picks}
    put = [_pick(pick, index) for key, pick in new.items() if old.get(key) != pick]
    gone = [[index[image], label] for image, label in old if (image, label) not in new]
    if put or gone:
        difference["picks"] = {"put": put, "gone": gone}
    if before.lines != after.lines:
        difference["lines"] = [{**vars(line)} for line in after.lines]
    if before.requests != after.requests:
        difference["measurements"] = [_request(request) for request in after.requests]
    return difference


def _pick(pick: Pick, index: Mapping[str, int]) -> Json:
    """Who made it is left out where a person did."""
    told = {**vars(pick), "image": index[pick.image], "from_image": index.get(pick.from_image)}
    if pick.source == "hand":
        for name in ("source", "score", "from_image", "from_u_px", "from_v_px"):
            del told[name]
    return told


def _request(request: MeasurementRequest) -> Json:
    parameters = dict(request.parameters)
    return {**vars(request), "points": list(request.points), "parameters": parameters}


def adjusted_json(adjusted: Adjusted, index: Mapping[str, int]) -> Json:
    """A full adjustment."""
    result = adjusted.result
    return {
        "mode": "adjusted",
        "seconds": number(adjusted.seconds, 3),
        "verdict": verdict_json(result),
        "points": _points(adjusted),
        "earth_deg": places_on_earth(adjusted, result.points.label, result.points.position_world_m),
        "picks": _picks(adjusted, index),
        "predicted": _places(
            adjusted.predicted.frame_id,
            [adjusted.adjustment.survey.label[k] for k in adjusted.predicted.label],
            adjusted.predicted,
            index,
        ),
        "lines": _lines(adjusted),
        "measurements": _measurements(adjusted),
        "checks": _checks(adjusted),
        "frames": _frames(result, index),
        "clock": _clock(result),
        "advice": _advice(adjusted),
        "messages": messages_json(result.messages),
    }


def messages_json(messages: Iterable[Message]) -> list[Json]:
    """Remarks, each once, warnings and errors first, those of one kind as one."""
    return [
        {"level": m.level, "code": m.code, "text": m.text, "labels": list(m.labels)}
        for m in in_order(*messages)
    ]


def linearised_json(quick: Linearised, index: Mapping[str, int]) -> Json:
    """A first-order answer: new values alone; everything else stays as it was."""
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
    """Nothing can be adjusted yet, and why."""
    return {"mode": "none", "why": why, "messages": messages_json(messages)}


def _points(adjusted: Adjusted) -> Json:
    """How well they are known, within the survey and against their neighbours; their heights."""
    points = adjusted.result.points
    sigma = np.sqrt(np.einsum("kii->ki", points.relative.covariance_m2))
    found: Json = {
        label: {
            "sigma_m": numbers(sigma[k]),
            "neighbour_sigma_m": number(points.neighbour_sigma_m[k]),
            "neighbours": list(points.neighbours[k]),
        }
        for k, label in enumerate(points.label)
    }
    for k in np.flatnonzero(points.is_off_ground):
        found[points.label[k]] |= {
            "height_m": number(points.height_above_ground_m[k]),
            "height_sigma_m": number(points.height_sigma_m[k]),
        }
    return found


def _picks(adjusted: Adjusted, index: Mapping[str, int]) -> list[Json]:
    picks, survey = adjusted.result.picks, adjusted.adjustment.survey
    named = named_picks(adjusted.result.verdict)
    spread = {
        (survey.frame_id[f], survey.label[k]): _ellipse(covariance)
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
    """Status by photo; of those adjusted the sigmas of the centre (e n u) and how far it moved."""
    frames = result.frames
    sigma = np.sqrt(np.einsum("fii->fi", frames.refined.covariance))
    moved = np.linalg.norm(frames.refined.center_world_m - frames.seed.center_world_m, axis=1)
    return {
        str(index[name]): {
            "status": frames.status[k],
            "sigma_m": numbers(sigma[k, :3], 3),
            "moved_m": number(moved[k], 3),
        }
        for k, name in enumerate(frames.frame_id)
    }


def _clock(result: Result) -> Json | None:
    """Camera clock minus UTC after the adjustment; None without a log."""
    offset = result.shared.clock_offset_s
    if offset is None:
        return None
    return {"offset_s": number(offset.value[0]), "sigma_s": number(offset.sigma[0])}


def expected_json(places: KnownPlaces, index: Mapping[str, int]) -> list[Json]:
    """Where points with known coordinates should appear."""
    return _places(places.frame_id, places.label, places, index)


def _places(
    frames: Sequence[str],
    labels: Sequence[str],
    places: KnownPlaces | PredictedPixels,
    index: Mapping[str, int],
) -> list[Json]:
    """Labels in photos where nobody has picked them, with their spread."""
    rows = zip(frames, labels, places.pixel_px, places.covariance_px2, strict=True)
    return [
        {
            "image": index[frame],
            "label": label,
            "pixel_px": numbers(pixel, 3),
            "spread": _ellipse(covariance),
        }
        for frame, label, pixel, covariance in rows
    ]


def _ellipse(covariance_px2: Floats) -> Json:
    """One-sigma half-axes [px], and the direction of the major one from u towards v [deg]."""
    value, vector = np.linalg.eigh(covariance_px2)
    minor, major = np.sqrt(np.maximum(value, 0.0))
    turn_deg = math.degrees(math.atan2(vector[1, 1], vector[0, 1]))
    return {
        "major_px": number(major, 3),
        "minor_px": number(minor, 3),
        "turn_deg": number(turn_deg, 3),
    }


def _lines(adjusted: Adjusted) -> Json:
    lines, whys = adjusted.result.lines, length_whys(adjusted.result)
    return {
        name: {
            "adjusted_m": number(lines.adjusted_m[i]),
            "sigma_m": number(lines.adjusted_sigma_m[i]),
            "w": number(lines.w[i], 3),
            "status": lines.status[i],
            "why": whys[i],
        }
        for i, name in enumerate(lines.name)
    }


def _measurements(adjusted: Adjusted) -> Json:
    found, standings = adjusted.result.measurements, measurement_standings(adjusted.result)
    return {
        name: {
            "value": number(found.value[i]),
            "sigma": number(found.sigma[i]),
            "unit": found.unit[i],
            "alternatives": numbers(found.alternative_values[i]),
            **standings[i],
        }
        for i, name in enumerate(found.name)
    }


def _checks(adjusted: Adjusted) -> list[Json]:
    points = adjusted.result.point_checks
    return [
        {
            "label": label,
            "error_m": numbers(points.error_m[i]),
            "sigma_m": numbers(points.sigma_m[i]),
        }
        for i, label in enumerate(points.label)
    ]


def _advice(adjusted: Adjusted) -> Json | None:
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

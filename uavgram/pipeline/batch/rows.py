"""Row of one survey in the batch's table, taken from its result."""

from __future__ import annotations

import math
from collections.abc import Iterator
from datetime import UTC, datetime

import numpy as np

from uavgram.errors import InputError
from uavgram.io.digest import photo_files
from uavgram.io.photos.camera_tags import read_camera_tags
from uavgram.model.arrays import Floats
from uavgram.model.batch import Fit, ParameterUpdate, SurveyRow
from uavgram.model.result.result import Result
from uavgram.model.result.shared import compare_cameras
from uavgram.views.survey.verdict import verdict_sentence

POOLED_GROUPS = ("pixels", "lengths", "telemetry")


def row_of(result: Result, project: str, output: str, seconds: float) -> SurveyRow:
    """Return the table row of a measured survey.

    Parameters
    ----------
    result
        Result of its run.
    project
        Its project file.
    output
        Folder of its results.
    seconds
        Computing time.
    """
    origin = result.world.origin
    nowhere = (math.nan, math.nan)
    place = nowhere if origin is None else (origin.latitude_deg, origin.longitude_deg)
    warnings = (one.code for one in result.messages if one.level != "info")
    sigmas = result.measurements.sigma[[unit == "m" for unit in result.measurements.unit]]
    return SurveyRow(
        name=result.name,
        project=project,
        status="done",
        level=result.verdict.level,
        sentence=verdict_sentence(result),
        taken_utc=_taken(result.frames.time_utc_s),
        latitude_deg=place[0],
        longitude_deg=place[1],
        camera=result.camera.name,
        drone=_drone(photo_files(result.frames)),
        photos=len(result.frames.frame_id),
        measurements=len(result.measurements.name),
        mean_sigma_m=_mean(sigmas),
        worst_w=_largest(result.picks.w, result.lines.w, result.line_checks.z),
        warnings=tuple(dict.fromkeys(warnings)),
        output=output,
        seconds=seconds,
        fits=tuple(_fits(result)),
        seen=_seen(result),
    )


def _taken(times: Floats) -> str:
    known = times[np.isfinite(times)]
    if not known.size:
        return ""
    return datetime.fromtimestamp(float(known.mean()), UTC).isoformat(timespec="seconds")


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else math.nan


def _largest(*values: Floats) -> float:
    known = np.concatenate(values)
    known = known[np.isfinite(known)]
    return float(known[np.abs(known).argmax()]) if known.size else math.nan


def _drone(photos: tuple[str, ...]) -> str:
    """Return make, model and serial number in the first photo; empty where not stated."""
    try:
        tags = read_camera_tags(photos[0])
    except InputError:
        return ""
    return " ".join(filter(None, (tags.camera_name, tags.serial)))


def _fits(result: Result) -> Iterator[Fit]:
    checks = result.checks_overall
    if checks is not None and math.isfinite(checks.chi2) and checks.count:
        yield Fit(kind="checks", squares=checks.chi2, freedom=float(checks.count))
    for group in result.solution.groups:
        squares = group.variance_factor * group.redundancy
        if group.name in POOLED_GROUPS and group.redundancy > 0 and math.isfinite(squares):
            yield Fit(kind=group.name, squares=squares, freedom=group.redundancy)


def _seen(result: Result) -> tuple[ParameterUpdate, ...]:
    found = compare_cameras(result.camera, result.shared.intrinsics)
    columns = (found.prior_value, found.prior_sigma, found.value, found.sigma)
    rows = zip(found.names, *(column.tolist() for column in columns), strict=True)
    return tuple(
        ParameterUpdate(name=name, stated=stated, stated_sigma=prior, value=value, sigma=sigma)
        for name, stated, prior, value, sigma in rows
        if prior > 0
    )

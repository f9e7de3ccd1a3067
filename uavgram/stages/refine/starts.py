"""First values of the adjustment: from the telemetry, from known lengths, from control points."""

from __future__ import annotations

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.first_values import (
    FirstValues,
    PlaneNetwork,
    align_in_plane,
    from_telemetry,
    length_candidates,
    lines_per_frame,
)
from uavgram.geometry.back_projection import back_project
from uavgram.model.arrays import Floats
from uavgram.model.survey import Survey

NO_GROUND = "its ray does not meet the ground in front of the camera"
NOT_JOINED = (
    "its frame has neither telemetry, nor three known lengths, nor four points in common with "
    "the frames that do"
)


def first_values(survey: Survey) -> list[FirstValues]:
    """Sets of first values, most likely first; picks they leave without a place are NaN."""
    ray = back_project(survey.calibration.model, survey.calibration.parameters, survey.pixel_px)
    if survey.telemetry is not None:
        return [from_telemetry(survey, ray)]
    counts = lines_per_frame(survey)
    candidates = {
        int(f): length_candidates(survey, ray, int(f)) for f in np.flatnonzero(counts >= 3)
    }
    planes = {f: found[0].plane for f, found in candidates.items() if found}
    if survey.gauge == "world":
        return [_over_control(survey, ray, planes)]
    if not planes:
        raise GeometryError(
            "without a flight log a pose needs three known lengths that one frame sees whole "
            f"(most here: {counts.max()} in {survey.frame_id[int(counts.argmax())]!r}): pick both "
            "ends of more lines in one frame, tape a fourth, or give the log"
        )
    first = max(planes, key=lambda f: (counts[f], -f))
    values = []
    for candidate in candidates[first]:
        network = PlaneNetwork(survey, ray)
        network.start(first, candidate.plane)
        network.grow(planes)
        values.append(_at_gauge(network))
    return values


def _over_control(survey: Survey, ray: Floats, planes: dict[int, Floats]) -> FirstValues:
    """First values over control points; their heights above the label's own give the plane's."""
    label = survey.control_label
    height = float(np.mean(survey.control_world_m[:, 2] - survey.height_above_m[label]))
    network = PlaneNetwork(survey, ray)
    network.place_points(label, survey.control_world_m[:, :2])
    network.grow(planes)
    if np.isnan(network.center).all():
        raise GeometryError(
            "without a flight log a pose needs four control points in one frame, or two and three "
            "known lengths: pick more of them, or give the log"
        )
    center = network.center + np.array([0.0, 0.0, height])
    return FirstValues(network.point, center, network.rotation, height)


def _at_gauge(network: PlaneNetwork) -> FirstValues:
    """The network turned and shifted so that its first frame meets the gauge's conditions."""
    placed = int(np.flatnonzero(np.isfinite(network.center[:, 0]))[0])
    image_up = -network.rotation[placed][:2, 1]
    size = np.linalg.norm(image_up)
    north = image_up / size if size > 0 else np.array([0.0, 1.0])
    center = network.center[placed, :2]
    turn, shift = align_in_plane(
        np.stack([center, center + north]), np.array([[0.0, 0.0], [0.0, 1.0]])
    )
    return FirstValues(
        network.point @ turn[:2, :2].T + shift[:2],
        network.center @ turn.T + shift,
        turn @ network.rotation,
        0.0,
    )


def unusable(survey: Survey, values: FirstValues) -> dict[int, str]:
    """Picks without first values in front of their camera, and why."""
    frame, label = survey.pick_frame, survey.pick_label
    up = np.full(len(label), values.height_m) + survey.height_above_m[label]
    world = np.column_stack([values.point_m[label], up])
    depth = np.einsum("ni,ni->n", world - values.center[frame], values.rotation[frame][:, :, 2])
    placed = np.isfinite(values.center[frame, 0])
    usable = placed & (np.nan_to_num(depth, nan=-1.0) > 0)
    return {int(i): NO_GROUND if placed[i] else NOT_JOINED for i in np.flatnonzero(~usable)}

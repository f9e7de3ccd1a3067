"""Leaving observations out of a survey without losing track of which they were."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uavgram.model.arrays import Bools, Ints
from uavgram.model.flight.pose import TelemetryPrior
from uavgram.model.survey.survey import Survey


@dataclass(frozen=True, eq=False)
class Selection:
    """A reduced survey, and where its picks and lines stood in the whole one.

    Attributes
    ----------
    survey
        Without the picks left out, and without frames, labels, lines and control points that lost
        all of theirs.
    pick_index, line_index
        (P',), (L',) into the whole survey.
    """

    survey: Survey
    pick_index: Ints
    line_index: Ints


def select_picks(survey: Survey, keep: Bools) -> Selection:
    """Keep the picks in `keep` (P,), and whatever still hangs on one of them."""
    picks = np.flatnonzero(keep)
    frames, pick_frame = np.unique(survey.pick_frame[picks], return_inverse=True)
    labels, pick_label = np.unique(survey.pick_label[picks], return_inverse=True)
    new_label = np.full(len(survey.label), -1)
    new_label[labels] = np.arange(len(labels))
    new_frame = np.full(len(survey.frame_id), -1)
    new_frame[frames] = np.arange(len(frames))
    start, end = new_label[survey.line_start], new_label[survey.line_end]
    lines = np.flatnonzero((start >= 0) & (end >= 0))
    control = np.flatnonzero(new_label[survey.control_label] >= 0)
    reduced = replace(
        survey,
        frame_id=tuple(survey.frame_id[i] for i in frames),
        seeds=None if survey.seeds is None else survey.seeds.take(frames),
        telemetry=_some_telemetry(survey, new_frame),
        label=tuple(survey.label[i] for i in labels),
        height_above_m=survey.height_above_m[labels],
        area=survey.area[labels],
        pick_frame=pick_frame,
        pick_label=pick_label,
        pixel_px=survey.pixel_px[picks],
        pick_sigma_px=survey.pick_sigma_px[picks],
        line_start=start[lines],
        line_end=end[lines],
        length_m=survey.length_m[lines],
        length_sigma_m=survey.length_sigma_m[lines],
        line_name=_some_names(survey, lines),
        control_label=new_label[survey.control_label[control]],
        control_world_m=survey.control_world_m[control],
        control_sigma_m=survey.control_sigma_m[control],
    )
    return Selection(reduced, picks, lines)


def select_lines(survey: Survey, keep: Bools) -> Survey:
    """Keep the known lengths in `keep` (L,), and everything else."""
    return replace(
        survey,
        line_start=survey.line_start[keep],
        line_end=survey.line_end[keep],
        length_m=survey.length_m[keep],
        length_sigma_m=survey.length_sigma_m[keep],
        line_name=_some_names(survey, np.flatnonzero(keep)),
    )


def _some_names(survey: Survey, lines: Ints) -> tuple[str, ...]:
    return tuple(survey.line_name[i] for i in lines) if survey.line_name else ()


def _some_telemetry(survey: Survey, new_frame: Ints) -> TelemetryPrior | None:
    telemetry = survey.telemetry
    if telemetry is None:
        return None
    kept = np.flatnonzero(new_frame[telemetry.frame_index] >= 0)
    return replace(
        telemetry,
        frame_index=new_frame[telemetry.frame_index[kept]],
        time_s=telemetry.time_s[kept],
        covariance=telemetry.covariance[kept],
    )

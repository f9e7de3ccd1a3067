"""Leaving observations out of a survey without losing track of which they were."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uavgram.model.arrays import Bools, Ints, rows_of
from uavgram.model.flight.pose import TelemetryPrior
from uavgram.model.survey.survey import Survey


@dataclass(frozen=True, eq=False)
class Selection:
    """A reduced survey, and where its picks and lines stood in the whole one.

    Attributes
    ----------
    survey
        Without the picks left out, and without frames, labels, lines, known things and control
        points that lost all of theirs.
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
        rolling=survey.rolling and replace(survey.rolling, **rows_of(survey.rolling, frames, "f")),
        **rows_of(survey, labels, "k"),
        **rows_of(survey, picks, "p") | {"pick_frame": pick_frame, "pick_label": pick_label},
        **_some_lines(survey, lines) | {"line_start": start[lines], "line_end": end[lines]},
        known=tuple(
            replace(one, label=tuple(new_label[list(one.label)].tolist()))
            for one in survey.known
            if (new_label[list(one.label)] >= 0).all()
        ),
        **rows_of(survey, control, "c")
        | {"control_label": new_label[survey.control_label[control]]},
    )
    return Selection(reduced, picks, lines)


def select_lines(survey: Survey, keep: Bools) -> Survey:
    """Keep the known lengths in `keep` (L,), and everything else."""
    return replace(survey, **_some_lines(survey, np.flatnonzero(keep)))


def without_known(survey: Survey, left_out: Collection[int]) -> Survey:
    """Leave out known things, by their number among the project's."""
    return replace(survey, known=tuple(one for one in survey.known if one.index not in left_out))


def _some_lines(survey: Survey, lines: Ints) -> dict[str, Any]:
    texts = {name: getattr(survey, name) for name in ("line_name", "line_tape", "line_along")}
    some = {name: tuple(all_[i] for i in lines) if all_ else () for name, all_ in texts.items()}
    return rows_of(survey, lines, "l") | some


def _some_telemetry(survey: Survey, new_frame: Ints) -> TelemetryPrior | None:
    telemetry = survey.telemetry
    if telemetry is None:
        return None
    kept = np.flatnonzero(new_frame[telemetry.frame_index] >= 0)
    some = rows_of(telemetry, kept)
    return replace(telemetry, **some | {"frame_index": new_frame[some["frame_index"]]})

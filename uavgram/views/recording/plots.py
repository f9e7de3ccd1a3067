"""Curves over the frames: residuals, heights, and the strip of the frames' states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.model.result import PoseTable, Result
from uavgram.views.recording.frame_picks import FramePicks
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import FRAME_COLOURS, REFINED, SEED, Rgb
from uavgram.views.wording import FRAME_STATUS_WORDS

RESIDUAL_REFINED = "plots/residual/refined"
RESIDUAL_SEED = "plots/residual_of_flight_log/flight_log"
HEIGHT = "plots/height"
STATUS = "frame_status"


@dataclass(frozen=True, eq=False)
class Curves:
    """(F,) root mean square of the picks' residuals in one coordinate [px]; NaN without picks."""

    seed_rms_px: Floats
    refined_rms_px: Floats


def residual_curves(result: Result, picks: FramePicks) -> Curves:
    """Sum up residuals frame by frame."""
    seed = picks.seed_px - result.picks.pixel_px
    return Curves(
        np.array([_rms(seed[rows]) for rows in picks.rows]),
        np.array([_rms(result.picks.residual_px[rows]) for rows in picks.rows]),
    )


def _rms(residual: Floats) -> float:
    good = residual[np.isfinite(residual[:, 0])]
    return float(np.sqrt(np.mean(good**2))) if len(good) else np.nan


def frame_states(result: Result) -> list[str]:
    """(F,) status of each frame; ``check picks`` where a pick of a refined frame is suspect."""
    odd = {
        image
        for image, status in zip(result.picks.image, result.picks.status, strict=True)
        if status in ("suspect", "removed")
    }
    return [
        "check picks" if status == "refined" and name in odd else status
        for name, status in zip(result.frames.frame_id, result.frames.status, strict=True)
    ]


def log_plots(recorder: Recorder, result: Result, curves: Curves) -> None:
    """Log every curve and the states."""
    _scalars(recorder, RESIDUAL_REFINED, curves.refined_rms_px, "refined [px]", REFINED)
    _scalars(recorder, RESIDUAL_SEED, curves.seed_rms_px, "flight log [px]", SEED)
    _heights(recorder, f"{HEIGHT}/flight_log", result.frames.seed, "flight log [m]", SEED)
    _heights(recorder, f"{HEIGHT}/refined", result.frames.refined, "refined [m]", REFINED)
    states = np.array(frame_states(result), dtype=str)
    recorder.static(
        STATUS,
        rr.StateConfiguration(
            values=list(FRAME_COLOURS),
            labels=[FRAME_STATUS_WORDS.get(state, state) for state in FRAME_COLOURS],
            colors=list(FRAME_COLOURS.values()),
        ),
    )
    recorder.rows(
        STATUS, np.arange(len(states)), lambda some: [rr.StateChange.columns(state=states[some])]
    )


def _scalars(recorder: Recorder, path: str, values: Floats, name: str, colour: Rgb) -> None:
    known = np.flatnonzero(np.isfinite(values))
    if len(known):
        recorder.static(path, rr.SeriesLines(colors=colour, names=name, widths=2.0))
        recorder.rows(path, known, lambda some: [rr.Scalars.columns(scalars=values[some])])


def _heights(recorder: Recorder, path: str, poses: PoseTable, name: str, colour: Rgb) -> None:
    up, variance = poses.center_world_m[:, 2], poses.covariance[:, 2, 2]
    known = np.flatnonzero(np.isfinite(up) & np.isfinite(variance))
    if len(known):
        recorder.static(path, rr.Measurements.from_fields(colors=colour, names=name, widths=2.0))
        recorder.rows(
            path,
            known,
            lambda some: [rr.Measurements.columns(values=up[some], variances=variance[some])],
        )

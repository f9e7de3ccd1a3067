"""Curves over the frames: residuals, tests, heights, and changes and sigmas of the poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
from uavgram.model.naming import METRIC, Units
from uavgram.model.result.result import Result
from uavgram.model.result.tables import PoseTable
from uavgram.views.formatting import FRAME_STATE_WORDS
from uavgram.views.recording.photo import FramePicks
from uavgram.views.recording.stream import Recorder
from uavgram.views.style import BAD, FRAME_COLOURS, MEASURED, OBSERVED, REFINED, SEED, Rgb
from uavgram.views.survey.key_facts import frame_states
from uavgram.views.survey.outlines import find_largest_finite, largest_sigmas
from uavgram.views.survey.reliability import pick_limit
from uavgram.views.units import table_unit, units_of

MISS_REFINED = "plots/miss"
MISS_SEED = "plots/miss_of_flight_log/flight_log"
RESIDUAL_REFINED = "plots/residual"
WORST_W = "plots/worst_w"
RESIDUAL_SEED = "plots/residual_of_flight_log/flight_log"
HEIGHT = "plots/height"
STATUS = "frame_status"


@dataclass(frozen=True, eq=False)
class FrameCurves:
    """Curves over the F frames.

    Attributes
    ----------
    seed_rms_px, refined_rms_px
        (F,) root mean square of the picks' residuals in one coordinate [px]; NaN without picks.
    sigma_px
        (F,) root mean square of the picks' sigmas; for a frame without picks, that of all picks.
    seed_rms_m, refined_rms_m, sigma_m
        (F,) the same at the distance of the points [m], across the line of sight.
    worst_w
        (F,) largest absolute w of the picks; NaN without picks.
    limit_w
        Absolute w above which a pick is suspect.
    seed_height_m, refined_height_m
        (F,) heights of the cameras above the ground below them; NaN without a pose.
    """

    seed_rms_px: Floats
    refined_rms_px: Floats
    sigma_px: Floats
    seed_rms_m: Floats
    refined_rms_m: Floats
    sigma_m: Floats
    worst_w: Floats
    limit_w: float
    seed_height_m: Floats
    refined_height_m: Floats


def frame_curves(result: Result, picks: FramePicks) -> FrameCurves:
    """Summarise the picks of each frame."""
    seed, own = picks.seed_px - result.picks.pixel_px, result.picks.sigma_px[:, None]
    sigma = np.array([_rms(own[rows]) for rows in picks.rows])
    w = np.abs(result.picks.w)
    pixel_m = _pixel_sizes(result, picks)[:, None]
    sigma_m = np.array([_rms((own * pixel_m)[rows]) for rows in picks.rows])
    return FrameCurves(
        seed_rms_px=np.array([_rms(seed[rows]) for rows in picks.rows]),
        refined_rms_px=np.array([_rms(result.picks.residual_px[rows]) for rows in picks.rows]),
        sigma_px=np.where(np.isfinite(sigma), sigma, _rms(own)),
        seed_rms_m=np.array([_rms((seed * pixel_m)[rows]) for rows in picks.rows]),
        refined_rms_m=np.array(
            [_rms((result.picks.residual_px * pixel_m)[rows]) for rows in picks.rows]
        ),
        sigma_m=np.where(np.isfinite(sigma_m), sigma_m, _rms(own * pixel_m)),
        worst_w=np.array([find_largest_finite(w[rows]) for rows in picks.rows]),
        limit_w=pick_limit(result),
        seed_height_m=_height(result, result.frames.seed),
        refined_height_m=_height(result, result.frames.refined),
    )


def _pixel_sizes(result: Result, picks: FramePicks) -> Floats:
    """Compute (n,) metres per pixel at each picked point, across the line of sight; may be NaN."""
    place = dict(zip(result.points.label, result.points.position_world_m, strict=True))
    unknown, focal = np.full(3, np.nan), float(result.shared.intrinsics.value[0])
    size = np.full(len(result.picks.label), np.nan)
    for frame, rows in enumerate(picks.rows):
        at = np.reshape([place.get(result.picks.label[row], unknown) for row in rows], (-1, 3))
        # size of a pixel at the point: distance over focal length
        away = np.linalg.norm(at - result.frames.refined.center_world_m[frame], axis=1)
        size[rows] = away / focal
    return size


def _rms(residual: Floats) -> float:
    good = residual[np.isfinite(residual[:, 0])]
    return float(np.sqrt(np.mean(good**2))) if len(good) else np.nan


def _height(result: Result, poses: PoseTable) -> Floats:
    center = poses.center_world_m
    return np.asarray(center[:, 2] - result.plane.height_at(center[:, :2]), dtype=np.float64)


def log_plots(recorder: Recorder, result: Result, curves: FrameCurves) -> None:
    """Log every curve.

    Parameters
    ----------
    recorder
        The open recording.
    result
        Result of the run.
    curves
        Curves of this result.
    """
    limit = np.full(len(curves.worst_w), curves.limit_w)
    one = table_unit(units_of(result))
    misses = [one.factor * curve for curve in (curves.refined_rms_m, curves.sigma_m)]
    seeded = one.factor * curves.seed_rms_m
    for path, values, name, colour in (
        (f"{MISS_REFINED}/refined", misses[0], f"after the adjustment [{one.symbol}]", REFINED),
        (
            f"{MISS_REFINED}/sigma_of_picks",
            misses[1],
            f"stated sigma of the picks [{one.symbol}]",
            OBSERVED,
        ),
        (MISS_SEED, seeded, f"flight log alone [{one.symbol}]", SEED),
        (f"{RESIDUAL_REFINED}/refined", curves.refined_rms_px, "refined [px]", REFINED),
        (f"{RESIDUAL_REFINED}/sigma_of_picks", curves.sigma_px, "σ of the picks [px]", OBSERVED),
        (f"{WORST_W}/worst", curves.worst_w, "largest misfit", REFINED),
        (f"{WORST_W}/limit", limit, f"suspect beyond {curves.limit_w:.2f}", BAD),
        (RESIDUAL_SEED, curves.seed_rms_px, "flight log [px]", SEED),
    ):
        recorder.curve(path, values, name, colour)
    frames = result.frames
    for path, height, poses, name, colour in (
        (f"{HEIGHT}/flight_log", curves.seed_height_m, frames.seed, "flight log", SEED),
        (f"{HEIGHT}/refined", curves.refined_height_m, frames.refined, "refined", REFINED),
    ):
        variance = one.factor**2 * poses.covariance[:, 2, 2]
        _heights(recorder, path, one.factor * height, variance, f"{name} [{one.symbol}]", colour)


def _heights(
    recorder: Recorder, path: str, height: Floats, variance: Floats, name: str, colour: Rgb
) -> None:
    known = np.flatnonzero(np.isfinite(height) & np.isfinite(variance))
    if len(known):
        recorder.static(path, rr.Measurements.from_fields(colors=colour, names=name, widths=2.0))
        recorder.rows(
            path,
            known,
            lambda some: rr.Measurements.columns(values=height[some], variances=variance[some]),
        )


def log_status(recorder: Recorder, result: Result) -> None:
    """Log the state of each frame, and an end without which the last would have no width."""
    recorder.states(STATUS, frame_states(result), FRAME_COLOURS, FRAME_STATE_WORDS)
    recorder.end_after_last(STATUS, rr.StateChange.columns(state=[""]))  # "" ends a state


CORRECTION = "plots/attitude_correction"
ATTITUDE_SIGMA = "plots/attitude_sigma"
POSITION_SIGMA = "plots/position_sigma"


@dataclass(frozen=True, eq=False)
class PoseCurves:
    """Curves over the F frames; NaN if a frame has no such pose.

    Attributes
    ----------
    tilt_deg
        (F,) angle between the optical axes of the adjustment and of the flight log.
    turn_deg
        (F,) rotation of the photo about that axis, not signed.
    seed_attitude_deg, refined_attitude_deg
        (F,) standard deviation about the least certain of the camera's axes.
    seed_position_m, refined_position_m
        (F,) standard deviation along the least certain of east, north and up.
    """

    tilt_deg: Floats
    turn_deg: Floats
    seed_attitude_deg: Floats
    refined_attitude_deg: Floats
    seed_position_m: Floats
    refined_position_m: Floats


def pose_curves(result: Result) -> PoseCurves:
    """Compare the adjusted poses with those of the flight log."""
    seed, refined = result.frames.seed, result.frames.refined
    # adjusted axes in the camera frame of the flight log
    change = np.einsum("nji,njk->nik", seed.world_from_camera, refined.world_from_camera)
    # rotation about the optical axis that is nearest to the change
    turn = np.arctan2(change[:, 1, 0] - change[:, 0, 1], change[:, 0, 0] + change[:, 1, 1])
    seed_position, seed_attitude = largest_sigmas(seed)
    refined_position, refined_attitude = largest_sigmas(refined)
    return PoseCurves(
        tilt_deg=np.degrees(np.arccos(np.clip(change[:, 2, 2], -1.0, 1.0))),
        turn_deg=np.degrees(np.abs(turn)),
        seed_attitude_deg=seed_attitude,
        refined_attitude_deg=refined_attitude,
        seed_position_m=seed_position,
        refined_position_m=refined_position,
    )


def log_pose_plots(recorder: Recorder, curves: PoseCurves, units: Units = METRIC) -> None:
    """Log every curve.

    Parameters
    ----------
    recorder
        The open recording.
    curves
        Curves of the poses.
    units
        Units in which lengths are shown.
    """
    one = table_unit(units)
    for path, values, name, colour in (
        (f"{CORRECTION}/tilt", curves.tilt_deg, "optical axis tilted [°]", REFINED),
        (f"{CORRECTION}/turn", curves.turn_deg, "photo turned [°]", MEASURED),
        (f"{CORRECTION}/log_sigma", curves.seed_attitude_deg, "σ of the flight log [°]", OBSERVED),
        (f"{ATTITUDE_SIGMA}/flight_log", curves.seed_attitude_deg, "flight log [°]", SEED),
        (f"{ATTITUDE_SIGMA}/refined", curves.refined_attitude_deg, "refined [°]", REFINED),
    ):
        recorder.curve(path, values, name, colour)
    for path, values, name, colour in (
        (f"{POSITION_SIGMA}/flight_log", curves.seed_position_m, "flight log", SEED),
        (f"{POSITION_SIGMA}/refined", curves.refined_position_m, "refined", REFINED),
    ):
        recorder.curve(path, one.factor * values, f"{name} [{one.symbol}]", colour)

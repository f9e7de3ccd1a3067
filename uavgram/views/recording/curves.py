"""Curves over the frames: residuals, tests, heights, and changes and sigmas of the poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import rerun as rr

from uavgram.model.arrays import Floats
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

PLOTS = "plots"
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


def log_status(recorder: Recorder, result: Result) -> None:
    """Log the state of each frame, and an end without which the last would have no width."""
    recorder.states(STATUS, frame_states(result), FRAME_COLOURS, FRAME_STATE_WORDS)
    recorder.end_after_last(STATUS, rr.StateChange.columns(state=[""]))  # "" ends a state


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


class Curve(NamedTuple):
    """Curve of a plot: last word of its path, (F,) values, name and colour; perhaps variances."""

    path: str
    values: Floats
    name: str
    colour: Rgb
    variance: Floats | None = None


class Plot(NamedTuple):
    """Plot of several curves: path and title, with its unit."""

    path: str
    title: str
    curves: tuple[Curve, ...]

    @property
    def values(self) -> Floats:
        """Values of all curves, for the range: with a variance, one sigma above them."""
        return np.concatenate(
            [
                one.values if one.variance is None else one.values + np.sqrt(one.variance)
                for one in self.curves
            ]
        )


def list_plots(result: Result, curves: FrameCurves, poses: PoseCurves) -> dict[str, list[Plot]]:
    """Return the plots that have values, by the title of their row.

    Rows are: fit of the picks on the ground, and in pixels; changes and sigmas of the poses.

    Parameters
    ----------
    result
        Result of the run.
    curves, poses
        Curves over its frames.
    """
    factor, unit = table_unit(units_of(result)).factor, table_unit(units_of(result)).symbol
    seed, refined = (
        factor**2 * one.covariance[:, 2, 2] for one in (result.frames.seed, result.frames.refined)
    )
    limit = np.full(len(curves.worst_w), curves.limit_w)
    rows = {
        "How the picks fit: white expected, red limit": [
            Plot("miss", f"Picks miss [{unit}]", (
                Curve("refined", factor * curves.refined_rms_m, "after the adjustment", REFINED),
                Curve("sigma_of_picks", factor * curves.sigma_m, "stated sigma", OBSERVED),
            )),
            Plot("worst_w", "Worst pick [σ]", (
                Curve("worst", curves.worst_w, "largest misfit", REFINED),
                Curve("limit", limit, f"suspect beyond {curves.limit_w:.2f}", BAD),
            )),
            Plot("miss_of_flight_log", f"Log misses [{unit}]", (
                Curve("flight_log", factor * curves.seed_rms_m, "flight log alone", SEED),
            )),
        ],
        "In pixels": [
            Plot("residual", "Picks miss [px]", (
                Curve("refined", curves.refined_rms_px, "refined", REFINED),
                Curve("sigma_of_picks", curves.sigma_px, "stated sigma", OBSERVED),
            )),
            Plot("residual_of_flight_log", "Log misses [px]", (
                Curve("flight_log", curves.seed_rms_px, "flight log", SEED),
            )),
        ],
        "Heights, attitudes and sigmas": [
            Plot("height", f"Height, ±1 σ [{unit}]", (
                Curve("flight_log", factor * curves.seed_height_m, "flight log", SEED, seed),
                Curve("refined", factor * curves.refined_height_m, "refined", REFINED, refined),
            )),
            Plot("attitude_correction", "Tilted, turned, σ of log [°]", (
                Curve("tilt", poses.tilt_deg, "optical axis tilted", REFINED),
                Curve("turn", poses.turn_deg, "photo turned", MEASURED),
                Curve("log_sigma", poses.seed_attitude_deg, "σ of the flight log", OBSERVED),
            )),
            Plot("attitude_sigma", "σ of attitude [°]", (
                Curve("flight_log", poses.seed_attitude_deg, "flight log", SEED),
                Curve("refined", poses.refined_attitude_deg, "refined", REFINED),
            )),
            Plot("position_sigma", f"σ of position [{unit}]", (
                Curve("flight_log", factor * poses.seed_position_m, "flight log", SEED),
                Curve("refined", factor * poses.refined_position_m, "refined", REFINED),
            )),
        ],
    }  # fmt: skip
    known = {
        title: [one for one in plots if np.isfinite(one.values).any()]
        for title, plots in rows.items()
    }
    return {title: plots for title, plots in known.items() if plots}


def log_plots(recorder: Recorder, rows: dict[str, list[Plot]]) -> None:
    """Log the curves of all plots; the legend of each curve has the unit of its plot."""
    for plot in (plot for plots in rows.values() for plot in plots):
        for one in plot.curves:
            recorder.curve(
                f"{PLOTS}/{plot.path}/{one.path}", one.values, one.name, one.colour, one.variance
            )

"""Summarise the adjusted survey in the tables of a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.ground_planes import PLANE_SIZE
from uavgram.estimation.survey.observations.telemetry import TELEMETRY_PARTS
from uavgram.geometry.motion.camera_motion import correct_time
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import Frames, PhotoExposures, Poses
from uavgram.model.result.result import (
    Alternative,
    AreaPlane,
    Estimate,
    GroupFactor,
    OrientationCorrelation,
    SharedResult,
    SolutionSummary,
)
from uavgram.model.result.tables import FrameResults, FrameStatus, PoseTable, TieCloud, TieSummary

PLANE_NAMES = ("plane height", "slope east", "slope north")
DECIMALS = 4


def summarise_orientation(adjustment: Adjustment) -> OrientationCorrelation:
    """Correlate each adjusted pose with the lens, the first area's plane, and the readout."""
    survey = adjustment.survey
    joint = adjustment.sight_covariance(np.arange(adjustment.problem.layout.frames))
    sigma = np.sqrt(np.diagonal(joint, axis1=1, axis2=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        known = joint / (sigma[:, :, None] * sigma[:, None, :])
    correlation = np.where(np.isfinite(known), known, np.nan).round(DECIMALS) + 0.0
    readout = ("readout time",) * adjustment.problem.layout.readout
    return OrientationCorrelation(
        parameters=(*survey.calibration.parameter_names, *PLANE_NAMES, *readout),
        shared=correlation[0, 6:, 6:],
        frame_id=survey.frame_id,
        with_pose=correlation[:, :6, 6:],
    )


class Tied(NamedTuple):
    """Tie points of the photos.

    Attributes
    ----------
    ties, rms_px
        (F,) number of tie points in each photo, and the root mean square of their residuals in each
        coordinate; NaN where it shows none.
    together
        Summary of all; None where none takes part.
    """

    ties: Ints
    rms_px: Floats
    together: TieSummary | None


def summarise_ties(adjustment: Adjustment, frame_id: Sequence[str]) -> Tied:
    """Summarise the tie points of an adjusted survey.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    frame_id
        (F,) all frames of the project.
    """
    ties = adjustment.survey.ties
    if not ties.points:
        return Tied(np.zeros(len(frame_id), np.int64), np.full(len(frame_id), np.nan), None)
    residual = adjustment.minimum.blocks["ties"].residual * ties.sigma_px[:, None]
    mean_square = np.mean(residual**2, axis=1)
    frame = _rows(adjustment, frame_id)[ties.frame]
    count = np.bincount(frame, minlength=len(frame_id))
    total = np.bincount(frame, mean_square, minlength=len(frame_id))
    rms = np.full(len(frame_id), np.nan)
    np.divide(total, count, out=rms, where=count > 0)
    together = TieSummary(
        points=ties.points, sightings=len(frame), rms_px=float(np.sqrt(mean_square.mean()))
    )
    return Tied(count, np.sqrt(rms), together)


def tie_cloud(adjustment: Adjustment, frame_id: Sequence[str]) -> TieCloud | None:
    """Return tie points for display; None where none takes part.

    Parameters
    ----------
    adjustment, frame_id
        As for `summarise_ties`.
    """
    survey = adjustment.survey
    if not survey.ties.points:
        return None
    return TieCloud(
        position_world_m=adjustment.state.tie[survey.matches.points :],
        frame=_rows(adjustment, frame_id)[survey.ties.frame],
        pixel_px=survey.ties.pixel_px,
    )


def _rows(adjustment: Adjustment, frame_id: Sequence[str]) -> Ints:
    """Return the row of each frame of the adjustment among all frames."""
    row = {name: i for i, name in enumerate(frame_id)}
    return np.array([row[name] for name in adjustment.survey.frame_id], dtype=np.int64)


DEGREES = 180.0 / np.pi


def summarise_shared(adjustment: Adjustment, clock_offset_s: float) -> SharedResult:
    """Summarise shared unknowns with their standard deviations, angles in degrees.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    clock_offset_s
        Assumed camera clock minus UTC; the clock correction is added to it.
    """
    layout, state = adjustment.problem.layout, adjustment.state
    basis = adjustment.problem.intrinsic_root(state)
    intrinsic = adjustment.shared_covariance(layout.first_intrinsic, layout.intrinsics)
    intrinsic_sigma = np.sqrt(np.einsum("ij,jk,ik->i", basis, intrinsic, basis))
    part = _telemetry_parts(adjustment)
    if isinstance(adjustment.survey.track, PhotoExposures):
        for name in ("clock", "clock_drift"):  # independent of a clock: its prior is unchanged
            part.pop(name)
    rolling = adjustment.survey.rolling
    by_photos = rolling is not None and rolling.by_photos  # then no time: see RollingShutter
    return SharedResult(
        boresight_deg=_convert_estimate(part.get("boresight"), DEGREES),
        lever_arm_m=part.get("lever_arm"),
        position_bias_m=part.get("position_bias"),
        heading_bias_deg=_convert_estimate(part.get("heading_bias"), DEGREES),
        clock_offset_s=_convert_estimate(part.get("clock"), shift=clock_offset_s),
        clock_drift_ppm=_convert_estimate(part.get("clock_drift"), 1e6),
        readout_s=Estimate(value=state.readout, sigma=_sigmas(adjustment, layout.first_readout, 1))
        if layout.readout and not by_photos
        else None,
        intrinsics=Estimate(value=adjustment.problem.intrinsics(state), sigma=intrinsic_sigma),
        tape_scale=_tape_scales(adjustment),
    )


def summarise_areas(adjustment: Adjustment) -> tuple[AreaPlane, ...]:
    """Return the plane of every area, the first one first; sigmas are 0 where it is the gauge."""
    layout, state = adjustment.problem.layout, adjustment.state
    sigma = np.zeros(len(state.plane))
    unknown = slice(len(sigma) - layout.plane, None)
    sigma[unknown] = _sigmas(adjustment, layout.first_plane, layout.plane)
    planes, sigmas = state.plane.reshape(-1, PLANE_SIZE), sigma.reshape(-1, PLANE_SIZE)
    return tuple(
        AreaPlane(
            name=ground.name,
            height_m=Estimate(value=plane[:1], sigma=own[:1]),
            slope_deg=Estimate(
                value=np.rad2deg(np.arctan(plane[1:])),
                sigma=np.rad2deg(own[1:] / (1.0 + plane[1:] ** 2)),
            ),
            pivot_m=pivot,
        )
        for ground, plane, own, pivot in zip(
            adjustment.survey.grounds, planes, sigmas, adjustment.problem.pivot_m, strict=True
        )
    )


def _telemetry_parts(adjustment: Adjustment) -> dict[str, Estimate]:
    layout, state = adjustment.problem.layout, adjustment.state
    if not layout.telemetry:
        return {}
    sigma = _sigmas(adjustment, layout.first_telemetry, layout.telemetry)
    return {
        name: Estimate(value=state.telemetry[part], sigma=sigma[part])
        for name, part in TELEMETRY_PARTS.items()
    }


def _tape_scales(adjustment: Adjustment) -> dict[str, Estimate]:
    layout, value = adjustment.problem.layout, adjustment.state.tape
    sigma = _sigmas(adjustment, layout.first_tape, layout.tape)
    return {
        name: Estimate(value=value[k : k + 1], sigma=sigma[k : k + 1])
        for k, name in enumerate(adjustment.problem.tapes)
    }


def _sigmas(adjustment: Adjustment, first: int, count: int) -> Floats:
    """Return standard deviations (count,) of neighbouring shared unknowns."""
    if not count:
        return np.zeros(0)
    return np.sqrt(np.diag(adjustment.shared_covariance(first, count)))


def _convert_estimate(
    estimate: Estimate | None, factor: float = 1.0, shift: float = 0.0
) -> Estimate | None:
    """Convert an estimate to another unit, or to another zero."""
    if estimate is None:
        return None
    return Estimate(value=factor * estimate.value + shift, sigma=factor * estimate.sigma)


def summarise_frames(
    frames: Frames,
    path: tuple[str, ...],
    folder: str,
    seeds: Poses | None,
    refined: Refined,
    picked: Mapping[str, str],
) -> FrameResults:
    """Collect status and poses of every frame of the project.

    Parameters
    ----------
    frames
        All F frames.
    path, folder
        (F,) of their photos, relative to the folder of the project where they are inside.
    seeds
        Poses from the telemetry, of the matched frames.
    refined
        The adjusted survey.
    picked
        Frame name to the reason why its picks were left out (empty where they were not), for every
        frame with picks.
    """
    adjustment = refined.adjustment
    adjusted = Poses(
        frame_id=adjustment.survey.frame_id,
        center_world_m=adjustment.state.center,
        world_from_camera=adjustment.state.rotation,
        covariance=adjustment.frame_covariance(),
    )
    refined_names = frozenset(adjusted.frame_id)
    seeded = None if seeds is None else frozenset(seeds.frame_id)
    verdicts = [
        _status(name, refined_names, picked, seeded, why)
        for name, why in zip(frames.frame_id, frames.reason, strict=True)
    ]
    time_s = frames.time_utc_s
    if adjustment.survey.telemetry is not None:
        middle_s = adjustment.survey.telemetry.middle_s
        time_s = correct_time(adjustment.state.telemetry, time_s, middle_s)
    return FrameResults(
        frame_id=frames.frame_id,
        path=path,
        folder=folder,
        time_utc_s=time_s,
        status=tuple(status for status, _ in verdicts),
        reason=tuple(why for _, why in verdicts),
        seed=_table(frames.frame_id, seeds),
        refined=_table(frames.frame_id, adjusted),
        sweep=_sweep(frames.frame_id, adjustment),
    )


def _sweep(frame_id: tuple[str, ...], adjustment: Adjustment) -> Floats:
    """Return the sweep (F, 6) of all frames, 0 for those that are not adjusted."""
    row = {name: i for i, name in enumerate(frame_id)}
    sweep = np.zeros((len(frame_id), 6))
    sweep[[row[name] for name in adjustment.survey.frame_id]] = adjustment.sweep()
    return sweep


def _status(
    name: str,
    refined: frozenset[str],
    picked: Mapping[str, str],
    seeded: frozenset[str] | None,
    reason: str,
) -> tuple[FrameStatus, str]:
    if name in refined:
        return "refined", ""
    if picked.get(name):
        return "rejected", picked[name]
    if seeded is not None and name not in seeded:
        return "unmatched", reason
    if name in picked:
        return "rejected", "its picks do not determine its pose"
    if seeded is None:
        return "unmatched", "no flight log and no picks"
    return "seeded", "no picks"


def _table(frame_id: tuple[str, ...], poses: Poses | None) -> PoseTable:
    """Return poses in the order of the frames, NaN where a frame has none."""
    count = len(frame_id)
    center, rotation = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    covariance = np.full((count, 6, 6), np.nan)
    if poses is not None:
        row = {name: i for i, name in enumerate(frame_id)}
        index = [row[name] for name in poses.frame_id]
        center[index], rotation[index] = poses.center_world_m, poses.world_from_camera
        covariance[index] = poses.covariance
    return PoseTable(center_world_m=center, world_from_camera=rotation, covariance=covariance)


def summarise_solution(
    refined: Refined,
    groups: tuple[GroupFactor, ...],
    alternative_values: tuple[tuple[float, ...], ...],
) -> SolutionSummary:
    """Summarise degrees of freedom, variance factor, convergence, and alternative solutions.

    Parameters
    ----------
    refined
        The adjusted survey and its alternatives.
    groups
        Variance factors by group.
    alternative_values
        The measured values under each alternative.
    """
    minimum = refined.adjustment.minimum
    degrees = refined.adjustment.degrees_of_freedom
    return SolutionSummary(
        degrees_of_freedom=degrees,
        variance_factor=refined.adjustment.variance_factor,
        chi2_probability=compute_upper_tail(minimum.cost, degrees),
        iterations=minimum.iterations,
        converged=minimum.converged,
        alternatives=tuple(
            _alternative(other, values)
            for other, values in zip(refined.alternatives, alternative_values, strict=True)
        ),
        groups=groups,
    )


def _alternative(adjustment: Adjustment, values: tuple[float, ...]) -> Alternative:
    state = adjustment.state
    tilt = np.arccos(np.clip(-state.rotation[0, 2, 2], -1.0, 1.0))
    return Alternative(
        frame_id=adjustment.survey.frame_id[0],
        cost=adjustment.minimum.cost,
        height_m=float(state.center[0, 2]),
        tilt_deg=float(np.rad2deg(tilt)),
        values=values,
    )

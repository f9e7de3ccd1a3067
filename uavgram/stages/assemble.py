"""Assemble: names become indices, and everything observed becomes one survey."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from uavgram.errors import GeometryError, near_miss
from uavgram.estimation.survey.correlated_errors import trend_inflation
from uavgram.model.arrays import Floats, FrozenArrays, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.flight.photo_poses import Flight
from uavgram.model.flight.pose import Poses, TelemetryPrior
from uavgram.model.message import Message
from uavgram.model.options import GroundOptions
from uavgram.model.survey.observations import KnownLines, KnownWorldPoints, Picks
from uavgram.model.survey.survey import DEFAULT_AREA, Ground, Survey

NO_CONTROL = KnownWorldPoints(label=(), world_m=np.empty((0, 3)), sigma_m=np.empty((0, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Telemetry:
    """Seed poses, their prior for the adjustment, and the flight (or the photos' own poses).

    `correlation_s` is the range of the time over which errors of frames go together; None: each is
    on its own.
    """

    poses: Poses
    prior: TelemetryPrior
    track: Flight
    correlation_s: tuple[float, float] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembled(FrozenArrays):
    """A survey, and where the project's picks and lines went.

    Attributes
    ----------
    survey
        Ready to refine.
    pick_index
        (P,) into the survey's picks; -1 for picks in frames without a pose.
    line_index
        (L,) into the survey's lines; -1 for withheld lines and those with an end never picked.
    pick_sigma_px
        (P,) of every pick, the default filled in.
    """

    survey: Survey
    pick_index: Annotated[Ints, "p"]
    line_index: Annotated[Ints, "l"]
    pick_sigma_px: Annotated[Floats, "p"]


def assemble(
    calibration: Calibration,
    picks: Picks,
    lines: KnownLines,
    control: KnownWorldPoints | None,
    telemetry: Telemetry | None,
    ground: GroundOptions,
    picks_sigma_px: float,
    photos: Sequence[str] = (),
    *,
    copies: Collection[str] = (),
) -> Assembled:
    """Make one survey of what was observed.

    Frames take part where they have a pick and, with a log, an instant in it. The gauge is
    ``world`` where telemetry or two picked control points fix position and heading. Without
    telemetry frames come in the order of `photos`, so that of the picks means nothing. Photos of
    `copies` stay out: others stand for them.

    Raises
    ------
    GeometryError
        No frame takes part.
    """
    control = control or NO_CONTROL
    posed = set(picks.image) if telemetry is None else set(telemetry.poses.frame_id)
    posed -= set(copies)
    used = np.array([image in posed for image in picks.image], dtype=bool)
    if not used.any():
        raise GeometryError(
            "no usable frame remains: not one pick lies in a photo that the flight log covers; "
            "the reasons stand with the frames (uavgram check)"
        )
    order = (*photos, *picks.image) if telemetry is None else telemetry.poses.frame_id
    picked = {picks.image[i] for i in np.flatnonzero(used)}
    frame_id = tuple(f for f in dict.fromkeys(order) if f in picked)
    label = tuple(dict.fromkeys(picks.label[i] for i in np.flatnonzero(used)))
    label_at = {name: k for k, name in enumerate(label)}
    frame_at = {name: k for k, name in enumerate(frame_id)}
    chosen = np.flatnonzero(used)
    seen = [
        i
        for i in range(len(lines.name))
        if lines.adjust[i] and lines.start[i] in label_at and lines.end[i] in label_at
    ]
    known = [i for i, name in enumerate(control.label) if name in label_at]
    areas = _areas(picks, label_at)
    # The default area comes first where any label lies in it: with a free gauge it is z = 0.
    ranked = sorted(dict.fromkeys(areas), key=lambda name: name != DEFAULT_AREA)
    area_at = {name: k for k, name in enumerate(ranked)}
    gauge: Literal["world", "plane"] = (
        "world" if telemetry is not None or len(known) >= 2 else "plane"
    )
    if gauge == "plane":
        known = []
    sigma = np.where(np.isnan(picks.sigma_px), picks_sigma_px, picks.sigma_px)
    survey = Survey(
        frame_id=frame_id,
        seeds=None if telemetry is None else _ordered(telemetry.poses, frame_id),
        telemetry=None if telemetry is None else _prior(telemetry, frame_at),
        track=None if telemetry is None else telemetry.track,
        calibration=calibration,
        label=label,
        height_above_m=_heights(picks, label_at),
        pick_frame=np.array([frame_at[picks.image[i]] for i in chosen]),
        pick_label=np.array([label_at[picks.label[i]] for i in chosen]),
        pixel_px=picks.pixel_px[chosen],
        pick_sigma_px=sigma[chosen],
        line_start=np.array([label_at[lines.start[i]] for i in seen], dtype=np.int64),
        line_end=np.array([label_at[lines.end[i]] for i in seen], dtype=np.int64),
        length_m=lines.length_m[seen],
        length_sigma_m=lines.sigma_m[seen],
        line_name=tuple(lines.name[i] for i in seen),
        control_label=np.array([label_at[control.label[i]] for i in known], dtype=np.int64),
        control_world_m=control.world_m[known],
        control_sigma_m=control.sigma_m[known],
        grounds=tuple(_ground(ground, name) for name in area_at),
        area=np.array([area_at[name] for name in areas]),
        gauge=gauge,
    )
    pick_index = np.full(len(picks.image), -1)
    pick_index[chosen] = np.arange(len(chosen))
    line_index = np.full(len(lines.name), -1)
    line_index[seen] = np.arange(len(seen))
    return Assembled(
        survey=survey, pick_index=pick_index, line_index=line_index, pick_sigma_px=sigma
    )


def _heights(picks: Picks, label_at: dict[str, int]) -> Floats:
    """(K,) known height of each label above the plane; stated at one pick, it holds for all."""
    height = np.zeros(len(label_at))
    for i, name in enumerate(picks.label):
        if name in label_at and np.isfinite(picks.height_m[i]):
            height[label_at[name]] = picks.height_m[i]
    return height


def _areas(picks: Picks, label_at: dict[str, int]) -> list[str]:
    """(K,) area of each label; stated at one pick, it holds for all."""
    areas = [DEFAULT_AREA] * len(label_at)
    for label, area in zip(picks.label, picks.area or ("",) * len(picks.label), strict=True):
        if area and label in label_at:
            areas[label_at[label]] = area
    return areas


def _ground(options: GroundOptions, area: str) -> Ground:
    """An area's plane beforehand."""
    own = options.of(area)
    return Ground(
        name=area,
        height_m=own.height_m,
        height_sigma_m=own.height_sigma_m,
        slope_sigma_rad=float(np.deg2rad(own.slope_sigma_deg)),
        roughness_sigma_m=own.roughness_sigma_m,
    )


def unpicked_areas(ground: GroundOptions, survey: Survey) -> tuple[Message, ...]:
    """A message on every area of the options in which no usable pick lies."""
    picked = tuple(one.name for one in survey.grounds)
    messages = []
    for name in ground.areas:
        if name not in picked:
            near = near_miss(name, picked)
            text = (
                f"The ground's area {name!r} is not used: no usable pick names it in the column "
                f"`area` of picks.csv{f' ({near})' if near else ''}."
            )
            messages.append(Message("warning", "area-unpicked", text))
    return tuple(messages)


def _ordered(poses: Poses, frame_id: tuple[str, ...]) -> Poses:
    row = {name: k for k, name in enumerate(poses.frame_id)}
    return poses.take(np.array([row[name] for name in frame_id], dtype=np.int64))


def _prior(telemetry: Telemetry, frame_at: dict[str, int]) -> TelemetryPrior:
    prior = telemetry.prior
    names = [telemetry.poses.frame_id[k] for k in prior.frame_index]
    rows = [k for k, name in enumerate(names) if name in frame_at]
    time_s = prior.time_s[rows]
    factor = 1.0
    if telemetry.correlation_s is not None:
        factor = trend_inflation(time_s, *telemetry.correlation_s)
    return replace(
        prior,
        frame_index=np.array([frame_at[names[k]] for k in rows]),
        time_s=time_s,
        covariance=factor * prior.covariance[rows],
    )

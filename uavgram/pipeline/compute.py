"""The order of the stages: read this to know the whole program.

::

    synchronise -> trajectory -> seed          where the log has each frame
    assemble -> refine                         one likelihood
    reconstruct, measure, judge, summarise     what comes out, and how well it fits
"""

from __future__ import annotations

import importlib.metadata
import sys
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from uavgram.errors import GeometryError, InputError, UavgramError
from uavgram.estimation.adjustment import Refined
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.model.arrays import Floats
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import KnownPoints, KnownWorldPoints
from uavgram.model.options import GeodeticOrigin, Project, option_pairs
from uavgram.model.result import Provenance, Result
from uavgram.model.telemetry import FlightLog, HeightDatum
from uavgram.model.world import World
from uavgram.pipeline.inputs import Inputs
from uavgram.stages.assemble import Assembled, Telemetry, assemble
from uavgram.stages.judge import (
    PickTable,
    judge_groups,
    judge_lines,
    judge_picks,
    judge_points,
    judge_priors,
)
from uavgram.stages.measure import measure
from uavgram.stages.reconstruct import reconstruct
from uavgram.stages.refine import refine
from uavgram.stages.seed import seed
from uavgram.stages.summarise import summarise_frames, summarise_shared, summarise_solution
from uavgram.stages.synchronise import Synchronised, synchronise
from uavgram.stages.trajectory import build_track, find_home

PACKAGES = ("numpy", "scipy", "opencv-python-headless", "pymavlink", "pyproj", "rerun-sdk")


@dataclass(frozen=True, kw_only=True, eq=False)
class Posed:
    """The frames on the log's clock, with seed poses in the local world.

    Without a log `telemetry` is None.
    """

    world: World
    frames: Frames
    telemetry: Telemetry | None
    messages: tuple[Message, ...]


def pose_frames(inputs: Inputs) -> Posed:
    """Match the photos to the log and seed their poses; without a log, only name the world."""
    if inputs.log is None:
        return _without_log(inputs)
    project = inputs.project
    matched = _synchronise(inputs, inputs.log)
    frames = matched.frames
    if not frames.matched.any():
        reasons = "; ".join(
            f"{name}: {why}" for name, why in zip(frames.frame_id, frames.reason, strict=True)
        )
        raise GeometryError(
            f"no usable frame remains, {inputs.log.path} covers no photo: {reasons}"
        )
    first = float(np.nanmin(np.where(frames.matched, frames.time_utc_s, np.nan)))
    home, datum, home_messages = find_home(matched.boot, matched.clock, first)
    latitude, longitude, height = home
    origin = project.world.origin
    if isinstance(origin, GeodeticOrigin):
        latitude, longitude = origin.latitude_deg, origin.longitude_deg
        height = origin.height_m + height_shift(project, inputs.log, datum)
    track, track_messages = build_track(
        matched.boot,
        matched.clock,
        (latitude, longitude, height),
        project.mount,
        project.telemetry,
    )
    seeds = seed(frames, track, project.mount, project.telemetry)
    world = World(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        height_datum=datum,
        gauge="world",
    )
    return Posed(
        world=world,
        frames=frames,
        telemetry=Telemetry(poses=seeds.poses, prior=seeds.prior, track=track),
        messages=(*matched.messages, *home_messages, *track_messages),
    )


def compute(inputs: Inputs) -> Result:
    """Run every stage on what was read."""
    project = inputs.project
    posed = pose_frames(inputs)
    control, control_messages = _in_world(inputs, inputs.control, posed.world)
    check, check_messages = _in_world(inputs, inputs.check, posed.world)
    assembled = assemble(
        inputs.calibration,
        inputs.picks,
        inputs.lines,
        control,
        posed.telemetry,
        project.ground,
        project.picks_sigma_px,
    )
    world = replace(posed.world, gauge=assembled.survey.gauge)
    if world.gauge == "plane":
        world = replace(world, latitude_deg=None, longitude_deg=None, height_m=None)
    refined, refine_messages = refine(assembled.survey, project.solve)
    adjustment = refined.adjustment
    points = reconstruct(adjustment, world)
    measurements, measure_messages = measure(adjustment, inputs.requests, posed.frames)
    others = tuple(
        tuple(measure(other, inputs.requests, posed.frames)[0].value)
        for other in refined.alternatives
    )
    significance = project.solve.significance
    picks, pick_messages = judge_picks(refined, _pick_table(inputs, assembled), significance)
    lines, line_checks, line_messages = judge_lines(
        refined, inputs.lines, assembled.line_index, significance
    )
    checks, unseen_messages = judge_points(adjustment, check)
    groups, group_messages = judge_groups(adjustment, significance)
    return Result(
        name=project.name,
        provenance=_provenance(inputs),
        world=world,
        camera=inputs.calibration,
        shared=summarise_shared(adjustment, posed.frames.clock_offset_s),
        frames=summarise_frames(
            posed.frames,
            inputs.photos.path,
            None if posed.telemetry is None else posed.telemetry.poses,
            refined,
            _picked_frames(inputs, assembled, refined),
        ),
        points=points,
        lines=lines,
        picks=picks,
        measurements=measurements,
        point_checks=checks,
        line_checks=line_checks,
        solution=summarise_solution(refined, groups, others),
        messages=(
            *inputs.messages,
            *posed.messages,
            *control_messages,
            *check_messages,
            *_gauge_messages(inputs, world),
            *refine_messages,
            *measure_messages,
            *line_messages,
            *pick_messages,
            *unseen_messages,
            *group_messages,
            *judge_priors(adjustment, significance),
        ),
    )


def _synchronise(inputs: Inputs, log: FlightLog) -> Synchronised:
    try:
        return synchronise(inputs.photos, log, inputs.project.time)
    except UavgramError as fault:  # the stage knows instants; which file they are of is known here
        raise InputError(log.path, str(fault).removeprefix(f"{log.path}: ")) from fault


def _without_log(inputs: Inputs) -> Posed:
    """Names and file times of the frames, and a world that only control points can place."""
    photos, project = inputs.photos, inputs.project
    offset = project.time.offset_s
    known = 0.0 if offset == "auto" else offset
    count = len(photos.frame_id)
    resolution = np.nan_to_num(photos.file_time_resolution_s, nan=0.0)
    frames = Frames(
        frame_id=photos.frame_id,
        time_utc_s=photos.file_time_s - known,
        sigma_time_s=np.where(np.isfinite(photos.file_time_s), resolution / np.sqrt(12), np.nan),
        matched=np.zeros(count, dtype=bool),
        reason=("no flight log",) * count,
        clock_offset_s=known,
        clock_offset_sigma_s=project.time.offset_sigma_s,
    )
    place: tuple[float | None, float | None, float | None] = (None, None, None)
    messages: tuple[Message, ...] = ()
    origin = project.world.origin
    if isinstance(origin, GeodeticOrigin):
        place = (origin.latitude_deg, origin.longitude_deg, origin.height_m)
    elif inputs.control.kind == "geodetic" and len(inputs.control.label):
        first = inputs.control.coordinates[0]
        place = (float(first[0]), float(first[1]), float(first[2]))
        text = (
            f"Without a log there is no home: the world's origin is the control point "
            f"{inputs.control.label[0]!r}."
        )
        messages = (Message("info", "origin-control", text),)
    latitude, longitude, height = place
    world = World(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=height,
        height_datum=project.world.heights,
        gauge="world",
    )
    return Posed(world=world, frames=frames, telemetry=None, messages=messages)


def height_shift(project: Project, log: FlightLog | None, datum: HeightDatum) -> float:
    """What to add to a height of the input files to have it in the log's datum [m].

    Raises
    ------
    UavgramError
        The datums differ and the log does not say by how much.
    """
    if log is None or project.world.heights == datum:
        return 0.0
    if not np.isfinite(log.undulation_m):
        raise UavgramError(
            f"heights in the input files are {project.world.heights}, those of {log.path} are "
            f"{datum}, and the log does not say how far apart the two are: give all heights as "
            f"{datum} and set world.heights: {datum}"
        )
    return log.undulation_m if datum == "ellipsoid" else -log.undulation_m


def _in_world(
    inputs: Inputs, points: KnownPoints, world: World
) -> tuple[KnownWorldPoints, tuple[Message, ...]]:
    """Known points in the local world; none, with a message, where nothing places them."""
    coordinates: Floats = points.coordinates
    if points.kind == "geodetic" and len(points.label):
        if world.latitude_deg is None or world.longitude_deg is None or world.height_m is None:
            text = (
                "Points with latitude and longitude cannot be used: nothing ties this world to "
                "the earth. Give the log, world.origin, or geodetic control points."
            )
            return _no_points(), (Message("warning", "points-unplaced", text),)
        shift = height_shift(inputs.project, inputs.log, world.height_datum)
        latitude, longitude, height = points.coordinates.T
        coordinates = enu_from_geodetic(
            latitude,
            longitude,
            height + shift,
            (world.latitude_deg, world.longitude_deg, world.height_m),
        )
    return KnownWorldPoints(label=points.label, world_m=coordinates, sigma_m=points.sigma_m), ()


def _no_points() -> KnownWorldPoints:
    return KnownWorldPoints(label=(), world_m=np.empty((0, 3)), sigma_m=np.empty((0, 3)))


def _gauge_messages(inputs: Inputs, world: World) -> tuple[Message, ...]:
    if world.gauge == "world":
        return ()
    text = (
        "Nothing fixes position and heading (no flight log, fewer than two control points): "
        "lengths, areas and angles are right, coordinates are relative to the first frame."
    )
    messages = [Message("info", "gauge-plane", text)]
    if len(inputs.check.label):
        text = "Check points are not judged: coordinates mean nothing without a log or control."
        messages.append(Message("warning", "check-unjudged", text))
    return tuple(messages)


def _pick_table(inputs: Inputs, assembled: Assembled) -> PickTable:
    picks = inputs.picks
    sigma = np.where(np.isnan(picks.sigma_px), inputs.project.picks_sigma_px, picks.sigma_px)
    return PickTable(
        image=picks.image,
        label=picks.label,
        pixel_px=picks.pixel_px,
        sigma_px=sigma,
        survey_index=assembled.pick_index,
    )


def _picked_frames(inputs: Inputs, assembled: Assembled, refined: Refined) -> dict[str, str]:
    """Frames with picks, each with the first reason why one of its picks was left out."""
    reasons = dict.fromkeys(inputs.picks.image, "")
    for i, image in enumerate(inputs.picks.image):
        why = refined.pick_reason.get(int(assembled.pick_index[i]), "")
        reasons[image] = reasons[image] or why
    return reasons


def _provenance(inputs: Inputs) -> Provenance:
    versions = [(name, importlib.metadata.version(name)) for name in PACKAGES]
    python = ".".join(str(part) for part in sys.version_info[:3])
    return Provenance(
        program="uavgram",
        version=importlib.metadata.version("uavgram"),
        created_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        inputs=inputs.digests,
        options=option_pairs(inputs.project),
        seed=None,
        packages=(("python", python), *versions),
    )

"""The order of the stages: read this to know the whole program.

::

    synchronise -> trajectory -> seed          where the log has each frame (pipeline/pose.py), or
    photo_exposures -> seed                    where the photos themselves say they were taken
    assemble -> refine                         one likelihood
    reconstruct, measure, judge, summarise     what comes out, and how well it fits
"""

from __future__ import annotations

import importlib.metadata
import sys
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from uavgram.errors import near_miss
from uavgram.estimation.adjustment import Refined
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.model.arrays import Floats
from uavgram.model.message import Message
from uavgram.model.observations import KnownPoints, KnownWorldPoints
from uavgram.model.options import option_pairs
from uavgram.model.result import MonteCarloResults, Provenance, Result
from uavgram.model.world import World
from uavgram.pipeline.inputs import Inputs
from uavgram.pipeline.pose import height_shift, pose_frames
from uavgram.stages.assemble import Assembled, assemble
from uavgram.stages.judge import (
    PickTable,
    judge_groups,
    judge_lines,
    judge_picks,
    judge_points,
    judge_priors,
)
from uavgram.stages.measure import measure
from uavgram.stages.monte_carlo import compare, sample
from uavgram.stages.reconstruct import reconstruct
from uavgram.stages.refine import refine
from uavgram.stages.summarise import summarise_frames, summarise_shared, summarise_solution

PACKAGES = ("numpy", "scipy", "opencv-python-headless", "pymavlink", "pyproj", "rerun-sdk")


@dataclass(frozen=True)
class Sampling:
    """A Monte Carlo check of the measurements: how many repetitions, and the draws' seed."""

    count: int
    seed: int = 0


def compute(inputs: Inputs, sampling: Sampling | None = None) -> Result:
    """Run every stage on what was read, and sample the measurements where that is asked for."""
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
    sampled: MonteCarloResults | None = None
    sampled_messages: tuple[Message, ...] = ()
    if sampling is not None:
        sampled = sample(adjustment, inputs.requests, posed.frames, sampling.count, sampling.seed)
        sampled_messages = compare(measurements, sampled)
    significance = project.solve.significance
    picks, pick_messages = judge_picks(refined, _pick_table(inputs, assembled), significance)
    lines, line_checks, line_messages = judge_lines(
        refined, inputs.lines, assembled.line_index, significance
    )
    checks, unseen_messages = judge_points(adjustment, check)
    groups, group_messages = judge_groups(adjustment, significance)
    return Result(
        name=project.name,
        provenance=_provenance(inputs, None if sampling is None else sampling.seed),
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
        monte_carlo=sampled,
        point_checks=checks,
        line_checks=line_checks,
        solution=summarise_solution(refined, groups, others),
        messages=(
            *inputs.messages,
            *posed.messages,
            *control_messages,
            *check_messages,
            *_gauge_messages(inputs, world),
            *_unseen_control(control, assembled),
            *refine_messages,
            *measure_messages,
            *sampled_messages,
            *line_messages,
            *pick_messages,
            *unseen_messages,
            *group_messages,
            *judge_priors(adjustment, significance),
        ),
    )


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
        shift = height_shift(inputs, world.height_datum)
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


def _unseen_control(control: KnownWorldPoints, assembled: Assembled) -> tuple[Message, ...]:
    known = assembled.survey.label
    messages = []
    for label in control.label:
        if label not in known:
            near = near_miss(label, known)
            hint = f" ({near})" if near else ""
            text = f"The control point {label!r} is not used: it has no usable pick{hint}."
            messages.append(Message("warning", "control-unseen", text))
    return tuple(messages)


def _pick_table(inputs: Inputs, assembled: Assembled) -> PickTable:
    picks = inputs.picks
    return PickTable(
        image=picks.image,
        label=picks.label,
        pixel_px=picks.pixel_px,
        sigma_px=assembled.pick_sigma_px,
        survey_index=assembled.pick_index,
    )


def _picked_frames(inputs: Inputs, assembled: Assembled, refined: Refined) -> dict[str, str]:
    """Frames with picks, each with the first reason why one of its picks was left out."""
    reasons = dict.fromkeys(inputs.picks.image, "")
    for i, image in enumerate(inputs.picks.image):
        why = refined.pick_reason.get(int(assembled.pick_index[i]), "")
        reasons[image] = reasons[image] or why
    return reasons


def _provenance(inputs: Inputs, seed: int | None) -> Provenance:
    versions = [(name, importlib.metadata.version(name)) for name in PACKAGES]
    python = ".".join(str(part) for part in sys.version_info[:3])
    return Provenance(
        program="uavgram",
        version=importlib.metadata.version("uavgram"),
        created_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        inputs=inputs.digests,
        options=option_pairs(inputs.project),
        seed=seed,
        packages=(("python", python), *versions),
    )

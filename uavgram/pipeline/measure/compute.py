"""The order of the stages: read this to know the whole program.

::

    synchronise -> track -> seed               where the log has each frame (see `pose`), or
    photo_exposures -> seed                    where the photos themselves say they were taken
    assemble -> refine                         one likelihood
    reconstruct, measure, judge, summarise     what comes out, and how well it fits
"""

from __future__ import annotations

import importlib.metadata
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from uavgram.config.project import relative_paths
from uavgram.errors import GeometryError, near_miss
from uavgram.estimation.measuring.error_budget import error_budget, shares
from uavgram.estimation.measuring.propagation import propagate
from uavgram.estimation.survey.adjustment import Refined
from uavgram.geometry.earth.geodesy import enu_from_geodetic
from uavgram.geometry.earth.map_projection import checked_crs, utm_crs
from uavgram.imaging.known_point_pose import known_point_poses
from uavgram.model.arrays import Floats
from uavgram.model.message import Message, Several
from uavgram.model.options import ACCOUNT, Project, option_pairs
from uavgram.model.provenance import Provenance
from uavgram.model.result.learnt_camera import learnt_camera
from uavgram.model.result.reliability import SecondOrder
from uavgram.model.result.result import Result
from uavgram.model.result.tables import MonteCarloResults
from uavgram.model.survey.observations import KnownLines, KnownPoints, KnownWorldPoints
from uavgram.model.survey.survey import Survey
from uavgram.model.survey.world import World
from uavgram.pipeline.measure.inputs import Inputs, duplicates_of
from uavgram.pipeline.measure.judge import judge_survey
from uavgram.pipeline.measure.pose import Posed, height_shift, pose_frames
from uavgram.pipeline.versions import account_name, package_versions
from uavgram.stages.assemble import Assembled, assemble, unpicked_areas
from uavgram.stages.camera.assume import ASSUMED_CAMERA, UNKNOWN_CAMERA
from uavgram.stages.camera.learn import what_was_learnt
from uavgram.stages.duplicates import Duplicates
from uavgram.stages.measure import measure, measurement_results
from uavgram.stages.monte_carlo import compare, sample
from uavgram.stages.other_solutions import with_alternatives
from uavgram.stages.reconstruct import reconstruct
from uavgram.stages.refine import refine
from uavgram.stages.second_order import second_order
from uavgram.stages.seed.headings import find_headings
from uavgram.stages.seed.mount import turned_mount
from uavgram.stages.summarise import (
    summarise_areas,
    summarise_frames,
    summarise_shared,
    summarise_solution,
)
from uavgram.stages.tell import told

_GUESSED = (ASSUMED_CAMERA, UNKNOWN_CAMERA)
PACKAGES = ("numpy", "scipy", "opencv-python-headless", "pymavlink", "pyproj", "rerun-sdk")


@dataclass(frozen=True)
class Sampling:
    """A Monte Carlo check of the measurements: how many repetitions, and the draws' seed."""

    count: int
    seed: int = 0


class Computed(NamedTuple):
    """What is stored, and the adjustment behind it with all its joint covariances."""

    result: Result
    refined: Refined


def compute(
    inputs: Inputs,
    sampling: Sampling | None = None,
    *,
    posed: Posed | None = None,
    curved: bool = True,
) -> Computed:
    """Run every stage on what was read.

    Parameters
    ----------
    inputs
        The project.
    sampling
        A Monte Carlo check of the measurements, where that is asked for.
    posed
        The frames as `pose_frames` leaves them, which hang on photos and log alone: who changes
        nothing but picks and lengths need not match them again.
    curved
        Whether to check the first-order propagation by its second order, which takes most of the
        time where much is measured.
    """
    project = inputs.project
    duplicates = duplicates_of(inputs)
    # Not withheld either: what is a reading that was used would be a check of itself.
    counted = _with_duplicates(inputs.lines, duplicates, adjust=False)
    inputs = replace(inputs, lines=_with_duplicates(inputs.lines, duplicates, adjust=True))
    posed = posed or pose_frames(inputs)
    control, control_messages = known_in_world(inputs, inputs.control, posed.world)
    check, check_messages = known_in_world(inputs, inputs.check, posed.world)
    assembled = assemble(
        inputs.calibration,
        inputs.picks,
        counted,
        control,
        posed.telemetry,
        project.ground,
        project.picks_sigma_px,
        inputs.photos.frame_id,
        copies=duplicates.photos,
    )
    world = replace(posed.world, gauge=assembled.survey.gauge)
    if world.gauge == "plane":
        world = replace(world, origin=None)
    world = replace(world, crs=_map_crs(project, world))
    survey, heading_messages = find_headings(assembled.survey)
    mount = turned_mount(survey)
    try:
        refined, refine_messages = refine(_with_candidates(survey), project.solve)
    except GeometryError as why:
        if mount is not None:  # what is behind it
            raise GeometryError(f"{mount.text} ({why})") from why
        raise
    adjustment = refined.adjustment
    points = reconstruct(adjustment, world)
    measured = propagate(adjustment, inputs.requests, posed.frames)
    measurements, measure_messages = measurement_results(measured)
    curvature: SecondOrder | None = None
    curved_messages: tuple[Message, ...] = ()
    if curved:
        curvature, curved_messages = second_order(
            adjustment, measured, measurements, inputs.requests, posed.frames
        )
    others = tuple(
        tuple(measure(other, inputs.requests, posed.frames)[0].value)
        for other in refined.alternatives
    )
    measurements = with_alternatives(measurements, others)
    sampled: MonteCarloResults | None = None
    sampled_messages: tuple[Message, ...] = ()
    if sampling is not None:
        sampled, left_out = sample(
            adjustment, inputs.requests, posed.frames, sampling.count, sampling.seed
        )
        sampled_messages = (*compare(measurements, sampled), *left_out)
    judged = judge_survey(inputs, assembled, refined, measured, posed.frames, check)
    shared = summarise_shared(adjustment, posed.frames.clock_offset_s)
    result = Result(
        name=project.name,
        provenance=_provenance(inputs, None if sampling is None else sampling.seed),
        world=world,
        camera=inputs.calibration,
        shared=shared,
        areas=summarise_areas(adjustment),
        frames=summarise_frames(
            posed.frames,
            inputs.photos.path,
            None if posed.telemetry is None else posed.telemetry.poses,
            refined,
            _picked_frames(inputs, assembled, refined, duplicates),
        ),
        points=points,
        error_budget=shares(error_budget(adjustment.minimum.blocks, measured)),
        lines=judged.lines,
        picks=judged.picks,
        measurements=measurements,
        second_order=curvature,
        monte_carlo=sampled,
        evidence=judged.evidence,
        removals=judged.removals,
        point_checks=judged.point_checks,
        line_checks=judged.line_checks,
        checks_overall=judged.checks_overall,
        solution=summarise_solution(refined, judged.groups, others),
        messages=told(
            *(() if mount is None else (mount,)),
            *inputs.messages,
            *duplicates.messages,
            *posed.messages,
            *control_messages,
            *check_messages,
            *_gauge_messages(inputs, adjustment.survey),
            *_unseen_control(control, assembled),
            *unpicked_areas(project.ground, assembled.survey),
            *heading_messages,
            *refine_messages,
            *what_was_learnt(
                learnt_camera(inputs.calibration, shared.intrinsics),
                is_assumed=any(m.code in _GUESSED for m in inputs.messages),
            ),
            *measure_messages,
            *curved_messages,
            *sampled_messages,
            *judged.messages,
        ),
    )
    return Computed(result, refined)


def _with_duplicates(lines: KnownLines, duplicates: Duplicates, *, adjust: bool) -> KnownLines:
    """The lengths, those that are not counted withheld from the adjustment or not."""
    chosen = np.array(lines.adjust)
    chosen[list(duplicates.lines)] = adjust
    return replace(lines, adjust=chosen)


def _with_candidates(survey: Survey) -> Survey:
    """Where nothing but known points places the frames: their first poses from these."""
    if survey.telemetry is not None or survey.gauge == "plane":
        return survey
    return replace(survey, candidate_poses=known_point_poses(survey))


def _map_crs(project: Project, world: World) -> str | None:
    """Coordinate system of maps: the one the project names, else the UTM zone of the origin."""
    if world.origin is None:
        return None
    if project.crs == "auto":
        return utm_crs(*world.origin[:2])
    return checked_crs(project.crs)


def known_in_world(
    inputs: Inputs, points: KnownPoints, world: World
) -> tuple[KnownWorldPoints, tuple[Message, ...]]:
    """Known points in the local world; none, with a message, where nothing places them."""
    coordinates: Floats = points.coordinates
    if points.kind == "geodetic" and len(points.label):
        if world.origin is None:
            text = (
                "Points with latitude and longitude cannot be used: nothing ties this world to "
                "the earth. Give the log, world.origin, or geodetic control points."
            )
            return _no_points(), (Message("warning", "points-unplaced", text),)
        shift = height_shift(inputs, world.height_datum)
        latitude, longitude, height = points.coordinates.T
        coordinates = enu_from_geodetic(latitude, longitude, height + shift, world.origin)
    return KnownWorldPoints(label=points.label, world_m=coordinates, sigma_m=points.sigma_m), ()


def _no_points() -> KnownWorldPoints:
    return KnownWorldPoints(label=(), world_m=np.empty((0, 3)), sigma_m=np.empty((0, 3)))


def _gauge_messages(inputs: Inputs, survey: Survey) -> tuple[Message, ...]:
    if survey.gauge == "world":
        return ()
    text = (
        "Nothing fixes position and heading (no flight log, fewer than two control points): "
        "lengths, areas and angles are right, coordinates are relative to the first frame, "
        f"{survey.frame_id[0]}: it stands above 0, 0, and up in it is north."
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
            several = Several(
                "{count} control points are not used, having no usable pick", f"{label!r}{hint}"
            )
            messages.append(
                Message("warning", "control-unseen", text, labels=(label,), several=several)
            )
    return tuple(messages)


def _picked_frames(
    inputs: Inputs, assembled: Assembled, refined: Refined, duplicates: Duplicates
) -> dict[str, str]:
    """Frames with picks, each with the first reason why one of its picks was left out."""
    reasons = {image: duplicates.reason(image) for image in dict.fromkeys(inputs.picks.image)}
    for i, image in enumerate(inputs.picks.image):
        why = refined.pick_reason.get(int(assembled.pick_index[i]), "")
        reasons[image] = reasons[image] or why
    return reasons


def _provenance(inputs: Inputs, seed: int | None) -> Provenance:
    operator = inputs.project.operator
    return Provenance(
        program="uavgram",
        version=importlib.metadata.version("uavgram"),
        created_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        made_by=account_name() if operator == ACCOUNT else operator,
        inputs=inputs.digests,
        options=option_pairs(
            relative_paths(inputs.project, Path(inputs.project_path).absolute().parent)
        ),
        seed=seed,
        packages=package_versions(PACKAGES),
    )

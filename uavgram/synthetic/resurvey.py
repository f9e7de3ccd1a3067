"""A real survey, repeated: what was adjusted is the truth, everything observed is drawn anew.

Conditions (right angles, points in line) and lines of known position hold of the truth as far as
they held of the survey: no reading of them could be another one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from uavgram.errors import InputError, near_miss
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.known_kinds.kinds import ALL_KINDS
from uavgram.estimation.survey.likelihood import covariance_root
from uavgram.estimation.survey.observations.known import known_rows
from uavgram.geometry.camera.back_projection import back_project
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.geometry.motion.telemetry_pose import (
    BORESIGHT,
    CLOCK,
    CLOCK_DRIFT,
    HEADING_BIAS,
    LEVER_ARM,
    POSITION_BIAS,
    SHARED_SIZE,
    UP,
    exposures_by_time,
    predict_pose,
)
from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays, Ints
from uavgram.model.flight.photo_poses import PhotoExposures
from uavgram.model.flight.telemetry import Telemetry
from uavgram.model.survey.known import KnownThings
from uavgram.model.survey.observations import Along, KnownLines, KnownPoints, Picks
from uavgram.model.survey.ties import TiePicks
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import NO_POINTS, Inputs, read_inputs
from uavgram.pipeline.measure.plates import plate_scale, with_sides
from uavgram.pipeline.measure.pose import Posed, pose_frames
from uavgram.pipeline.threads import one_blas_thread
from uavgram.stages.tied import PATCH_PX
from uavgram.synthetic.observe import Still
from uavgram.synthetic.scenario import RepeatedSurvey
from uavgram.synthetic.scenario_file import load_repeated
from uavgram.synthetic.simulate import Drawn


def redrawn(
    telemetry: Telemetry,
    truth: tuple[Floats, Floats],
    covariance: Floats,
    rng: np.random.Generator,
) -> Telemetry:
    """Telemetry of true poses, wrong as its prior says; each frame stands where it stands.

    What the clock did stays as it was: the frames' own errors have it in them.

    Parameters
    ----------
    telemetry
        Of the flight.
    truth
        (N, 3), (N, 3, 3) true poses of its frames.
    covariance
        (N, 6, 6) of the errors of each frame, as the adjustment takes them.
    rng
        Draws.
    """
    prior, poses = telemetry.prior, telemetry.poses
    center, rotation = truth
    nominal, sigma = np.zeros(SHARED_SIZE), np.zeros(SHARED_SIZE)
    nominal[LEVER_ARM] = prior.lever_arm_m
    sigma[BORESIGHT] = prior.boresight_sigma_rad
    sigma[LEVER_ARM] = prior.lever_arm_sigma_m
    sigma[POSITION_BIAS] = prior.position_bias_sigma_m
    sigma[HEADING_BIAS] = prior.heading_bias_sigma_rad
    shared = nominal + sigma * rng.standard_normal(SHARED_SIZE)
    shared[CLOCK] = shared[CLOCK_DRIFT] = 0.0
    own = np.einsum(
        "nij,nj->ni", np.linalg.cholesky(covariance), rng.standard_normal((len(center), 6))
    )
    stated = rotation @ exp_so3(own[:, 3:])
    there = exposures_by_time(telemetry.track, poses.frame_id)(prior.time_s)
    # stated = turn(heading) Rz mount exp(boresight), and Rb keeps its place to Rz.
    turn = exp_so3(shared[HEADING_BIAS] * UP)
    camera = prior.gimbal_from_camera @ exp_so3(shared[BORESIGHT])
    gimbal = np.swapaxes(turn, -1, -2) @ stated @ camera.T
    body = gimbal @ np.swapaxes(there.world_from_mount, 1, 2) @ there.world_from_body
    arm = turn @ body @ shared[LEVER_ARM]
    exposures = PhotoExposures(
        frame_id=poses.frame_id,
        position_world_m=center + own[:, :3] + shared[POSITION_BIAS] - arm,
        world_from_body=body,
        world_from_gimbal=gimbal,
        sigma_position_m=np.sqrt(np.einsum("nii->ni", covariance)[:, [0, 2]]),
        sigma_attitude_rad=np.sqrt(np.einsum("nii->ni", covariance)[:, [3, 5]]),
        by_course=np.zeros(len(center), dtype=np.bool_),
        source="a simulation",
    )
    now = exposures_by_time(exposures, poses.frame_id)(prior.time_s)
    seed_center, seed_rotation, _ = predict_pose(
        now, prior.gimbal_from_camera, nominal, prior.time_s - prior.middle_s
    )
    seeds = replace(poses, center_world_m=seed_center, world_from_camera=seed_rotation)
    return replace(telemetry, poses=seeds, track=exposures)


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth(FrozenArrays):
    """What was adjusted.

    Attributes
    ----------
    label, place_m, slope
        (K,), (K, 3) points, and (K, 2) how the ground slopes at them.
    height_m, height_sigma_m
        (K,) of the points over the ground, and sigma of what was stated of it; 0: it is exact.
    frame_id, center_m, rotation
        (F,), (F, 3), (F, 3, 3) of the frames that took part.
    pose_covariance
        (F, 6, 6) of each frame's own telemetry; empty without.
    intrinsics
        (P,).
    ground_height_m
        Of the default area.
    match_row, tie_row
        Which picks, and which rows of the ties, took part as matches and as ties.
    tie_frame, tie_m
        (T,), (T, 3) of each of these rows of ties: the frame, and where its point is.
    known_value
        (N,) of what the project knows: between the true points; as it is stated where these are not
        seen, NaN of conditions.
    name, unit, value
        (M,) of the measurements that are repeated.
    """

    label: Annotated[tuple[str, ...], "k"]
    place_m: Annotated[Floats, "k", 3]
    slope: Annotated[Floats, "k", 2]
    height_m: Annotated[Floats, "k"]
    height_sigma_m: Annotated[Floats, "k"]
    frame_id: Annotated[tuple[str, ...], "f"]
    center_m: Annotated[Floats, "f", 3]
    rotation: Annotated[Floats, "f", 3, 3]
    pose_covariance: Annotated[Floats, "p", 6, 6]
    intrinsics: Annotated[Floats, "i"]
    ground_height_m: float
    match_row: Ints
    tie_row: Annotated[Ints, "t"]
    tie_frame: Annotated[Ints, "t"]
    tie_m: Annotated[Floats, "t", 3]
    known_value: Annotated[Floats, "n", NAN_IS_NONE]
    name: Annotated[tuple[str, ...], "m"]
    unit: tuple[str, ...]
    value: Annotated[Floats, "m"]

    def seen(self, camera: Inputs, frame: Ints, place_m: Floats) -> Floats:
        """(n, 2) pixels of places (n, 3) in frames (n,).

        Parameters
        ----------
        camera
            Whose calibration's lens model holds.
        frame, place_m
            What is seen, and where.
        """
        poses = RowPoses(self.center_m[frame], self.rotation[frame], np.zeros((len(frame), 6)))
        return project_rows(camera.calibration, self.intrinsics, poses, place_m)


def truth_of(
    adjustment: Adjustment,
    inputs: Inputs,
    measured: tuple[tuple[str, ...], tuple[str, ...], Floats],
) -> Truth:
    """Take an adjusted survey for the truth.

    Parameters
    ----------
    adjustment, inputs
        Of the survey.
    measured
        (M,) names, units and values that are repeated.
    """
    survey, state, problem = adjustment.survey, adjustment.state, adjustment.problem
    every = np.arange(len(survey.label))
    place, by_own, _ = problem.world_points(state, every)
    foot, _, _ = problem.ground_points(state, every)
    ties = survey.ties
    return Truth(
        label=survey.label,
        place_m=place,
        slope=by_own[:, 2, :2],
        height_m=place[:, 2] - foot[:, 2],
        height_sigma_m=np.where(survey.is_free, 0.0, survey.height_sigma_m),
        frame_id=survey.frame_id,
        center_m=state.center,
        rotation=state.rotation,
        pose_covariance=(
            np.empty((0, 6, 6)) if survey.telemetry is None else survey.telemetry.covariance
        ),
        intrinsics=problem.intrinsics(state),
        # Of the plane of the first area, where its slopes turn; without a world: none.
        ground_height_m=0.0 if survey.gauge == "plane" else float(state.plane[0]),
        match_row=survey.matches.row,
        tie_row=ties.row,
        tie_frame=ties.frame,
        tie_m=state.tie[survey.matches.points + ties.point].reshape(len(ties.row), -1)[:, :3]
        if ties.points
        else np.empty((0, 3)),
        known_value=_known_values(adjustment, inputs.known),
        name=measured[0],
        unit=measured[1],
        value=measured[2],
    )


def _known_values(adjustment: Adjustment, known: KnownThings) -> Floats:
    """(N,) what is between the adjusted points."""
    value = known.value.copy()
    place = adjustment.survey.row_of_label
    seen = (known.seen_thing(i, place) for i in range(len(known.name)))
    things = [one for one in seen if one is not None and ALL_KINDS[one.kind].has_value]
    if things:
        rows = known_rows(adjustment.problem, adjustment.state, things)
        np.add.at(value, np.array([thing.index for thing in things])[rows.thing], rows.value)
    return value


def picked_again(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> Picks:
    """The picks of what took part, where the points really are, with their stated noise.

    A match is found at the pick that it was found from, error included; only its own is drawn.

    Parameters
    ----------
    inputs, truth
        The survey.
    rng
        Draws.
    """
    picks = inputs.picks
    frame = {name: i for i, name in enumerate(truth.frame_id)}
    point = {name: i for i, name in enumerate(truth.label)}
    matches = set(truth.match_row.tolist())
    kept = [
        i
        for i, (image, label) in enumerate(zip(picks.image, picks.label, strict=True))
        if image in frame and label in point and (picks.source_of(i) != "match" or i in matches)
    ]
    again = Picks(**{one.name: _some(getattr(picks, one.name), kept) for one in fields(Picks)})
    f = np.array([frame[name] for name in again.image], dtype=np.int64)
    k = np.array([point[name] for name in again.label], dtype=np.int64)
    stated = again.sigma_px
    sigma = np.where(np.isnan(stated), inputs.project.picks_sigma_px, stated)
    noise = sigma[:, None] * rng.standard_normal((len(kept), 2))
    beside = _beside(inputs, truth, rng)[k]
    place = np.where(again.of_source("target")[:, None], truth.place_m[k], beside)
    pixel = truth.seen(inputs, f, place) + noise
    found = np.flatnonzero(again.of_source("match"))
    from_px = again.from_px.copy()
    if len(found):
        at = {(a, b): i for i, (a, b) in enumerate(zip(again.image, again.label, strict=True))}
        origin = np.array([at[again.from_image[i], again.label[i]] for i in found])
        first, row = np.unique(origin, return_inverse=True)
        below = pixel[first] + PATCH_PX * rng.standard_normal((len(first), 2))
        patch = _on_ground(inputs, truth, (f[first], k[first]), below)
        pixel[found] = truth.seen(inputs, f[found], patch[row]) + noise[found]
        from_px[found] = pixel[origin]
    height = truth.height_m + truth.height_sigma_m * rng.standard_normal(len(truth.label))
    drawn = np.isfinite(again.height_m) & (truth.height_sigma_m[k] > 0)
    return replace(
        again,
        pixel_px=pixel,
        sigma_px=sigma,
        from_px=from_px,
        height_m=np.where(drawn, height[k], again.height_m),
    )


def _beside(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> Floats:
    """(K, 3) what people pick for each label in all photos, on the ground beside what is meant."""
    sigma = inputs.project.picks_identification_sigma_m
    off = sigma * rng.standard_normal((len(truth.label), 2))
    rise = np.sum(off * truth.slope, axis=1, keepdims=True)
    return np.asarray(truth.place_m + np.concatenate([off, rise], axis=1))


def _some(column: Any, rows: list[int]) -> Any:  # noqa: ANN401
    """Rows of an array or a tuple; of a tuple that has none, none."""
    if isinstance(column, tuple):
        return tuple(column[i] for i in rows) if column else ()
    return column[rows]


def _on_ground(inputs: Inputs, truth: Truth, rows: tuple[Ints, Ints], pixel_px: Floats) -> Floats:
    """(n, 3) what lies under pixels (n, 2), on the ground as it slopes at points near them."""
    frame, point = rows
    model = inputs.calibration.model
    ray = back_project(model, truth.intrinsics, pixel_px)
    ray = np.einsum("nij,nj->ni", truth.rotation[frame], ray)
    normal = np.column_stack([-truth.slope[point], np.ones(len(point))])
    center = truth.center_m[frame]
    ahead = np.sum((truth.place_m[point] - center) * normal, axis=1) / np.sum(ray * normal, axis=1)
    return np.asarray(center + ahead[:, None] * ray)


def tied_again(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> TiePicks:
    """The ties that took part, with their stated noise.

    Parameters
    ----------
    inputs, truth, rng
        As for `picked_again`.
    """
    ties, row = inputs.ties, truth.tie_row
    sigma = ties.sigma_px[row]
    pixel = truth.seen(inputs, truth.tie_frame, truth.tie_m)
    return TiePicks(
        image=tuple(ties.image[i] for i in row),
        tie=tuple(ties.tie[i] for i in row),
        pixel_px=pixel + sigma[:, None] * rng.standard_normal(pixel.shape),
        sigma_px=sigma,
    )


def taped_again(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> KnownLines:
    """The lengths between points that took part, read anew, each tape with a scale of its own.

    Parameters
    ----------
    inputs, truth, rng
        As for `picked_again`; lengths of plates stand among the lines.
    """
    lines, project = inputs.lines, inputs.project
    point = {name: i for i, name in enumerate(truth.label)}
    kept = [i for i in range(len(lines.name)) if {lines.start[i], lines.end[i]} <= point.keys()]
    start = [point[lines.start[i]] for i in kept]
    end = [point[lines.end[i]] for i in kept]
    leg = truth.place_m[end] - truth.place_m[start]
    leg[[lines.along_of(i) == "horizontal" for i in kept], 2] = 0.0
    tapes, own = {lines.tape_of(i): 0.0 for i in kept}, dict(plate_scale(project.targets))
    for name in tapes:
        tapes[name] = own.get(name, project.tape.scale_sigma) * float(rng.standard_normal())
    scale = np.array([tapes[lines.tape_of(i)] for i in kept])
    noise = lines.sigma_m[kept] * rng.standard_normal(len(kept))
    return KnownLines(
        name=tuple(lines.name[i] for i in kept),
        start=tuple(lines.start[i] for i in kept),
        end=tuple(lines.end[i] for i in kept),
        length_m=np.linalg.norm(leg, axis=1) * (1.0 + scale) + noise,
        sigma_m=lines.sigma_m[kept],
        adjust=lines.adjust[kept],
        tape=tuple(lines.tape_of(i) for i in kept),
        along=tuple(lines.along_of(i) for i in kept),
    )


def surveyed_again(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> KnownPoints:
    """The control points that took part, with other errors, in the local world.

    Parameters
    ----------
    inputs, truth, rng
        As for `picked_again`.
    """
    control = inputs.control
    point = {name: i for i, name in enumerate(truth.label)}
    kept = [i for i, name in enumerate(control.label) if name in point]
    place = truth.place_m[[point[control.label[i]] for i in kept]].reshape(-1, 3)
    sigma = control.sigma_m[kept]
    return KnownPoints(
        label=tuple(control.label[i] for i in kept),
        kind="local",
        coordinates=place + sigma * rng.standard_normal(sigma.shape),
        sigma_m=sigma,
    )


def known_again(inputs: Inputs, truth: Truth, rng: np.random.Generator) -> KnownThings:
    """What is known of the scene, its values with other errors.

    Parameters
    ----------
    inputs, truth, rng
        As for `picked_again`.
    """
    known = inputs.known
    noise = known.sigma * rng.standard_normal(len(known.name))
    return replace(known, value=truth.known_value + np.where(np.isnan(known.value), 0.0, noise))


STILL_KINDS = frozenset({"skid_speed", "speed"})
"""Measurements of which most of the uncertainty is not of the survey: not repeated."""


@dataclass(frozen=True)
class ProjectWorld:
    """Repetitions of a real survey."""

    spec: RepeatedSurvey
    inputs: Inputs
    posed: Posed
    truth: Truth

    def drawn(self, number: int) -> Drawn:
        """One repetition; the same number gives the same one."""
        seeds = np.random.SeedSequence([self.spec.seed, number]).spawn(5)
        return self._drawn([np.random.default_rng(one) for one in seeds])

    def exact(self) -> Drawn:
        """The survey without any error, its sigmas being as stated."""
        drawn = self._drawn([Still()] * 5)
        options = replace(drawn.inputs.project.solve, noise="stated")
        project = replace(drawn.inputs.project, solve=options)
        return drawn._replace(inputs=replace(drawn.inputs, project=project))

    def named(self) -> tuple[str, int]:
        """Name and seed."""
        return self.spec.name, self.spec.seed

    def _drawn(self, rngs: list[np.random.Generator]) -> Drawn:
        for_camera, for_picks, for_lengths, for_log, for_ground = rngs
        inputs, truth = self.inputs, self.truth
        root = covariance_root(inputs.calibration.covariance)
        off = root @ for_camera.standard_normal(root.shape[1])
        ground = inputs.project.ground
        stated = truth.ground_height_m + ground.height_sigma_m * for_ground.standard_normal()
        posed = self.posed
        if posed.telemetry is not None:
            pose = truth.center_m, truth.rotation
            telemetry = redrawn(posed.telemetry, pose, truth.pose_covariance, for_log)
            posed = replace(posed, telemetry=telemetry)
        again = replace(
            inputs,
            project=replace(inputs.project, ground=replace(ground, height_m=float(stated))),
            calibration=replace(inputs.calibration, parameters=truth.intrinsics + off),
            picks=picked_again(inputs, truth, for_picks),
            ties=tied_again(inputs, truth, for_picks),
            lines=taped_again(inputs, truth, for_lengths),
            known=known_again(inputs, truth, for_lengths),
            control=surveyed_again(inputs, truth, for_ground),
        )
        return Drawn(again, posed, truth.name, truth.unit, truth.value)


def read_project_world(project: Path, scenario: Path | None, seed: int | None) -> ProjectWorld:
    """Read and adjust a project that is to be repeated.

    Parameters
    ----------
    project
        Its file.
    scenario
        A file of `RepeatedSurvey`; None: the survey as it is.
    seed
        In place of the file's.

    Raises
    ------
    UavgramError
        The project, or the file, cannot be read or has no result.
    """
    spec = RepeatedSurvey(name=project.stem) if scenario is None else load_repeated(scenario)
    spec = spec if seed is None else replace(spec, seed=seed)
    return project_world(spec, read_inputs(project), scenario)


def project_world(spec: RepeatedSurvey, inputs: Inputs, scenario: Path | None) -> ProjectWorld:
    """Adjust a survey that is to be repeated.

    Parameters
    ----------
    spec, scenario
        What is added to it, and the file that says so.
    inputs
        Of the survey.

    Raises
    ------
    UavgramError
        It has no result, or nothing that could be repeated.
    """
    posed = pose_frames(inputs)
    with one_blas_thread():
        computed = compute(inputs, posed=posed, curved=False)
    adjustment, table = computed.refined.adjustment, computed.result.measurements
    kept = [
        i
        for i, value in enumerate(table.value)
        if np.isfinite(value) and table.kind[i] not in STILL_KINDS
    ]
    if not kept:
        raise InputError(
            inputs.project_path, "has no measurement that could be repeated: give some (measure)"
        )
    measured = (
        tuple(table.name[i] for i in kept),
        tuple(table.unit[i] for i in kept),
        table.value[kept],
    )
    truth = truth_of(adjustment, inputs, measured)
    lines = with_sides(inputs.lines, inputs.picks, inputs.project.targets)
    inputs = replace(
        inputs,
        lines=_with_more(scenario, lines, spec, truth.label),
        check=NO_POINTS,
        digests=(),
        messages=(),
    )
    return ProjectWorld(spec, inputs, _only(posed, truth.frame_id), truth)


def _only(posed: Posed, frame_id: tuple[str, ...]) -> Posed:
    """Telemetry of the frames that took part alone, in their order."""
    telemetry = posed.telemetry
    if telemetry is None:
        return posed
    row = {name: i for i, name in enumerate(telemetry.poses.frame_id)}
    index = np.array([row[name] for name in frame_id], dtype=np.int64)
    prior = replace(
        telemetry.prior,
        frame_index=np.arange(len(index)),
        time_s=telemetry.prior.time_s[index],
        covariance=telemetry.prior.covariance[index],
    )
    frames = replace(posed.frames, matched=np.isin(posed.frames.frame_id, frame_id))
    some = replace(telemetry, poses=telemetry.poses.take(index), prior=prior)
    return replace(posed, telemetry=some, frames=frames)


def _with_more(
    scenario: Path | None, lines: KnownLines, spec: RepeatedSurvey, labels: tuple[str, ...]
) -> KnownLines:
    """The lengths of the project and those that the file adds."""
    for line in spec.lines:
        for end in (line.start, line.end):
            if end not in labels:
                hint = near_miss(end, labels)
                raise InputError(
                    scenario or "",
                    f"lines: {line.name!r} ends at {end!r}, which is no picked point of the project"
                    f"{hint and f' ({hint})'}: name two points that were picked",
                )
    more = len(spec.lines)
    return KnownLines(
        name=(*lines.name, *(line.name for line in spec.lines)),
        start=(*lines.start, *(line.start for line in spec.lines)),
        end=(*lines.end, *(line.end for line in spec.lines)),
        length_m=np.concatenate([lines.length_m, np.ones(more)]),  # read anew in each repetition
        sigma_m=np.concatenate([lines.sigma_m, np.full(more, spec.tape_m)]),
        adjust=np.concatenate([lines.adjust, [line.use == "adjust" for line in spec.lines]]).astype(
            np.bool_
        ),
        tape=(*(lines.tape_of(i) for i in range(len(lines.name))), *[""] * more),
        along=(*(lines.along_of(i) for i in range(len(lines.name))), *_slopes(more)),
    )


def _slopes(count: int) -> tuple[Along, ...]:
    """Lengths along the ground."""
    slope: Along = "slope"
    return (slope,) * count

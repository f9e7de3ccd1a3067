"""A real survey, repeated: what was adjusted is the truth, everything observed is drawn anew.

Left out are tie points, matches and known things other than lengths and control points, of which
nothing was drawn: the prediction leaves them out as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np

from uavgram.config.scenario import load_repeated
from uavgram.errors import InputError, near_miss
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.likelihood import covariance_root
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Floats, FrozenArrays
from uavgram.model.scenario.repeated import RepeatedSurvey
from uavgram.model.survey.known import NO_KNOWN
from uavgram.model.survey.observations import Along, KnownLines, KnownPoints, Picks
from uavgram.model.survey.ties import NO_TIES
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import NO_POINTS, Inputs, read_inputs
from uavgram.pipeline.measure.pose import Posed, pose_frames
from uavgram.pipeline.simulate.worlds import Drawn
from uavgram.pipeline.threads import one_blas_thread
from uavgram.stages.simulate.redrawn import redrawn
from uavgram.stages.simulate.still import Still

STILL_KINDS = frozenset({"skid_speed", "speed"})
"""Measurements of which most of the uncertainty is not of the survey: not repeated."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Truth(FrozenArrays):
    """What was adjusted.

    Attributes
    ----------
    label, place_m
        (K,), (K, 3) points.
    frame_id, center_m, rotation
        (F,), (F, 3), (F, 3, 3) of the frames that took part.
    pose_covariance
        (F, 6, 6) of each frame's own telemetry; empty without.
    intrinsics
        (P,).
    ground_height_m
        Of the default area.
    name, unit, value
        (M,) of the measurements that are repeated.
    """

    label: Annotated[tuple[str, ...], "k"]
    place_m: Annotated[Floats, "k", 3]
    frame_id: Annotated[tuple[str, ...], "f"]
    center_m: Annotated[Floats, "f", 3]
    rotation: Annotated[Floats, "f", 3, 3]
    pose_covariance: Annotated[Floats, "t", 6, 6]
    intrinsics: Annotated[Floats, "p"]
    ground_height_m: float
    name: Annotated[tuple[str, ...], "m"]
    unit: tuple[str, ...]
    value: Annotated[Floats, "m"]


@dataclass(frozen=True)
class ProjectWorld:
    """Repetitions of a real survey."""

    spec: RepeatedSurvey
    inputs: Inputs
    posed: Posed
    truth: _Truth

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
            picks=_picked(inputs, truth, for_picks),
            lines=_taped(inputs, truth, for_lengths),
            control=_surveyed(inputs, truth, for_ground),
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
    inputs = read_inputs(project)
    posed = pose_frames(inputs)
    with one_blas_thread():
        computed = compute(inputs, posed=posed, curved=False)
    adjustment, result = computed.refined.adjustment, computed.result
    table, survey = result.measurements, adjustment.survey
    kept = [
        i
        for i, value in enumerate(table.value)
        if np.isfinite(value) and table.kind[i] not in STILL_KINDS
    ]
    if not kept:
        raise InputError(project, "has no measurement that could be repeated: give some (measure)")
    place, _ = adjustment.points()
    own = np.empty((0, 6, 6)) if survey.telemetry is None else survey.telemetry.covariance
    truth = _Truth(
        label=survey.label,
        place_m=place,
        frame_id=survey.frame_id,
        center_m=adjustment.state.center,
        rotation=adjustment.state.rotation,
        pose_covariance=own,
        intrinsics=adjustment.problem.intrinsics(adjustment.state),
        ground_height_m=_ground_height(adjustment),
        name=tuple(table.name[i] for i in kept),
        unit=tuple(table.unit[i] for i in kept),
        value=table.value[kept],
    )
    inputs = replace(
        inputs,
        lines=_with_more(scenario, inputs.lines, spec, truth.label),
        known=NO_KNOWN,
        ties=NO_TIES,
        check=NO_POINTS,
        digests=(),
        messages=(),
    )
    return ProjectWorld(spec, inputs, _only(posed, truth.frame_id), truth)


def _ground_height(adjustment: Adjustment) -> float:
    """Of the adjusted plane of the first area, where its slopes turn; without a world: none."""
    if adjustment.survey.gauge == "plane":
        return 0.0
    return float(adjustment.state.plane[0])


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


def _picked(inputs: Inputs, truth: _Truth, rng: np.random.Generator) -> Picks:
    """The picks of what took part, where the points really are, with their stated noise."""
    picks = inputs.picks
    frame = {name: i for i, name in enumerate(truth.frame_id)}
    point = {name: i for i, name in enumerate(truth.label)}
    kept = [
        i
        for i, (image, label) in enumerate(zip(picks.image, picks.label, strict=True))
        if image in frame and label in point and picks.source_of(i) != "match"
    ]
    f = np.array([frame[picks.image[i]] for i in kept], dtype=np.int64)
    k = np.array([point[picks.label[i]] for i in kept], dtype=np.int64)
    poses = RowPoses(truth.center_m[f], truth.rotation[f], np.zeros((len(f), 6)))
    pixel = project_rows(inputs.calibration, truth.intrinsics, poses, truth.place_m[k])
    stated = picks.sigma_px[kept]
    sigma = np.where(np.isnan(stated), inputs.project.picks_sigma_px, stated)
    return Picks(
        image=tuple(picks.image[i] for i in kept),
        label=tuple(picks.label[i] for i in kept),
        pixel_px=pixel + sigma[:, None] * rng.standard_normal(pixel.shape),
        sigma_px=sigma,
        height_m=picks.height_m[kept],
        height_sigma_m=picks.height_sigma_m[kept],
        is_free=picks.is_free[kept],
        area=tuple(picks.area[i] for i in kept) if picks.area else (),
        source=tuple(picks.source[i] for i in kept) if picks.source else (),
    )


def _taped(inputs: Inputs, truth: _Truth, rng: np.random.Generator) -> KnownLines:
    """The lengths between points that took part, read anew, each tape with a scale of its own."""
    lines = inputs.lines
    point = {name: i for i, name in enumerate(truth.label)}
    kept = [i for i in range(len(lines.name)) if {lines.start[i], lines.end[i]} <= point.keys()]
    start = [point[lines.start[i]] for i in kept]
    end = [point[lines.end[i]] for i in kept]
    leg = truth.place_m[end] - truth.place_m[start]
    leg[[lines.along_of(i) == "horizontal" for i in kept], 2] = 0.0
    tapes = {lines.tape_of(i): 0.0 for i in kept}
    for name in tapes:
        tapes[name] = inputs.project.tape.scale_sigma * float(rng.standard_normal())
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


def _surveyed(inputs: Inputs, truth: _Truth, rng: np.random.Generator) -> KnownPoints:
    """The control points that took part, with other errors, in the local world."""
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

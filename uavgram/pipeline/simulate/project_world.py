"""A real survey, repeated: what was adjusted is the truth, everything observed is drawn anew."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from uavgram.config.scenario import load_repeated
from uavgram.errors import InputError, near_miss
from uavgram.estimation.survey.likelihood import covariance_root
from uavgram.model.scenario.repeated import RepeatedSurvey
from uavgram.model.survey.observations import Along, KnownLines
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import NO_POINTS, Inputs, read_inputs
from uavgram.pipeline.measure.plates import with_sides
from uavgram.pipeline.measure.pose import Posed, pose_frames
from uavgram.pipeline.simulate.observed_again import (
    Truth,
    known_again,
    picked_again,
    surveyed_again,
    taped_again,
    tied_again,
    truth_of,
)
from uavgram.pipeline.simulate.worlds import Drawn
from uavgram.pipeline.threads import one_blas_thread
from uavgram.stages.simulate.redrawn import redrawn
from uavgram.stages.simulate.still import Still

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

"""Repetitions of a real survey: its adjusted state is the truth, and observations are drawn again.

Conditions (right angles, points in line) and lines of known position hold in the truth as well as
they held in the survey: they have no readings that could differ.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from uavgram.errors import InputError, suggest_spelling
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.observations.kinds import OBSERVATIONS
from uavgram.estimation.survey.observed import SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats, rows_of
from uavgram.model.observations import KnownLines, KnownPoints, KnownWorldPoints
from uavgram.model.survey import Survey
from uavgram.pipeline.measure.compute import collect_observations, compute
from uavgram.pipeline.measure.inputs import NO_POINTS, Inputs, read_inputs
from uavgram.pipeline.measure.observations import append_plate_sides
from uavgram.pipeline.measure.pose import PosedFrames, pose_frames
from uavgram.pipeline.threads import one_blas_thread
from uavgram.synthetic.observations import MeanGenerator
from uavgram.synthetic.scenario import RepeatedSurvey
from uavgram.synthetic.scenario_file import load_repeated
from uavgram.synthetic.survey import DrawnSurvey

KINDS_WITHOUT_MOTION = frozenset({"skid_speed", "speed"})
"""Kinds of measurements with mostly other uncertainties than the survey's: not repeated."""


@dataclass(frozen=True)
class ProjectWorld:
    """Repetitions of a real survey: name, unit and true value (M,) of its measurements.

    `survey`, `pivot_m` and `line_used` define its likelihood, which itself cannot be pickled for
    other processes.
    """

    spec: RepeatedSurvey
    inputs: Inputs
    posed: PosedFrames
    survey: Survey
    pivot_m: Floats
    line_used: Bools
    state: State
    name: tuple[str, ...]
    unit: tuple[str, ...]
    value: Floats

    def draw(self, number: int) -> DrawnSurvey:
        """Return one repetition; the same number gives the same one."""
        seeds = np.random.SeedSequence([self.spec.seed, number]).spawn(len(OBSERVATIONS))
        return self._draw_observations(map(np.random.default_rng, seeds))

    def exact(self) -> DrawnSurvey:
        """Return the survey without any error, with its sigmas as stated."""
        drawn = self._draw_observations(MeanGenerator() for _ in OBSERVATIONS)
        options = replace(drawn.inputs.project.solve, noise="stated")
        project = replace(drawn.inputs.project, solve=options)
        return drawn._replace(inputs=replace(drawn.inputs, project=project))

    def get_name_and_seed(self) -> tuple[str, int]:
        """Return name and seed."""
        return self.spec.name, self.spec.seed

    def _draw_observations(self, rngs: Iterable[np.random.Generator]) -> DrawnSurvey:
        """Draw each kind of observation again, from its own random stream."""
        inputs, control = self.inputs, self.inputs.control
        placed = KnownWorldPoints(
            label=control.label, world_m=control.coordinates, sigma_m=control.sigma_m
        )
        observed = collect_observations(inputs, self.posed, placed)
        problem = SurveyProblem(self.survey, self.pivot_m, self.line_used)
        for kind, rng in zip(OBSERVATIONS, rngs, strict=True):
            observed = kind.draw(observed, SimulatedTruth(problem, self.state, rng))
        placed = observed.control
        again = replace(
            inputs,
            project=replace(inputs.project, ground=observed.ground),
            calibration=observed.calibration,
            picks=observed.picks,
            ties=observed.ties,
            lines=observed.lines,
            known=observed.known,
            control=KnownPoints(
                label=placed.label,
                kind="local",
                coordinates=placed.world_m,
                sigma_m=placed.sigma_m,
            ),
        )
        posed = replace(self.posed, telemetry=observed.telemetry)
        return DrawnSurvey(again, posed, self.name, self.unit, self.value)


def read_project_world(project: Path, scenario: Path | None, seed: int | None) -> ProjectWorld:
    """Read and adjust a project that is to be repeated.

    Parameters
    ----------
    project
        Its file.
    scenario
        A file of `RepeatedSurvey`; None: the survey as it is.
    seed
        Replaces the file's.

    Raises
    ------
    UavgramError
        The project, or the file, cannot be read or has no result.
    """
    spec = RepeatedSurvey(name=project.stem) if scenario is None else load_repeated(scenario)
    spec = spec if seed is None else replace(spec, seed=seed)
    return make_project_world(spec, read_inputs(project), scenario)


def make_project_world(spec: RepeatedSurvey, inputs: Inputs, scenario: Path | None) -> ProjectWorld:
    """Adjust a survey that is to be repeated.

    Parameters
    ----------
    spec, scenario
        Additions to the survey, and the file that defines them.
    inputs
        Of the survey.

    Raises
    ------
    UavgramError
        It has no result, or no measurement that could be repeated.
    """
    posed = pose_frames(inputs)
    with one_blas_thread():
        computed = compute(inputs, posed=posed, curved=False)
    adjustment, table = computed.refined.adjustment, computed.result.measurements
    kept = [
        i
        for i, value in enumerate(table.value)
        if np.isfinite(value) and table.kind[i] not in KINDS_WITHOUT_MOTION
    ]
    if not kept:
        raise InputError(
            inputs.project_path, "has no measurement that could be repeated: give some (measure)"
        )
    lines = append_plate_sides(inputs.lines, inputs.picks, inputs.project.targets)
    inputs = replace(
        inputs,
        lines=_add_lengths(scenario, lines, spec, adjustment.survey.label),
        check=NO_POINTS,
        digests=(),
        messages=(),
    )
    return ProjectWorld(
        spec,
        inputs,
        _select_telemetry(posed, adjustment.survey.frame_id),
        adjustment.survey,
        adjustment.problem.pivot_m,
        np.isin(np.arange(len(adjustment.survey.line_start)), adjustment.problem.line_index),
        adjustment.state,
        tuple(table.name[i] for i in kept),
        tuple(table.unit[i] for i in kept),
        table.value[kept],
    )


def _select_telemetry(posed: PosedFrames, frame_id: tuple[str, ...]) -> PosedFrames:
    """Return the telemetry of the adjusted frames alone, in their order."""
    telemetry = posed.telemetry
    if telemetry is None:
        return posed
    row = {name: i for i, name in enumerate(telemetry.poses.frame_id)}
    index = np.array([row[name] for name in frame_id], dtype=np.int64)
    some = rows_of(telemetry.prior, index) | {"frame_index": np.arange(len(index))}
    prior = replace(telemetry.prior, **some)
    frames = replace(posed.frames, matched=np.isin(posed.frames.frame_id, frame_id))
    telemetry = replace(telemetry, poses=telemetry.poses.take(index), prior=prior)
    return replace(posed, telemetry=telemetry, frames=frames)


def _add_lengths(
    scenario: Path | None, lines: KnownLines, spec: RepeatedSurvey, labels: tuple[str, ...]
) -> KnownLines:
    """Return the lengths of the project and those added by the file."""
    for line in spec.lines:
        for end in (line.start, line.end):
            if end not in labels:
                hint = suggest_spelling(end, labels)
                raise InputError(
                    scenario or "",
                    f"lines: {line.name!r} ends at {end!r}, which is no picked point of the project"
                    f"{hint and f' ({hint})'}: name two points that were picked",
                )
    more = KnownLines(
        name=tuple(line.name for line in spec.lines),
        start=tuple(line.start for line in spec.lines),
        end=tuple(line.end for line in spec.lines),
        length_m=np.ones(len(spec.lines)),  # read again in each repetition
        sigma_m=np.full(len(spec.lines), spec.tape_m),
        adjust=np.array([line.use == "adjust" for line in spec.lines], dtype=np.bool_),
    )
    return lines.append(more)

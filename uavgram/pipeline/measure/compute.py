"""Run the stages in order; this file is an overview of the whole program.

::

    synchronise -> track -> seed               poses of the frames by the log (see `pose`), or
    photo_exposures -> seed                    by the photos themselves
    assemble -> refine                         one likelihood
    reconstruct, measure, judge, summarise     results, and their quality
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from uavgram.config.project import make_paths_relative
from uavgram.errors import GeometryError
from uavgram.estimation.measuring.error_budget import (
    compute_error_budget,
    compute_shares,
    compute_shifts,
)
from uavgram.estimation.measuring.propagation import MeasuredValues, propagate
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.observed import Observations
from uavgram.geometry.geodesy import normalise_crs, utm_crs
from uavgram.geometry.motion.camera_motion import CLOCK
from uavgram.io.files import find_relative_name
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import KnownLines, KnownThings, KnownWorldPoints
from uavgram.model.options import Project, SolveOptions, option_pairs
from uavgram.model.provenance import Provenance
from uavgram.model.result import tables
from uavgram.model.result.reliability import ChecksOverall, Evidence, RemovalRecord, SecondOrder
from uavgram.model.result.result import GroupFactor, Result, SharedResult, compare_cameras
from uavgram.model.survey import Survey, World
from uavgram.model.work import report_work
from uavgram.pipeline.measure.inputs import Inputs, find_project_duplicates
from uavgram.pipeline.measure.observations import (
    append_plate_sides,
    append_position_lines,
    apply_corrections,
    plate_scale,
)
from uavgram.pipeline.measure.pose import PosedFrames, pose_frames, transform_known
from uavgram.pipeline.versions import package_versions, stamp
from uavgram.stages import judge
from uavgram.stages.assemble import Assembled, apply_reading_step, assemble
from uavgram.stages.camera import ASSUMED_CAMERA, UNKNOWN_CAMERA, report_learnt_camera
from uavgram.stages.duplicates import Duplicates
from uavgram.stages.ground_height import lower_ground
from uavgram.stages.measure import (
    add_alternatives,
    check_second_order,
    compare,
    compute_profiles,
    describe_scale_basis,
    measure,
    measurement_results,
    sample_observations,
)
from uavgram.stages.messages import (
    TAKEN_INTO_ACCOUNT,
    downgrade_explained,
    order_messages,
    report_clock_off,
)
from uavgram.stages.reconstruct import reconstruct
from uavgram.stages.refine import refine
from uavgram.stages.remedies import keep_first_clicks
from uavgram.stages.seed.common_errors import find_common_error
from uavgram.stages.seed.headings import find_headings
from uavgram.stages.summarise import (
    summarise_areas,
    summarise_frames,
    summarise_orientation,
    summarise_shared,
    summarise_solution,
    summarise_ties,
)

Table = TypeVar("Table")


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """Parts of a result on the quality of the fit, as the basis of the verdict."""

    examined: judge.TestedSurvey
    fit: judge.Fit
    picks: tables.PickResults
    lines: tables.LineResults
    known: tables.KnownResults
    control_lines: tables.ControlLineResults
    line_checks: tables.LineChecks
    point_checks: tables.PointChecks
    groups: tuple[GroupFactor, ...]
    evidence: Evidence
    checks_overall: ChecksOverall | None
    removals: tuple[RemovalRecord, ...]
    messages: tuple[Message, ...]


def judge_survey(
    inputs: Inputs,
    assembled: Assembled,
    refined: Refined,
    measured: MeasuredValues,
    frames: Frames,
    check: KnownWorldPoints,
    moved: Collection[str] = (),
) -> Judgement:
    """Judge an adjusted survey by all available information.

    Parameters
    ----------
    inputs, assembled
        The project, and the rows of its picks and lengths in the survey.
    refined, measured
        The adjusted survey and its measurements.
    frames
        Times of the exposures.
    check
        Points that were withheld.
    moved
        Names of measurements that other solutions move beyond their intervals.
    """
    significance = inputs.project.solve.significance
    lines, index = inputs.lines, assembled.line_index
    withheld = judge.compare_withheld(refined.adjustment, lines, check)
    examined = judge.run_tests(refined, measured, significance, withheld)
    picks, pick_effects = judge.judge_picks(
        examined, inputs.picks, assembled.pick_sigma_px, assembled.pick_index
    )
    picked = frozenset(inputs.picks.label)
    line_results, line_checks, line_effects, line_messages = judge.judge_lines(
        examined, lines, index, picked
    )
    known, known_messages = judge.judge_known(examined, inputs.known, picked)
    # Tables show the result; messages report misfits that its suspects do not explain.
    both = tuple(dict.fromkeys((refined.adjustment, examined.without_suspects)))
    point_checks, unseen_messages = _first_and_last(
        [judge.judge_points(one, check, significance) for one in both]
    )
    each = (withheld, *(judge.compare_withheld(one, lines, check) for one in both[1:]))
    overall, overall_messages = _first_and_last(
        [judge.judge_overall(*one, significance) for one in zip(both, each, strict=True)]
    )
    groups, group_messages = _first_and_last(
        [judge.judge_groups(one, significance, examined.list_suspected_kinds()) for one in both]
    )
    fit = judge.compute_fit(
        refined, line_results, known, point_checks, overall, given=assembled.survey
    )
    return Judgement(
        examined=examined,
        fit=fit,
        picks=picks,
        lines=line_results,
        known=known,
        control_lines=judge.judge_control_lines(refined.adjustment, inputs.known, known),
        line_checks=line_checks,
        point_checks=point_checks,
        groups=groups,
        evidence=Evidence(
            lines=line_effects,
            picks=pick_effects,
            priors=judge.judge_priors(examined),
            weakest=judge.judge_weakest(examined),
        ),
        checks_overall=overall,
        removals=judge.judge_removals(
            refined, lines, index, inputs.requests, frames, measured, inputs.known
        ),
        messages=(
            *judge.judge_suspects(examined),
            *judge.judge_rivals(refined),
            *judge.judge_majority(refined, index, line_results, known),
            *line_messages,
            *known_messages,
            *unseen_messages,
            *overall_messages,
            *group_messages,
            *judge.judge_fit(fit, examined.without_suspects),
            *judge.judge_unchecked(examined, moved),
        ),
    )


def _first_and_last(
    judged: Sequence[tuple[Table, tuple[Message, ...]]],
) -> tuple[Table, tuple[Message, ...]]:
    """Return the table of the first, and the messages of the last."""
    return judged[0][0], judged[-1][1]


_GUESSED = (ASSUMED_CAMERA, UNKNOWN_CAMERA)
PACKAGES = ("numpy", "scipy", "opencv-python-headless", "pymavlink", "pyproj", "rerun-sdk")


@dataclass(frozen=True)
class Sampling:
    """Monte Carlo check of the measurements: number of repetitions, and the seed of the draws."""

    count: int
    seed: int = 0


class Computation(NamedTuple):
    """Stored result, and the adjustment behind it with all its joint covariances."""

    result: Result
    refined: Refined


def compute(
    inputs: Inputs,
    sampling: Sampling | None = None,
    *,
    posed: PosedFrames | None = None,
    curved: bool = True,
) -> Computation:
    """Run every stage on the inputs.

    Parameters
    ----------
    inputs
        The project.
    sampling
        Monte Carlo check of the measurements, if requested.
    posed
        The frames from `pose_frames`, which depend on photos and log only: after changes of nothing
        but picks and lengths they need not be matched again.
    curved
        Whether to check the first-order propagation by its second order, which takes most of the
        time with many measurements.
    """
    inputs, rounding_messages = _enlarge_rounded(inputs)
    duplicates = find_project_duplicates(inputs)
    # Not withheld either: a reading that was used would check itself.
    counted = _withhold_duplicates(inputs.lines, duplicates, adjust=False)
    inputs = replace(inputs, lines=_withhold_duplicates(inputs.lines, duplicates, adjust=True))
    plates = inputs.project.targets
    counted = append_plate_sides(counted, inputs.picks, plates)
    inputs = replace(inputs, lines=append_plate_sides(inputs.lines, inputs.picks, plates))
    posed = posed or pose_frames(inputs)
    inputs, line_messages = append_position_lines(inputs, posed.world)
    check, check_messages = transform_known(inputs, inputs.check, posed.world)
    assembled, known_messages = _assemble(inputs, counted, posed, duplicates)
    world = _world(inputs.project, posed.world, assembled.survey.gauge)
    survey, heading_messages = find_headings(assembled.survey)
    refined, refine_messages = adjust_survey(survey, inputs.project.solve)
    mended = [one.cause for one in refined.removals if one.cause is not None]
    inputs = apply_corrections(inputs, assembled, mended)
    adjustment = refined.adjustment
    values = propagate(adjustment, inputs.requests, posed.frames, set(inputs.picks.label))
    report_work("compute the measurements, and what checks them")
    measured = _measure(inputs, posed.frames, refined, values, curved=curved)
    sampled, sampled_messages = _run_monte_carlo(
        inputs, posed.frames, adjustment, measured.table, sampling
    )
    judged = judge_survey(inputs, assembled, refined, values, posed.frames, check, measured.moved)
    shared = summarise_shared(adjustment, posed.frames.clock_offset_s)
    messages = order_messages(
        *inputs.messages,
        *duplicates.messages,
        *posed.messages,
        *known_messages,
        *rounding_messages,
        *line_messages,
        *check_messages,
        *_report_unjudged(inputs, world),
        *assembled.messages,
        *heading_messages,
        *downgrade_explained(refine_messages, refined.causes),
        *describe_scale_basis(adjustment),
        *_report_camera(inputs, shared),
        *measured.messages,
        *sampled_messages,
        *downgrade_explained(judged.messages, refined.causes),
        *judge.judge_makers(judged.picks, measured.table),
    )
    messages = keep_first_clicks(messages, inputs.picks)
    tied = summarise_ties(adjustment, posed.frames.frame_id)
    still = {cause.message.code for cause in refined.causes if cause not in mended}
    put_right = {cause.message.code for cause in mended} - still
    verdict, status = judge.determine_verdict(
        messages, judged.fit, judged.examined, measured.table, put_right, measured.harmless
    )
    result = Result(
        name=inputs.project.name,
        provenance=_provenance(inputs, sampling),
        world=world,
        camera=inputs.calibration,
        shared=shared,
        areas=summarise_areas(adjustment),
        frames=replace(
            _frames(inputs, posed, assembled, refined, duplicates),
            ties=tied.ties,
            ties_rms_px=tied.rms_px,
        ),
        points=reconstruct(adjustment, world, refined.off_ground),
        error_budget=compute_shares(
            compute_error_budget(adjustment.minimum.blocks, values, measured.table.sigma)
        ),
        lines=judged.lines,
        known=judged.known,
        control_lines=judged.control_lines,
        picks=judged.picks,
        measurements=replace(measured.table, status=status),
        profiles=compute_profiles(adjustment, inputs.requests),
        second_order=measured.curvature,
        monte_carlo=sampled,
        evidence=judged.evidence,
        removals=judged.removals,
        point_checks=judged.point_checks,
        line_checks=judged.line_checks,
        checks_overall=judged.checks_overall,
        solution=summarise_solution(refined, judged.groups, measured.others),
        noise=refined.noise,
        orientation=summarise_orientation(adjustment),
        ties=tied.together,
        messages=messages,
        verdict=verdict,
    )
    return Computation(result, refined)


def assemble_survey(inputs: Inputs, posed: PosedFrames) -> Assembled:
    """Assemble the survey that `compute` adjusts."""
    inputs, _ = _enlarge_rounded(inputs)
    duplicates = find_project_duplicates(inputs)
    counted = _withhold_duplicates(inputs.lines, duplicates, adjust=False)
    counted = append_plate_sides(counted, inputs.picks, inputs.project.targets)
    inputs, _ = append_position_lines(inputs, posed.world)
    assembled, _ = _assemble(inputs, counted, posed, duplicates)
    survey, _ = find_headings(assembled.survey)
    return replace(assembled, survey=survey)


def _enlarge_rounded(inputs: Inputs) -> tuple[Inputs, tuple[Message, ...]]:
    """Enlarge the sigmas of lengths that were rounded, and report it."""
    lines, messages = apply_reading_step(inputs.lines)
    return replace(inputs, lines=lines), messages


def _withhold_duplicates(lines: KnownLines, duplicates: Duplicates, *, adjust: bool) -> KnownLines:
    """Withhold lengths that are not counted from the adjustment, or not."""
    chosen = np.array(lines.adjust)
    chosen[list(duplicates.lines)] = adjust
    return replace(lines, adjust=chosen)


def _withhold_copies(known: KnownThings, duplicates: Duplicates) -> KnownThings:
    """Withhold known things that are not counted from the adjustment."""
    chosen = np.array(known.adjust)
    chosen[list(duplicates.known)] = False
    return replace(known, adjust=chosen)


def collect_observations(
    inputs: Inputs, posed: PosedFrames, control: KnownWorldPoints
) -> Observations:
    """Collect the observations that a project's files and its log state, copies included.

    Parameters
    ----------
    inputs, posed
        The project, and its frames by the log.
    control
        Its control points in the world.
    """
    project = inputs.project
    return Observations(
        calibration=inputs.calibration,
        picks=inputs.picks,
        lines=inputs.lines,
        known=inputs.known,
        control=control,
        ties=inputs.ties,
        telemetry=posed.telemetry,
        ground=project.ground,
        picks_sigma_px=project.picks_sigma_px,
        picks_identification_sigma_m=project.picks_identification_sigma_m,
        tape=project.tape,
        own_scale_sigma=plate_scale(project.targets),
        photos=inputs.photos.frame_id,
        exposures=posed.frames,
    )


def _assemble(
    inputs: Inputs, counted: KnownLines, posed: PosedFrames, duplicates: Duplicates
) -> tuple[Assembled, tuple[Message, ...]]:
    """Assemble all observations in one survey, with messages on control points."""
    control, messages = transform_known(inputs, inputs.control, posed.world)
    observed = replace(
        collect_observations(inputs, posed, control),
        lines=counted,
        known=_withhold_copies(inputs.known, duplicates),
        copies=duplicates.photos,
        contradicting=duplicates.contradicting,
    )
    assembled = assemble(observed)
    place = posed.world.origin
    survey, lowered = lower_ground(assembled.survey, None if place is None else place.height_m)
    return replace(assembled, survey=survey), (*lowered, *messages)


def _world(project: Project, world: World, gauge: Literal["world", "plane"]) -> World:
    """Return the world of a survey with such a gauge, with the coordinate system of its maps."""
    world = replace(world, gauge=gauge, origin=None if gauge == "plane" else world.origin)
    return replace(world, crs=_map_crs(project, world))


def adjust_survey(survey: Survey, options: SolveOptions) -> tuple[Refined, tuple[Message, ...]]:
    """Adjust the survey without an error common to all poses of its log."""
    error = find_common_error(survey) if options.noise == "estimate" else None
    if error is None:
        return refine(survey, options)
    try:
        refined, messages = refine(error.survey, options)
    except GeometryError as why:
        if error.message is not None:  # the cause
            raise GeometryError(f"{error.message.text} ({why})") from why
        raise
    message = error.message or _report_clock(refined.adjustment, error.shift_s)
    return refined, (message, *messages)


def _report_clock(adjustment: Adjustment, shift_s: float) -> Message:
    """Report a clock that was moved before the adjustment."""
    layout, place = adjustment.problem.layout, CLOCK.start
    off_s = shift_s + float(adjustment.state.telemetry[place])
    variance = adjustment.shared_covariance(layout.first_telemetry + place, 1)
    message = report_clock_off(off_s, float(np.sqrt(variance[0, 0])))
    return replace(message, text=f"{message.text} {TAKEN_INTO_ACCOUNT}")


class _Measurements(NamedTuple):
    """Measurements, second-order terms, and values under other solutions.

    `harmless` are the codes of mistakes that forbid the use of the values which they contradict,
    and contradict none.
    """

    table: tables.MeasurementResults
    curvature: SecondOrder | None
    others: tuple[tuple[float, ...], ...]
    messages: tuple[Message, ...]
    harmless: frozenset[str] = frozenset()

    @property
    def moved(self) -> frozenset[str]:
        """Names of measurements that other solutions move beyond their intervals."""
        each = zip(self.table.name, self.table.alternative_values, strict=True)
        return frozenset(name for name, values in each if values)


def _measure(
    inputs: Inputs, frames: Frames, refined: Refined, values: MeasuredValues, *, curved: bool
) -> _Measurements:
    table, messages = measurement_results(values, compute_shifts(refined.adjustment, values))
    if refined.stated is not None:
        stated = propagate(refined.stated, inputs.requests, frames)
        table = replace(table, sigma_stated=stated.sigma)
    curvature: SecondOrder | None = None
    more: tuple[Message, ...] = ()
    if curved:
        curvature, more = check_second_order(refined.adjustment, values, table, frames)

    def contradicts(other: Adjustment) -> bool:
        value = measure(other, inputs.requests, frames)[0].value
        return judge.contradicts_result(table, refined.adjustment, value, other)

    harmful = {
        code
        for code, group in refined.forbidding
        if not group or any(contradicts(one.adjustment) for one in group)
    }
    harmless = [one for one in refined.forbidding if one[0] not in harmful]
    groups = (group for _, group in harmless)
    refined = replace(refined, explanations=(*refined.explanations, *groups))
    rivals = refined.list_explanations()
    others = tuple(tuple(measure(one, inputs.requests, frames)[0].value) for one, _ in rivals)
    table = add_alternatives(table, others, [probability for _, probability in rivals])
    found = _Measurements(
        table,
        curvature,
        others[: len(refined.alternatives)],
        messages,
        frozenset(code for code, _ in harmless),
    )
    # Where another solution moves a value, its sigma is not that of the first order.
    kept = (one for one in more if not found.moved.issuperset(one.measurements))
    return found._replace(messages=(*messages, *kept))


def _run_monte_carlo(
    inputs: Inputs,
    frames: Frames,
    adjustment: Adjustment,
    table: tables.MeasurementResults,
    sampling: Sampling | None,
) -> tuple[tables.MonteCarloResults | None, tuple[Message, ...]]:
    """Run the Monte Carlo check, if requested."""
    if sampling is None:
        return None, ()
    found, left_out = sample_observations(
        adjustment, inputs.requests, frames, sampling.count, sampling.seed
    )
    return found, (*compare(table, found), *left_out)


def _report_camera(inputs: Inputs, shared: SharedResult) -> tuple[Message, ...]:
    """Report the information of the survey on its camera."""
    is_assumed = any(m.code in _GUESSED for m in inputs.messages)
    learnt = compare_cameras(inputs.calibration, shared.intrinsics)
    return report_learnt_camera(learnt, is_assumed=is_assumed)


def _map_crs(project: Project, world: World) -> str | None:
    """Return the coordinate system of maps: the project's, or else the UTM zone of the origin."""
    if world.origin is None:
        return None
    if project.crs == "auto":
        return utm_crs(*world.origin[:2])
    return normalise_crs(project.crs)


def _report_unjudged(inputs: Inputs, world: World) -> tuple[Message, ...]:
    """Report check points of a world without meaningful coordinates."""
    if world.gauge == "world" or not len(inputs.check.label):
        return ()
    text = (
        "Check points are not judged: without a flight log or control points, coordinates mean "
        "nothing. Name either in the project."
    )
    return (Message("warning", "check-unjudged", text, labels=inputs.check.label),)


def _frames(
    inputs: Inputs,
    posed: PosedFrames,
    assembled: Assembled,
    refined: Refined,
    duplicates: Duplicates,
) -> tables.FrameResults:
    """Return all frames; a reason for left-out picks is given, the frame's own first."""
    reasons = {
        image: duplicates.reason(image) for image in (*inputs.picks.image, *duplicates.photos)
    }
    left_out = [
        (refined.pick_reason[index], image)
        for image, index in zip(inputs.picks.image, assembled.pick_index.tolist(), strict=True)
        if index in refined.pick_reason
    ]
    for why, image in sorted(left_out, key=lambda one: not one[0].cause.is_of_frame):
        reasons[image] = reasons[image] or why.text
    seeds = None if posed.telemetry is None else posed.telemetry.poses
    folder = inputs.folder
    paths = tuple(find_relative_name(path, folder) for path in inputs.photos.path)
    return summarise_frames(posed.frames, paths, str(folder), seeds, refined, reasons)


def _provenance(inputs: Inputs, sampling: Sampling | None) -> Provenance:
    return Provenance(
        **stamp(),
        made_by=inputs.project.operator or "",
        inputs=inputs.digests,
        options=option_pairs(make_paths_relative(inputs.project, inputs.folder)),
        seed=None if sampling is None else sampling.seed,
        packages=package_versions(PACKAGES),
    )

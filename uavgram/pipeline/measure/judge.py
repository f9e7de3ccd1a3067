"""All judgements on an adjusted survey: every observation, prior, check and removal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from uavgram.estimation.measuring.propagation import MeasuredValues
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.frames import Frames
from uavgram.model.message import Message
from uavgram.model.observations import KnownWorldPoints
from uavgram.model.result.reliability import ChecksOverall, Evidence, RemovalRecord
from uavgram.model.result.result import GroupFactor
from uavgram.model.result.tables import (
    ControlLineResults,
    KnownResults,
    LineChecks,
    LineResults,
    PickResults,
    PointChecks,
)
from uavgram.pipeline.measure.inputs import Inputs
from uavgram.stages.assemble import Assembled
from uavgram.stages.judge import (
    Fit,
    TestedSurvey,
    compare_withheld,
    compute_fit,
    judge_control_lines,
    judge_fit,
    judge_groups,
    judge_known,
    judge_lines,
    judge_majority,
    judge_overall,
    judge_picks,
    judge_points,
    judge_priors,
    judge_removals,
    judge_rivals,
    judge_suspects,
    judge_unchecked,
    judge_weakest,
    run_tests,
)

Table = TypeVar("Table")


@dataclass(frozen=True, kw_only=True, eq=False)
class Judgement:
    """Parts of a result on the quality of the fit, as the basis of the verdict."""

    examined: TestedSurvey
    fit: Fit
    picks: PickResults
    lines: LineResults
    known: KnownResults
    control_lines: ControlLineResults
    line_checks: LineChecks
    point_checks: PointChecks
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
    """
    significance = inputs.project.solve.significance
    lines, index = inputs.lines, assembled.line_index
    withheld = compare_withheld(refined.adjustment, lines, check)
    examined = run_tests(refined, measured, significance, withheld)
    picks, pick_effects = judge_picks(
        examined, inputs.picks, assembled.pick_sigma_px, assembled.pick_index
    )
    picked = frozenset(inputs.picks.label)
    line_results, line_checks, line_effects, line_messages = judge_lines(
        examined, lines, index, picked
    )
    known, known_messages = judge_known(examined, inputs.known, picked)
    # Tables show the result; messages report misfits that its suspects do not explain.
    both = tuple(dict.fromkeys((refined.adjustment, examined.without_suspects)))
    point_checks, unseen_messages = _first_and_last(
        [judge_points(one, check, significance) for one in both]
    )
    each = (withheld, *(compare_withheld(one, lines, check) for one in both[1:]))
    overall, overall_messages = _first_and_last(
        [judge_overall(*one, significance) for one in zip(both, each, strict=True)]
    )
    groups, group_messages = _first_and_last(
        [judge_groups(one, significance, examined.list_suspected_kinds()) for one in both]
    )
    fit = compute_fit(refined, line_results, known, point_checks, overall, given=assembled.survey)
    return Judgement(
        examined=examined,
        fit=fit,
        picks=picks,
        lines=line_results,
        known=known,
        control_lines=judge_control_lines(refined.adjustment, inputs.known, known),
        line_checks=line_checks,
        point_checks=point_checks,
        groups=groups,
        evidence=Evidence(
            lines=line_effects,
            picks=pick_effects,
            priors=judge_priors(examined),
            weakest=judge_weakest(examined),
        ),
        checks_overall=overall,
        removals=judge_removals(
            refined, lines, index, inputs.requests, frames, measured, inputs.known
        ),
        messages=(
            *judge_suspects(examined),
            *judge_rivals(refined),
            *judge_majority(refined, index, line_results, known),
            *line_messages,
            *known_messages,
            *unseen_messages,
            *overall_messages,
            *group_messages,
            *judge_fit(fit, examined.without_suspects),
            *judge_unchecked(examined),
        ),
    )


def _first_and_last(
    judged: Sequence[tuple[Table, tuple[Message, ...]]],
) -> tuple[Table, tuple[Message, ...]]:
    """Return the table of the first, and the messages of the last."""
    return judged[0][0], judged[-1][1]

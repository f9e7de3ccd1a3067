"""Adjusted length, residual, test statistic and status of every known length."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import chain

import numpy as np

from uavgram.errors import suggest_spelling
from uavgram.estimation.reliability.stated_values import explain_length
from uavgram.estimation.survey.adjustment import Adjustment, Refined
from uavgram.estimation.survey.observations.lengths import describe_ends, select_taped_known
from uavgram.model.arrays import Floats, Ints
from uavgram.model.frames import PhotoExposures
from uavgram.model.message import Message, MessagePlural, propose_length_removal
from uavgram.model.naming import format_digits, format_misfit, join_names
from uavgram.model.observations import KnownLines
from uavgram.model.result.reliability import Effects
from uavgram.model.result.tables import LineChecks, LineResults, LineStatus
from uavgram.stages.judge.length_faults import LengthFault, find_length_faults
from uavgram.stages.judge.picks import find_rows
from uavgram.stages.judge.suspects import list_contested
from uavgram.stages.judge.tested_survey import TestedSurvey
from uavgram.stages.remedies import read_first

PICK_OR_CORRECT = "Pick that, or correct the label."

_COLUMNS = ("adjusted_m", "adjusted_sigma_m", "residual_m", "w", "redundancy", "mdb_m")


def judge_lines(
    examined: TestedSurvey, lines: KnownLines, survey_index: Ints, picked: Collection[str] = ()
) -> tuple[LineResults, LineChecks, Effects, tuple[Message, ...]]:
    """Compute adjusted length, residual, w, redundancy and status of every known length.

    Parameters
    ----------
    examined
        The adjusted survey under test.
    lines
        All L known lengths of the project.
    survey_index
        (L,) rows in the lines of the survey given to refine; -1 for withheld and unseen ones.
    picked
        Labels that have picks, whether these take part or not.

    Returns
    -------
    results, checks
        All lengths; the withheld ones.
    effects
        (L,) effect of an undetected error in each.
    messages
        Messages on lengths never seen, left-out ones, and withheld ones that do not fit.
    """
    refined, adjustment = examined.refined, examined.adjustment
    columns = {name: np.full(len(lines.name), np.nan) for name in _COLUMNS}
    _fill_adjusted_lengths(adjustment, lines, columns)
    used = refined.line_index[adjustment.problem.line_index]
    row = find_rows(survey_index, used, len(refined.line_removed))
    _fit_of_observed(examined, row, columns)
    # Withheld lengths: w = residual / sqrt(prediction variance + sigma^2).
    withheld = ~np.asarray(lines.adjust, dtype=bool) & np.isfinite(columns["adjusted_m"])
    sigma = np.hypot(columns["adjusted_sigma_m"], lines.sigma_m)
    columns["w"][withheld] = (columns["residual_m"] / sigma)[withheld]
    unexplained = _errors_in_sigmas(examined.without_suspects, lines)
    adjusted = columns["adjusted_m"], columns["adjusted_sigma_m"]
    messages = list(_left_out(refined, lines, survey_index, *adjusted))
    status: list[LineStatus] = []
    suspect = examined.suspect("lengths") if "lengths" in examined.groups else np.zeros(0, bool)
    known = adjustment.survey.label
    for i in range(len(lines.name)):
        missing = [p for p in (lines.start[i], lines.end[i]) if p not in known]
        if missing:
            status.append("unseen")
            which = describe_missing_picks(missing, known, picked)
            messages.append(_report_unseen(lines, i, missing, which))
        elif withheld[i]:
            status.append("checked")
            if examined.significant(columns["w"][i]) and examined.significant(unexplained[i]):
                messages.append(_does_not_fit(lines, i, columns))
        elif row[i] < 0:
            status.append("removed")
        else:
            status.append("suspect" if suspect[row[i]] else "used")
    results = LineResults(
        name=lines.name,
        start=lines.start,
        end=lines.end,
        length_m=lines.length_m,
        sigma_m=lines.sigma_m,
        status=tuple(status),
        **columns,
    )
    return results, _line_checks(results), examined.effects("lengths", row), tuple(messages)


def _fill_adjusted_lengths(
    adjustment: Adjustment, lines: KnownLines, columns: dict[str, Floats]
) -> None:
    start, end = adjustment.label_rows(lines.start), adjustment.label_rows(lines.end)
    seen = np.flatnonzero((start >= 0) & (end >= 0))
    length, sigma = adjustment.readings(select_taped_known(lines, seen, start[seen], end[seen]))
    columns["adjusted_m"][seen], columns["adjusted_sigma_m"][seen] = length, sigma
    columns["residual_m"][:] = columns["adjusted_m"] - lines.length_m


def _errors_in_sigmas(adjustment: Adjustment, lines: KnownLines) -> Floats:
    """Compute errors (L,) of the lengths in sigmas, as if they were withheld."""
    columns = {name: np.full(len(lines.name), np.nan) for name in _COLUMNS}
    _fill_adjusted_lengths(adjustment, lines, columns)
    sigma = np.hypot(columns["adjusted_sigma_m"], lines.sigma_m)
    return np.asarray(columns["residual_m"] / sigma)


def _fit_of_observed(examined: TestedSurvey, row: Ints, columns: dict[str, Floats]) -> None:
    if "lengths" not in examined.groups:
        return
    group, there = examined.groups["lengths"], row >= 0
    at = row[there]
    columns["w"][there] = group.w[at, 0]
    columns["redundancy"][there] = group.redundancy[at, 0]
    columns["mdb_m"][there] = group.bias(examined.significance)[at, 0]


def describe_missing_picks(
    missing: Sequence[str], labels: Sequence[str], picked: Collection[str]
) -> str:
    """Return ``no usable pick of 'R33' (did you mean 'R3'?)`` for labels not among `labels`.

    A label that was picked, and whose picks were left out, is no misspelling.

    Parameters
    ----------
    missing
        Labels without a usable pick.
    labels
        Labels of the survey, for suggestions.
    picked
        Labels that were picked at all.
    """
    words = []
    for label in missing:
        near = "" if label in picked else suggest_spelling(label, labels)
        hint = f" ({near})" if near else ""
        words.append(f"{label!r}{hint}")
    return f"no usable pick of {' and '.join(words)}"


def _report_unseen(lines: KnownLines, i: int, missing: list[str], which: str) -> Message:
    what = describe_ends(lines.name[i], lines.start[i], lines.end[i])
    return Message(
        "warning",
        "line-unseen",
        f"The length {what} is not used: {which}. {PICK_OR_CORRECT}",
        lengths=(lines.name[i],),
        labels=tuple(missing),
        several=MessagePlural("{count} lengths are not used", what, which, PICK_OR_CORRECT),
    )


def _does_not_fit(lines: KnownLines, i: int, columns: dict[str, Floats]) -> Message:
    found = float(columns["adjusted_m"][i])
    taped = float(lines.length_m[i]), float(lines.sigma_m[i])
    what = explain_length(*taped, found, float(columns["adjusted_sigma_m"][i]))
    ask = f"{what[0].upper()}{what[1:]}? " if what else ""
    name = describe_ends(lines.name[i], lines.start[i], lines.end[i])
    how = f"taped {lines.length_m[i]:.3f} m, found {found:.3f} m ({format_misfit(columns['w'][i])})"
    mend, *instead = read_first([propose_length_removal([lines.name[i]])])
    return Message(
        "warning",
        "line-suspect",
        f"The withheld length {name} does not fit: {how}. {ask}Look at the reading, at its ends "
        "and at their picks.",
        lengths=(lines.name[i],),
        labels=(lines.start[i], lines.end[i]),
        several=MessagePlural(
            "{count} withheld lengths do not fit",
            f"{name} {how}{f': {what}?' if what else ''}",
            ending="Look at the readings, at their ends and at their picks.",
        ),
        mend=mend,
        instead=tuple(one for one in instead if one is not None),
    )


def _line_checks(lines: LineResults) -> LineChecks:
    chosen = np.flatnonzero([s == "checked" for s in lines.status])
    sigma = np.hypot(lines.adjusted_sigma_m, lines.sigma_m)[chosen]
    return LineChecks(
        name=tuple(lines.name[i] for i in chosen),
        error_m=lines.residual_m[chosen],
        sigma_m=sigma,
        z=lines.residual_m[chosen] / sigma,
    )


def _left_out(
    refined: Refined, lines: KnownLines, survey_index: Ints, seen_m: Floats, sigma_m: Floats
) -> tuple[Message, ...]:
    """Report left-out lengths: one message each, or one for all with the same mistake.

    Those that a cause explains are reported by it, and those that have rivals together with these.
    """
    contested = {one.name for one in list_contested(refined) if one.kind == "lengths"}
    gross = {r.index for r in refined.removals if r.kind == "line" and r.before is None}
    gross -= {int(survey_index[i]) for i, name in enumerate(lines.name) if name in refined.settled}
    seen = np.isfinite(seen_m)  # otherwise an end is not adjusted, and has its own message
    gross -= {int(survey_index[i]) for i, name in enumerate(lines.name) if name in contested}
    out = [i for i, index in enumerate(survey_index) if int(index) in gross and seen[i]]
    seen_at = {i: (seen_m[i], sigma_m[i]) for i in out}
    is_used = (survey_index >= 0) & ~np.isin(survey_index, np.flatnonzero(refined.line_removed))
    fault = find_length_faults(lines, seen_at, np.flatnonzero(is_used))
    groups = [[i for i in out if fault[i] == key] for key in dict.fromkeys(fault.values())]
    messages = []
    for group in groups:
        names = tuple(lines.name[i] for i in group)
        mend, *instead = read_first([propose_length_removal(names)])
        ends = tuple(dict.fromkeys(chain(*((lines.start[i], lines.end[i]) for i in group))))
        at = fault[group[0]].end
        messages.append(
            Message(
                "warning",
                "point-not-taped" if at else "line-left-out",
                _text(refined, lines, group, fault[group[0]], (seen_m, sigma_m)),
                lengths=names,
                labels=(at,) if at else ends,
                mend=mend,
                instead=tuple(one for one in instead if one is not None),
            )
        )
    return tuple(messages)


def _text(
    refined: Refined,
    lines: KnownLines,
    found: list[int],
    fault: LengthFault,
    adjusted: tuple[Floats, Floats],
) -> str:
    ask = f": {fault.mistake}?" if fault.mistake else ""
    taped = [f"{lines.length_m[i]:.10g} m taped" for i in found]
    seen = [
        f"{format_digits(adjusted[0][i], 4)} ± {format_digits(adjusted[1][i])} m" for i in found
    ]
    names = [lines.name[i] for i in found]
    items = "; ".join(
        f"{name!r} {given}, {is_} seen" for name, given, is_ in zip(names, taped, seen, strict=True)
    )
    witnesses = _list_contradicting(refined)
    if fault.end and len(found) > 1:
        return (
            f"The point {fault.end!r} seems to be another one than was taped: the lengths "
            f"{join_names(map(repr, names))} end there and contradict {witnesses}, and so they "
            f"were left out ({items}). Look whether {fault.end!r} was clicked on the right thing "
            "in all photos; else read these lengths again."
        )
    if len(found) == 1:
        name, start, end = (each[found[0]] for each in (lines.name, lines.start, lines.end))
        opening = (
            f"The length {describe_ends(name, start, end)} was left out: {taped[0]}, but "
            f"{witnesses} show {seen[0]}{ask or '.'}"
        )
    else:
        opening = (
            f"{len(found)} lengths were left out, wrong in one way by the evidence of "
            f"{witnesses}{ask} {items}."
        )
    return (
        f"{opening} Look at reading and unit, and at the labels and the picks of the ends. With so "
        "gross an error, nothing else would fit."
    )


def _list_contradicting(refined: Refined) -> str:
    """List the observations that contradict a length."""
    survey = refined.adjustment.survey
    witnesses = ["the photos"]
    if survey.telemetry is not None and not isinstance(survey.track, PhotoExposures):
        witnesses.append("the log")
    if len(survey.control_label):
        witnesses.append("the control points")
    if len(refined.adjustment.problem.line_index):
        witnesses.append("the other lengths")
    if len(witnesses) == 1:
        return "the photos and their own poses"
    return f"{', '.join(witnesses[:-1])} and {witnesses[-1]}"

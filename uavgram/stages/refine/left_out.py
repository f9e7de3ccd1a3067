"""Record what the robust adjustment left out: lengths, known things, control points, heights."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from uavgram.estimation.reliability.coordinate_faults import displaced, likely_fault
from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.departures import heights_above_ground
from uavgram.estimation.survey.observations.known import known_rows
from uavgram.estimation.survey.observations.tapes import taped_lines
from uavgram.estimation.survey.suspicion import Member, Suspicion
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Message, Several
from uavgram.model.survey.survey import Survey
from uavgram.stages.remedies import freed


def seen_lengths(survey: Survey, refined: Refined, line: Ints) -> tuple[Floats, Floats]:
    """What tapes should read (n,) of some lines, and the sigmas; NaN where an end is not adjusted.

    Parameters
    ----------
    survey
        All observations.
    refined
        The adjusted survey.
    line
        (n,) rows of known lengths.
    """
    at = refined.adjustment.label_rows(survey.label)
    there = (at[survey.line_start[line]] >= 0) & (at[survey.line_end[line]] >= 0)
    taped = taped_lines(survey, line[there])
    taped = taped._replace(start=at[taped.start], end=at[taped.end])
    found = np.full((2, len(line)), np.nan)
    found[:, there] = refined.adjustment.readings(taped)
    return found[0], found[1]


def with_gross_lengths(survey: Survey, refined: Refined) -> Refined:
    """The same, with a record of the lengths that were left out before anything was tested."""
    recorded = {removal.index for removal in refined.removals if removal.kind == "line"}
    line = np.array(
        [i for i in np.flatnonzero(refined.line_removed) if i not in recorded], dtype=int
    )
    if not len(line):
        return refined
    seen, sigma = seen_lengths(survey, refined, line)
    w = (seen - survey.length_m[line]) / np.hypot(sigma, survey.length_sigma_m[line])
    records = [
        Removal("line", index, Suspicion(Member("lengths", -1, 0), off, (), ()), None)
        for index, off in zip(line.tolist(), w.tolist(), strict=True)
    ]
    return replace(refined, removals=(*records, *refined.removals))


def known_errors(survey: Survey, refined: Refined) -> dict[int, float]:
    """How far each known thing is from what an adjustment says, in sigmas of both, by its number.

    Of several numbers the largest. Those whose points are not all adjusted are left out.

    Parameters
    ----------
    survey
        All observations.
    refined
        An adjustment without the things that are asked for.
    """
    adjustment = refined.adjustment
    things = []
    for thing in survey.known:
        label = np.full(len(survey.label), -1)
        label[list(thing.label)] = adjustment.label_rows(survey.label[k] for k in thing.label)
        if (seen := thing.relabelled(label)) is not None:
            things.append(seen)
    if not things:
        return {}
    rows = known_rows(adjustment.problem, adjustment.state, things)
    variance = adjustment.minimum.factor.variances(rows.columns, rows.gradient)
    error = rows.value / np.sqrt(variance + rows.sigma**2)
    largest: dict[int, float] = {}
    for at, each in zip(rows.thing.tolist(), error.tolist(), strict=True):
        index = things[at].index
        if abs(each) > abs(largest.get(index, 0.0)):
            largest[index] = each
    return largest


def with_gross_known(survey: Survey, refined: Refined) -> Refined:
    """The same, with a record of the known things left out before anything was tested."""
    recorded = {removal.index for removal in refined.removals if removal.kind == "known"}
    out = refined.known_removed - recorded
    if not out:
        return refined
    errors = known_errors(survey, refined)
    records = [
        Removal("known", index, Suspicion(Member("known", -1, 0), errors[index], (), ()), None)
        for index in sorted(out)
        if index in errors
    ]
    return replace(refined, removals=(*records, *refined.removals))


def control_left_out(survey: Survey, refined: Refined, control: Ints) -> Iterator[Message]:
    """A message on each control point that was left out.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjusted without these control points.
    control
        (n,) rows of control points.
    """
    if not len(control):
        return
    off, covariance = _off(survey, refined, control)
    for k, i in enumerate(control.tolist()):
        sigma = np.sqrt(np.diag(covariance[k]) + survey.control_sigma_m[i] ** 2)
        label = survey.label[survey.control_label[i]]
        where, likely = displaced(off[k], sigma), likely_fault(off[k])
        text = (
            f"The control point {label!r} was left out: it is {where}, and with it nothing else "
            f"would fit. Look at its coordinates{likely}, its label and its picks."
        )
        several = Several(
            "{count} control points were left out, as nothing else would fit with them",
            f"{label!r} is {where}{likely}",
            ending="Look at their coordinates, their labels and their picks.",
        )
        yield Message("warning", "control-left-out", text, labels=(label,), several=several)


def heights_left_out(survey: Survey, refined: Refined, labels: Sequence[str]) -> Iterator[Message]:
    """Report each stated height that was left out, and the height that the photos show.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjusted without these heights.
    labels
        Names of the points.
    """
    found, sigma = heights_above_ground(refined.adjustment)
    for label in labels:
        row = refined.adjustment.label_rows([label])[0]
        stated_m = survey.height_above_m[survey.label.index(label)]
        what = f"{label!r} is stated at {stated_m:.2f} m above the ground"
        shown = ""
        if row >= 0:
            shown = f", and the photos show it at {found[row]:.2f} ± {sigma[row]:.2f} m"
        text = (
            f"The stated height of {label!r} was left out: {what}{shown}. Measure its height "
            "again, and look whether its picks are on the right thing; until then it was adjusted "
            "with the height that the photos show."
        )
        several = Several(
            "{count} stated heights were left out",
            f"{what}{shown}",
            ending="Measure them again, and look whether the picks are on the right thing.",
        )
        yield Message(
            "warning",
            "height-left-out",
            text,
            labels=(label,),
            several=several,
            mend=freed([label]),
        )


def _off(survey: Survey, refined: Refined, control: Ints) -> tuple[Floats, Floats]:
    """Stated less found (n, 3) of some control points, and the covariance (n, 3, 3) of the latter.

    NaN where an adjustment does not have the point.
    """
    label = [survey.label[k] for k in survey.control_label[control]]
    place = refined.adjustment.label_rows(label)
    found, covariance = refined.adjustment.points()
    there = (place >= 0)[:, None]
    off = np.where(there, survey.control_world_m[control] - found[place], np.nan)
    return off, covariance[place]

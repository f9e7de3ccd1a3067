"""Record lengths, known things, control and heights that the robust adjustment left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Literal

import numpy as np

from uavgram.estimation.reliability.stated_values import (
    describe_displacement,
    explain_coordinates,
    explain_length,
)
from uavgram.estimation.survey.adjustment import LeftOutRows, Refined, Removal, compute_heights
from uavgram.estimation.survey.observations.known import compute_known_rows
from uavgram.estimation.survey.observations.lengths import TapedLengths, select_taped_lines
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import (
    Message,
    MessagePlural,
    Remedy,
    propose_free_heights,
    propose_photo_removal,
    propose_swap,
)
from uavgram.model.naming import format_digits, join_names, join_photo_names
from uavgram.model.survey import Survey
from uavgram.stages.refine.off_ground import MIN_HEIGHT_SIGMAS


def predict_readings(survey: Survey, refined: Refined, line: Ints) -> tuple[Floats, Floats]:
    """Predict the readings of tapes (n,) for some lines, and their sigmas.

    NaN where an end is not adjusted.

    Parameters
    ----------
    survey
        All observations.
    refined
        The adjusted survey.
    line
        (n,) rows of known lengths.
    """
    there, taped = _mark_taped_lines(survey, refined, line)
    found = np.full((2, len(line)), np.nan)
    found[:, there] = refined.adjustment.readings(taped)
    return found[0], found[1]


def _mark_taped_lines(survey: Survey, refined: Refined, line: Ints) -> tuple[Bools, TapedLengths]:
    """Mark lines (n,) with both ends in an adjustment, and return how these were taped."""
    at = refined.adjustment.label_rows(survey.label)
    there = (at[survey.line_start[line]] >= 0) & (at[survey.line_end[line]] >= 0)
    taped = select_taped_lines(survey, line[there])
    return there, taped._replace(start=at[taped.start], end=at[taped.end])


def add_records(survey: Survey, refined: Refined) -> Refined:
    """Record lengths and known things that were left out before any test."""
    recorded = {(removal.kind, removal.index) for removal in refined.removals}
    factor = refined.adjustment.minimum.factor
    records: list[Removal] = []
    kinds: tuple[tuple[Literal["line", "known"], str, dict[int, LeftOutRows | None]], ...] = (
        ("line", "lengths", _compare_left_out_lengths(survey, refined)),
        ("known", "known", _compare_left_out_things(survey, refined)),
    )
    for kind, group, left_out in kinds:
        for index, rows in left_out.items():
            if (kind, index) in recorded:
                continue
            # Standardised prediction error: w = error / sqrt(prediction variance + sigma^2).
            w = np.array([np.nan])
            if rows is not None:
                variance = factor.variances(rows.columns, rows.gradient)
                w = rows.error / np.sqrt(variance + rows.sigma**2)
            worst = float(w[np.argmax(np.abs(w))])
            suspicion = Suspicion(Member(group, -1, 0), worst, (), ())
            records.append(Removal(kind, index, suspicion, None, rows=rows))
    return replace(refined, removals=(*records, *refined.removals))


def _compare_left_out_lengths(survey: Survey, refined: Refined) -> dict[int, LeftOutRows | None]:
    """Compare each left-out length with the adjustment, by its row."""
    line = np.flatnonzero(refined.line_removed)
    there, taped = _mark_taped_lines(survey, refined, line)
    adjustment = refined.adjustment
    reading, gradient, columns = adjustment.problem.readings(adjustment.state, taped)
    error, sigma = reading - survey.length_m[line[there]], survey.length_sigma_m[line[there]]
    found: dict[int, LeftOutRows | None] = dict.fromkeys(line.tolist())
    for k, index in enumerate(line[there].tolist()):
        one = slice(k, k + 1)
        found[index] = LeftOutRows(error[one], sigma[one], gradient[one], columns[one])
    return found


def _compare_left_out_things(survey: Survey, refined: Refined) -> dict[int, LeftOutRows | None]:
    """Compare each left-out known thing with the adjustment, by its number."""
    adjustment = refined.adjustment
    found: dict[int, LeftOutRows | None] = {}
    for thing in survey.known:
        if thing.index not in refined.known_removed:
            continue
        label = np.full(len(survey.label), -1)
        label[list(thing.label)] = adjustment.label_rows(survey.label[k] for k in thing.label)
        if (seen := thing.relabel(label)) is not None:
            rows = compute_known_rows(adjustment.problem, adjustment.state, [seen])
            found[thing.index] = LeftOutRows(rows.value, rows.sigma, rows.gradient, rows.columns)
    return found


def report_control_left_out(survey: Survey, refined: Refined, control: Ints) -> Iterator[Message]:
    """Report each control point that was left out.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjustment without these control points.
    control
        (n,) rows of control points.
    """
    if not len(control):
        return
    found, covariance = _find_adjusted_control(survey, refined, control)
    named = (survey.label[k] for k in survey.control_label)
    every = dict(zip(named, survey.control_world_m, strict=True))
    for k, i in enumerate(control.tolist()):
        sigma = np.sqrt(np.diag(covariance[k]) + survey.control_sigma_m[i] ** 2)
        label = survey.label[survey.control_label[i]]
        stated = survey.control_world_m[i]
        where, likely = "not placed by anything else", ""  # as by one photo without its height
        if np.isfinite(found[k]).all():
            where = describe_displacement(stated - found[k], sigma)
            likely = explain_coordinates(stated, found[k], every)
        text = (
            f"The control point {label!r} was left out: it is {where}, and with it nothing else "
            f"would fit. Look at its coordinates{likely}, its label and its picks."
        )
        several = MessagePlural(
            "{count} control points were left out, as nothing else would fit with them",
            f"{label!r} is {where}{likely}",
            ending="Look at their coordinates, their labels and their picks.",
        )
        yield Message("warning", "control-left-out", text, labels=(label,), several=several)


def report_control_exchanged(
    survey: Survey, refined: Refined, names: tuple[str, ...]
) -> Iterator[Message]:
    """Report two control points whose coordinates are exchanged in the adjustment.

    Where nothing else is measured from only one of them, their labels may be swapped instead.

    Parameters
    ----------
    survey, refined
        All observations, and the adjustment.
    names
        Names of the two points; empty for none.
    """
    if not names:
        return
    points = join_names(map(repr, names))
    own = {survey.label.index(name) for name in names}
    ends = zip(survey.line_start.tolist(), survey.line_end.tolist(), strict=True)
    used = [{*each} for each, out in zip(ends, refined.line_removed, strict=True) if not out]
    used += [{*one.label} for one in survey.known if one.index not in refined.known_removed]
    photos = "in all photos" if len(survey.frame_id) > 1 else "in the photo"
    instead = ""
    swap: tuple[Remedy, ...] = ()
    if all(len(own & each) != 1 for each in used):
        instead = f"Or the labels {points} are swapped {photos}, and nothing shows which. "
        swap = (propose_swap(*names),)
    yield Message(
        "warning",
        "control-exchanged",
        f"The coordinates of the control points {points} seem to be exchanged: everything else "
        f"fits if each has those of the other. {instead}The results use the exchanged "
        "coordinates. Look at both points in the photos; then correct the list of control points.",
        labels=names,
        plain=f"{points} seem to have each other's coordinates.",
        instead=swap,
    )


def report_heights_left_out(
    survey: Survey, refined: Refined, labels: Sequence[str]
) -> Iterator[Message]:
    """Report each stated height that was left out, and the height that the photos show.

    One that they do not contradict in the end is no finding: its point is only less certain.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjustment without these heights.
    labels
        Names of the points.
    """
    found, sigma = compute_heights(refined.adjustment)
    for label in labels:
        row = refined.adjustment.label_rows([label])[0]
        k = survey.label.index(label)
        stated_m = float(survey.height_above_m[k])
        what = f"{label!r} is stated at {stated_m:.2f} m above the ground"
        shown = ""
        if row >= 0:
            if abs(found[row] - stated_m) < MIN_HEIGHT_SIGMAS * sigma[row]:
                continue
            shown = f", and the photos show it at {found[row]:.2f} ± {sigma[row]:.2f} m"
            mistake = explain_length(
                stated_m, survey.height_sigma_m[k], float(found[row]), float(sigma[row])
            )
            shown += f" ({mistake}?)" if mistake else ""
        text = (
            f"The stated height of {label!r} was left out: {what}{shown}. Measure its height "
            "again, and check whether its picks are on the right thing; until then the height that "
            "the photos show is used."
        )
        several = MessagePlural(
            "{count} stated heights were left out",
            f"{what}{shown}",
            ending="Measure them again, and check whether the picks are on the right thing.",
        )
        yield Message(
            "warning",
            "height-left-out",
            text,
            labels=(label,),
            several=several,
            mend=propose_free_heights([label]),
        )


def report_poses_left_out(refined: Refined) -> Iterator[Message]:
    """Report each photo whose pose by the log was left out, and its distance from that pose."""
    problem, blocks = refined.adjustment.problem, refined.adjustment.minimum.blocks
    prior = problem.survey.telemetry
    if prior is None or not refined.pose_widened:
        return
    # Residuals in metres and radians, from those in sigmas.
    whitening = problem.telemetry_whitening
    residual = np.linalg.solve(whitening, blocks["telemetry"].residual[..., None])[..., 0]
    row = {problem.survey.frame_id[k]: i for i, k in enumerate(prior.frame_index.tolist())}
    strained = [frame for frame in refined.pose_widened if frame in row]
    center = refined.adjustment.state.center[prior.frame_index]
    exchanged = _find_exchanged(
        center, center - residual[:, :3], [row[frame] for frame in strained]
    )
    names = {k: problem.survey.frame_id[prior.frame_index[k]] for pair in exchanged for k in pair}
    for one, other in exchanged:
        pair = (names[one], names[other])
        yield Message(
            "warning",
            "photos-exchanged",
            f"The photos {join_photo_names(pair)} seem to be exchanged: each was taken at the "
            "recorded position of the other. Those positions hardly count. Look whether the files, "
            "their names or their picks are exchanged.",
            frames=pair,
        )
    for frame in strained:
        if frame in names.values():
            continue
        own = residual[row[frame]]
        apart_m = float(np.linalg.norm(own[:3]))
        turn_deg = float(np.degrees(np.linalg.norm(own[3:])))
        how = f"{format_digits(apart_m)} m away, turned by {format_digits(turn_deg)}°"
        yield Message(
            "warning",
            "telemetry-strained",
            f"Photo {frame!r} is not at its recorded position: all other observations place it "
            f"{how}. That position and direction hardly count. Check its picks, its time, how "
            "the camera hung (`mount`) and its zoom.",
            frames=(frame,),
            several=MessagePlural(
                "{count} photos are not at their recorded positions: all other observations place "
                "them elsewhere",
                f"{frame!r} ({how})",
                ending="Those positions and directions hardly count. Check the picks "
                "and times of these photos, how the camera hung (`mount`) and its zoom.",
            ),
            instead=(propose_photo_removal(frame),),
        )


MAX_EXCHANGE_SHARE = 0.3
"""Distance of two photos from each other's recorded positions, as a share of the distances from
their own, up to which they may be exchanged."""


def _find_exchanged(center: Floats, logged: Floats, strained: Sequence[int]) -> list[list[int]]:
    """Find pairs of photos that are at each other's recorded positions.

    Parameters
    ----------
    center, logged
        (n, 3) adjusted and recorded positions [m].
    strained
        Rows of the photos that are elsewhere than recorded.
    """
    found: list[list[int]] = []
    for pair in map(list, combinations(strained, 2)):
        own = np.linalg.norm(center[pair] - logged[pair], axis=1).min()
        crosswise = np.linalg.norm(center[pair] - logged[pair[::-1]], axis=1).max()
        if crosswise < MAX_EXCHANGE_SHARE * own and not np.isin(pair, found).any():
            found.append(pair)
    return found


def _find_adjusted_control(
    survey: Survey, refined: Refined, control: Ints
) -> tuple[Floats, Floats]:
    """Return the adjusted places (n, 3) of control points, and their covariance (n, 3, 3).

    NaN where an adjustment does not have the point.
    """
    label = [survey.label[k] for k in survey.control_label[control]]
    place = refined.adjustment.label_rows(label)
    found, covariance = refined.adjustment.points()
    return np.where((place >= 0)[:, None], found[place], np.nan), covariance[place]

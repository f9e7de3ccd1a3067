"""Residual, test statistic and status of known things and lines of known position."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import cast

import numpy as np
from scipy.special import ndtri

from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.known_kinds import ALL_KINDS
from uavgram.estimation.survey.observations.known import compute_known_rows, describe_thing
from uavgram.geometry.ground.conditions import compute_line_offsets
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import FREE_HEIGHT, Message, MessagePlural
from uavgram.model.naming import format_digits, format_misfit
from uavgram.model.observations import KnownThing, KnownThings, LinePosition
from uavgram.model.result.tables import (
    NO_LINES_OF_POSITION,
    NOTHING_KNOWN,
    ControlLineResults,
    KnownResults,
    KnownStatus,
    LineOfPositionStatus,
)
from uavgram.stages.judge.lines import PICK_OR_CORRECT, describe_missing_picks
from uavgram.stages.judge.tested_survey import TestedSurvey

_COLUMNS = ("adjusted", "adjusted_sigma", "residual", "w", "redundancy", "mdb")


def judge_known(
    examined: TestedSurvey, known: KnownThings, picked: Collection[str] = ()
) -> tuple[KnownResults, tuple[Message, ...]]:
    """Judge the fit of each known thing; report unseen ones, and withheld ones that do not fit.

    Parameters
    ----------
    examined
        The adjusted survey under test.
    known
        All known things of the project.
    picked
        Labels that have picks, whether these take part or not.
    """
    if not known.name:
        return NOTHING_KNOWN, ()
    adjustment = examined.adjustment
    columns = {name: np.full(len(known.name), np.nan) for name in _COLUMNS}
    things = _select_seen(adjustment, known)
    withheld = [thing for thing in things if not known.adjust[thing.index]]
    _values(adjustment, things, {thing.index for thing in withheld}, columns)
    _fit_of_observed(examined, columns)
    used = {thing.index for thing in adjustment.survey.known}
    idle = used - {thing.index for thing in adjustment.problem.known}
    suspect = _find_suspects(examined)
    status: list[KnownStatus] = []
    messages: list[Message] = []
    for i in range(len(known.name)):
        if all(thing.index != i for thing in things):
            status.append("unseen")
            messages.append(_report_unseen(adjustment, known, i, picked))
        elif not known.adjust[i]:
            status.append("checked")
        elif i not in used:
            status.append("removed")
        elif i in idle:
            status.append("idle")
            messages.append(_idle(known, i))
        else:
            status.append("suspect" if i in suspect else "used")
    results = KnownResults(
        name=known.name,
        kind=known.kind,
        points=known.points,
        value=known.value,
        sigma=known.sigma,
        unit=tuple(ALL_KINDS[kind].unit for kind in known.kind),
        status=tuple(status),
        **columns,
    )
    messages += [_left_out(results, i) for i in _find_gross(examined, known.name)]
    unexplained = {name: np.full(len(known.name), np.nan) for name in _COLUMNS}
    _values(examined.without_suspects, things, {thing.index for thing in withheld}, unexplained)
    messages += [
        _does_not_fit(results, thing.index)
        for thing in withheld
        if _is_off(examined, results, thing) and examined.significant(unexplained["w"][thing.index])
    ]
    return results, tuple(messages)


def _select_seen(adjustment: Adjustment, known: KnownThings) -> list[KnownThing]:
    """Return things with all points among the adjusted ones; for a line, with any."""
    place = {label: k for k, label in enumerate(adjustment.survey.label)}
    things = (known.get_seen_thing(i, place) for i in range(len(known.name)))
    return [thing for thing in things if thing is not None]


def _values(
    adjustment: Adjustment, things: list[KnownThing], withheld: set[int], columns: dict[str, Floats]
) -> None:
    """Compute values between the adjusted points; for withheld things, also their misfit."""
    if not things:
        return
    rows = compute_known_rows(adjustment.problem, adjustment.state, things)
    joint = adjustment.minimum.factor.covariances(rows.columns, rows.gradient)
    for k, thing in enumerate(things):
        own, at = np.flatnonzero(rows.thing == k), thing.index
        off = rows.value[own]
        residual = off[0] if len(own) == 1 else float(np.linalg.norm(off))
        columns["residual"][at] = residual
        columns["adjusted"][at] = ALL_KINDS[thing.kind].compute_adjusted_value(thing, residual)
        if len(own) == 1:
            columns["adjusted_sigma"][at] = np.sqrt(max(joint[own[0], own[0]], 0.0))
        if at in withheld:
            columns["w"][at] = _deviate(off, joint[np.ix_(own, own)] + rows.covariance(own))


def _deviate(off: Floats, whole: Floats) -> float:
    """Return an error over its sigma; for several, the normal deviate of equal probability."""
    if len(off) == 1:
        return float(off[0] / np.sqrt(whole[0, 0]))
    probability = compute_upper_tail(float(off @ np.linalg.solve(whole, off)), len(off))
    return float(-ndtri(max(probability, 1e-300) / 2.0))


def _fit_of_observed(examined: TestedSurvey, columns: dict[str, Floats]) -> None:
    if "known" not in examined.groups:
        return
    group, bias = examined.groups["known"], examined.groups["known"].bias(examined.significance)
    for thing, row in _rows(examined):
        w = group.w[row, 0]
        columns["w"][thing.index] = w[np.abs(w).argmax()]
        columns["redundancy"][thing.index] = group.redundancy[row, 0].mean()
        detectable = bias[row, 0]
        known = np.isfinite(detectable)
        columns["mdb"][thing.index] = detectable[known].max() if known.all() else np.nan


def _rows(examined: TestedSurvey) -> Iterator[tuple[KnownThing, Ints]]:
    """Yield each thing that takes part, and its rows in their group."""
    tested = examined.refined.adjustment
    for k, thing in enumerate(tested.problem.known):
        yield thing, np.flatnonzero(tested.problem.known_thing == k)


def _find_suspects(examined: TestedSurvey) -> set[int]:
    """Return the numbers of the things that do not fit."""
    if "known" not in examined.groups:
        return set()
    suspect = examined.suspect("known")
    return {thing.index for thing, row in _rows(examined) if suspect[row].any()}


def _is_off(examined: TestedSurvey, results: KnownResults, thing: KnownThing) -> bool:
    w = float(results.w[thing.index])
    return results.status[thing.index] == "checked" and examined.significant(w)


def _find_gross(examined: TestedSurvey, names: Sequence[str]) -> list[int]:
    """Return the numbers of things that were left out before any test, without rivals."""
    removals = examined.refined.removals
    return [
        r.index
        for r in removals
        if r.kind == "known"
        and r.before is None
        and not examined.refined.is_contested("known", names[r.index])
    ]


def _left_out(results: KnownResults, i: int) -> Message:
    what = describe_thing(results.kind[i], results.name[i], results.points[i])
    found = (
        f" (± {format_digits(results.adjusted_sigma[i])})" if results.adjusted_sigma[i] > 0 else ""
    )
    how, why = (
        f"{describe_values(results, i)}{found}",
        "With so gross an error, nothing else would fit.",
    )
    several = MessagePlural(
        "{count} known things were left out",
        f"{what} {how}",
        ending=f"Look at their values and units, and at the labels of their points. {why}",
    )
    text = (
        f"The known {what} was left out: {how}. Look at its value and unit, and at the labels of "
        f"its points. {why}"
    )
    return Message("warning", "known-left-out", text, labels=results.points[i], several=several)


def _report_unseen(
    adjustment: Adjustment, known: KnownThings, i: int, picked: Collection[str]
) -> Message:
    labels = adjustment.survey.label
    missing = [label for label in known.points[i] if label not in labels]
    what = describe_thing(known.kind[i], known.name[i], known.points[i])
    which = describe_missing_picks(missing, labels, picked)
    return Message(
        "warning",
        "known-unseen",
        f"The {what} is not used: {which}. {PICK_OR_CORRECT}",
        labels=tuple(missing),
        several=MessagePlural("{count} known things are not used", what, which, PICK_OR_CORRECT),
    )


def _idle(known: KnownThings, i: int) -> Message:
    """Report a thing without effect, as all of its points are on the ground."""
    what = describe_thing(known.kind[i], known.name[i], known.points[i])
    if ALL_KINDS[known.kind[i]].needs == "world":
        return _report_unplaced(known, i, what)
    return Message(
        "warning",
        "known-idle",
        f"The {what} is not used: by their picks all of its points are on the ground, where it "
        f"adds no information. Where that is wrong, let their heights be found {FREE_HEIGHT}.",
        labels=known.points[i],
        several=MessagePlural(
            "{count} known things are not used, as by their picks all of their points are on the "
            "ground, where they add no information",
            what,
            ending=f"Where that is wrong, let their heights be found {FREE_HEIGHT}.",
        ),
    )


def _report_unplaced(known: KnownThings, i: int, what: str) -> Message:
    """Report a thing that refers to the world where no other observation does."""
    why, way_out = ALL_KINDS[known.kind[i]].unplaced
    return Message(
        "warning",
        "known-idle",
        f"The {what} is not used: {why}. {way_out}",
        labels=known.points[i],
        several=MessagePlural("{count} known things are not used", what, why, way_out),
    )


def _does_not_fit(results: KnownResults, i: int) -> Message:
    what = describe_thing(results.kind[i], results.name[i], results.points[i])
    how = f"{describe_values(results, i)} ({format_misfit(results.w[i])})"
    return Message(
        "warning",
        "known-suspect",
        f"The withheld {what} does not fit: {how}. Look at its value, at its points and at their "
        "picks.",
        labels=results.points[i],
        several=MessagePlural(
            "{count} withheld known things do not fit",
            f"{what} {how}",
            ending="Look at their values, at their points and at their picks.",
        ),
    )


def describe_values(results: KnownResults, i: int) -> str:
    """Return ``given 3.500 m, found 3.612 m``, or for a condition ``off by 0.112 m``."""
    unit = results.unit[i]
    if np.isnan(results.value[i]):
        return f"off by {abs(results.adjusted[i]):.3f} {unit}"
    if results.kind[i] in ("area", "volume") and results.adjusted[i] == 0.0:
        return f"given {results.value[i]:.3f} {unit}, but its points go round no area in order"
    return f"given {results.value[i]:.3f} {unit}, found {results.adjusted[i]:.3f} {unit}"


def judge_control_lines(
    adjustment: Adjustment, known: KnownThings, judged: KnownResults
) -> ControlLineResults:
    """Return lines of known position among all known things; none without a world frame.

    Parameters
    ----------
    adjustment
        Adjustment of the survey.
    known, judged
        All known things, and their fit.
    """
    placed = [(i, line) for i, line in enumerate(known.position) if line is not None]
    if not placed or adjustment.survey.gauge == "plane":
        return NO_LINES_OF_POSITION
    rows = [i for i, _ in placed]
    ends = np.stack([_line_ends(adjustment, line) for _, line in placed])
    return ControlLineResults(
        name=tuple(known.name[i] for i in rows),
        points=tuple(known.points[i] for i in rows),
        start_world_m=ends[:, 0],
        end_world_m=ends[:, 1],
        has_height=np.array([line.has_height for _, line in placed]),
        sigma_m=known.sigma[rows],
        offset_m=np.array([_offset(adjustment, line, known.points[i]) for i, line in placed]),
        w=judged.w[rows],
        redundancy=judged.redundancy[rows],
        mdb_m=judged.mdb[rows],
        status=tuple(cast("LineOfPositionStatus", judged.status[i]) for i in rows),
    )


def _line_ends(adjustment: Adjustment, line: LinePosition) -> Floats:
    """Return the ends (2, 3); on the ground of the first area, where no height is known."""
    ends = line.ends_m.copy()
    if not line.has_height:
        state, none = adjustment.state, np.zeros(2, dtype=np.int64)
        ground = adjustment.problem.ground.at(state.plane, state.relief, none, ends[:, :2])
        ends[:, 2] = ground.height_m
    return ends


def _offset(adjustment: Adjustment, line: LinePosition, points: tuple[str, ...]) -> float:
    label = adjustment.label_rows(points)
    label = label[label >= 0]
    if not len(label):
        return float("nan")
    world, _, _ = adjustment.problem.world_points(adjustment.state, label)
    off = compute_line_offsets(world, line.ends_m, upwards=False).value[:, 0]
    return float(off[np.abs(off).argmax()])

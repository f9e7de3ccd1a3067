"""Messages of the refinement: observations left out or removed, ambiguity, no convergence.

Also significant properties of camera and ground that the survey found without a statement.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import find_seen_lines
from uavgram.estimation.first_poses.known_frames import count_known_rows
from uavgram.estimation.measuring.scale import (
    DistanceChanges,
    compute_distance_changes,
    describe_line_faults,
    find_next_line,
)
from uavgram.estimation.reliability.redundancy import compute_core_fit
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause, Refined, Removal
from uavgram.estimation.survey.ground_planes import PLANE_SIZE
from uavgram.estimation.survey.names import ObservationNames
from uavgram.estimation.survey.observations.observation import Suspicion
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural, propose_pick_removal
from uavgram.model.naming import FOOT_M, format_digits, format_misfit, join_names
from uavgram.model.survey import Cause, Survey, SurveyCorrection
from uavgram.stages.remedies import add_remedies, report_not_located

MIN_HEIGHT_M, MAX_HEIGHT_M = 0.3, 1000.0
"""Heights of a drone's camera above the ground [m], beyond which lengths or log are in question."""

USUAL_MIN_HEIGHT_M, USUAL_MAX_HEIGHT_M = 3.0, 150.0
"""Usual heights of drone photos above the ground [m]; others are possible, if rarer."""

ORDINARY_HEIGHT_M = 50.0
"""The most usual of these heights [m]."""

UNITS_M = {
    "millimetres": 1e-3,
    "centimetres": 1e-2,
    "inches": FOOT_M / 12.0,
    "feet": FOOT_M,
    "yards": 3.0 * FOOT_M,
    "kilometres": 1e3,
}
"""Possible units of the lengths as written, in metres."""

MAX_LISTED = 12
"""Largest number of lengths in a list, oddest first."""

LOOK_AT_PICKS = "Look at their places and labels."

SAME_SCENE_SIGMAS = 1.0
"""Change of distances, in their sigmas, up to which two solutions differ in their cameras only."""

WEAK_SIGMA = 0.01
"""Relative sigma of the scene's distances (root mean square) above which the lengths are weak."""


def report_refinement(survey: Survey, refined: Refined) -> tuple[Message, ...]:
    """Collect the messages on the result: picks left out, removals, ambiguity, no convergence."""
    messages = [*_report_left_out(survey, refined)]
    messages += [
        _removal_message(removal, removal.before)
        for removal in refined.removals
        if removal.before is not None
    ]
    if not refined.adjustment.minimum.converged:
        messages.append(_not_converged_message())
    messages += _report_contradiction(survey, refined)
    messages += _report_odd_height(refined.adjustment)
    return (*messages, *_report_ambiguity(refined), *_report_weak_lengths(refined))


def _not_converged_message() -> Message:
    """Report missing convergence, without names: such residuals do not show the fault."""
    text = (
        "The picks and lengths lead to no result: do not use these numbers. The adjustment did not "
        "converge, and no test can find the fault from these numbers. Read the other "
        "messages first, then look for a swapped label or a wrong length; where the camera is only "
        "assumed, calibrate it."
    )
    return Message("error", "not-converged", text)


def _report_contradiction(survey: Survey, refined: Refined) -> Iterator[Message]:
    """Report lengths that contradict each other, where none could be singled out as wrong."""
    if survey.telemetry is not None:
        return
    keep = np.zeros(len(survey.pick_frame), dtype=bool)
    keep[refined.pick_index] = True
    ratio = find_length_ratios(survey, keep)
    ratio[refined.line_removed] = np.nan
    settled = refined.adjustment.minimum.converged and not find_odd_lengths(ratio).any()
    if np.isfinite(ratio).any() and not settled:
        text = f"The lengths may contradict each other. {_list_ratios(survey, ratio)}"
        names = (survey.line_name[i] for i in _odd_first(ratio) if survey.line_name)
        yield Message("warning", "lengths-contradict", text, lengths=tuple(filter(None, names)))


def _odd_first(ratio: Floats) -> Ints:
    """Return the lengths that can be compared, the oddest first."""
    lines = np.flatnonzero(np.isfinite(ratio))
    return lines[np.argsort(-np.abs(ratio[lines]), kind="stable")][:MAX_LISTED]


def _list_ratios(survey: Survey, ratio: Floats) -> str:
    """List the ratios of lengths to their view, as sentences."""
    label = survey.label
    values = [
        f"{label[survey.line_start[i]]!r} to {label[survey.line_end[i]]!r} "
        f"{format_digits(np.exp(ratio[i]), 3)}"
        for i in _odd_first(ratio)
    ]
    return (
        "Look at the unit and at the labels of the odd one. Beside what its photo shows, each is "
        f"so many times as long as an ordinary one: {', '.join(values)}."
    )


def _report_odd_height(adjustment: Adjustment) -> Iterator[Message]:
    """Report cameras at a height from which no drone takes photos of the ground."""
    survey = adjustment.survey
    above = adjustment.state.center[:, 2] - adjustment.state.plane[0]
    height = float(np.median(above))
    if MIN_HEIGHT_M <= height <= MAX_HEIGHT_M:
        if survey.gauge == "plane" and not USUAL_MIN_HEIGHT_M <= height <= USUAL_MAX_HEIGHT_M:
            text = (
                f"By the lengths, the cameras were {format_digits(height)} m above the ground. If "
                "they were not, check the unit of the lengths: they must be in metres."
            )
            yield Message("info", "unusual-height", text)
        return
    size = (
        f"{format_digits(height / 1000, 3)} km"
        if height > MAX_HEIGHT_M
        else f"{format_digits(height)} m"
    )
    where = f"The cameras seem to be {size} above the ground"
    units = [
        unit
        for unit, one_m in UNITS_M.items()
        if USUAL_MIN_HEIGHT_M <= height * one_m <= USUAL_MAX_HEIGHT_M
    ]
    if len(adjustment.problem.line_index) and units:
        text = (
            f"{where}, as with lengths in {join_names(units, link='or')}: in metres that would be "
            f"{format_digits(height * UNITS_M[units[0]])} m. Write the lengths in metres; else "
            f"look at "
            "the heights of log, ground and control points."
        )
    else:
        text = (
            f"{where}: look at the heights of log, ground and control points, and at the lengths. "
            "Do not use the numbers before it is cleared up."
        )
    message = Message("warning", "odd-height", text)
    likely = sorted(units, key=lambda unit: abs(np.log(height * UNITS_M[unit] / ORDINARY_HEIGHT_M)))
    yield add_remedies(message, survey, list(_as_in(survey, likely)))


def _as_in(survey: Survey, units: Sequence[str]) -> Iterator[SurveyCorrection]:
    """Yield the corrections that take all lengths as read in a unit of tapes."""
    for unit in units:
        if unit != "kilometres":
            of_line = survey.length_m * UNITS_M[unit]
            yield SurveyCorrection(length_m=dict(enumerate(of_line.tolist())))


def _report_left_out(survey: Survey, refined: Refined) -> Iterator[Message]:
    """Report left-out picks of the remaining frames, and each frame without any pick once."""
    frames: dict[str, Counter[str]] = {}
    stayed = set(refined.adjustment.survey.frame_id)
    gross = [k for k, why in refined.pick_reason.items() if why.cause is LeftOutCause.GROSS]
    for index, reason in sorted(refined.pick_reason.items()):
        label = survey.label[survey.pick_label[index]]
        name, why = survey.frame_id[survey.pick_frame[index]], reason.text
        if name not in stayed:
            frames.setdefault(name, Counter())[why] += 1
            continue
        if index in gross and refined.is_contested("pixels", label):
            continue  # it has a message together with its rivals
        yield Message(
            "warning",
            "pick-left-out",
            f"The pick of {label!r} in {name!r} was left out: {why}. Look at its place and label.",
            frames=(name,),
            labels=(label,),
            several=MessagePlural(
                "{count} picks were left out", f"{label!r} in {name!r}", why, LOOK_AT_PICKS
            ),
            mend=propose_pick_removal([(name, label)])
            if reason.cause is LeftOutCause.GROSS
            else None,
        )
    for name, reasons in frames.items():
        why = "; ".join(
            text if len(reasons) == 1 else f"{text} ({number} pick{'s' if number > 1 else ''})"
            for text, number in reasons.items()
        )
        yield Message(
            "warning",
            "frame-left-out",
            f"The photo {name!r} was left out, with all of its picks: {why}. {LOOK_AT_PICKS}",
            frames=(name,),
            several=MessagePlural(
                "{count} photos were left out, with all of their picks",
                repr(name),
                why,
                LOOK_AT_PICKS,
            ),
        )


def _removal_message(removal: Removal, before: Refined) -> Message:
    if removal.cause is not None:
        return _correction_message(removal.cause, *removal.mended)
    names = ObservationNames(before.adjustment)
    what = names.observation(removal.suspicion.suspect)
    plural = {"line": "known lengths", "pick": "picks", "known": "known things"}[removal.kind]
    text = (
        f"The {what} was taken out, as it does not fit the rest ({format_misfit(removal.w)}); "
        "everything else was adjusted again. Look at it, and correct or delete it."
    )
    if removal.suspicion.group:
        text += f" {names.advice(removal.suspicion)}"
    if removal.suspicion.rivals:
        text += f" {names.rivals(removal.suspicion)}"
    return Message(
        "warning",
        f"{removal.kind}-removed",
        text,
        **names.subjects(removal.suspicion.suspect),
        several=MessagePlural(
            f"{{count}} {plural} were taken out, as they do not fit the rest, which was adjusted "
            "again",
            f"{what} ({format_misfit(removal.w)})",
            ending="Look at them, and correct or delete them.",
        ),
    )


def _correction_message(cause: Cause, before: str, after: str) -> Message:
    """Report a cause, with the correction that was made."""
    first, *rest = cause.message.split_text()
    done = f"The program corrected it, check this: {before}; now {after}"
    if before == after:  # nothing changed, but what is listed takes no part
        done = f"The program left this out, check it: {before}"
    text = ". ".join(sentence.removesuffix(".") for sentence in (first, done, *rest))
    return replace(cause.message, text=f"{text}.", several=None, mend=None, instead=())


def not_located_message(refined: Refined, suspicion: Suspicion) -> Message:
    """Report a blunder that no test can separate from its neighbours."""
    kept = f"Nothing was taken out ({format_misfit(suspicion.w)})."
    return report_not_located(ObservationNames(refined.adjustment), suspicion, kept)


def indispensable_message(refined: Refined, removal: Removal, why: GeometryError) -> Message:
    """Report a suspected blunder that is needed to determine the survey.

    Parameters
    ----------
    refined
        The adjusted survey.
    removal
        The suspected blunder.
    why
        Error that names the unknown that is undetermined without it.
    """
    names, accused = ObservationNames(refined.adjustment), removal.suspicion.suspect
    text = (
        f"The {names.observation(accused)} does not fit the rest, but was kept "
        f"({format_misfit(removal.w)}). Look at it, and correct it. Without it, {why}"
    )
    return Message("warning", "blunder-kept", text, **names.subjects(accused))


def _report_ambiguity(refined: Refined) -> Iterator[Message]:
    survey = refined.adjustment.survey
    if survey.telemetry is None and survey.gauge == "world":
        yield from _report_ambiguous_control(refined)
        return
    if refined.alternatives:
        within = "" if survey.telemetry is None else " within the uncertainty of the log"
        how_else = "" if survey.telemetry is not None else ", or give the flight log"
        also = ", or give another right angle or pair of parallel lines" if survey.known else ""
        what = "known lengths and things fit" if survey.known else "lengths fit"
        changes = [
            compute_distance_changes(refined.adjustment, one) for one in refined.alternatives
        ]
        text = (
            f"The {what} {len(refined.alternatives) + 1} camera positions about equally well"
            f"{within}: {_difference_text(changes)}. Tape another line that does not close a "
            f"triangle{also}{how_else}. The results list the measured values of the others under "
            "alternatives."
        )
        differs = max(one.sigmas for one in changes) > SAME_SCENE_SIGMAS
        yield Message("warning" if differs else "info", "ambiguous-pose", text)
    lines = len(refined.adjustment.problem.line_index)
    if survey.telemetry is None and count_known_rows(survey) + lines == 3:
        if survey.known:
            text = (
                "Three things alone are known of the ground: nothing checks them, and they may "
                "have several solutions. Give a fourth: a length, a right angle, two parallel "
                "lines."
            )
            yield Message("warning", "three-known", text)
            return
        best, ends = _suggest_length(refined)
        text = (
            "Three lengths alone: nothing checks them, and they may have several solutions. Tape "
            f"a fourth line that does not close a triangle{best}."
        )
        yield Message("warning", "three-lengths", text, labels=ends)


def _difference_text(changes: Sequence[DistanceChanges]) -> str:
    """Describe by how much the distances between the points differ in the other solutions."""
    median, largest = (
        format_digits(100.0 * max(each))
        for each in ([one.median for one in changes], [one.largest for one in changes])
    )
    return f"in another one, a distance usually differs by {median} %, and at most by {largest} %"


def _report_weak_lengths(refined: Refined) -> Iterator[Message]:
    """Report lengths that determine the scene's distances poorly, and the line to tape next."""
    adjustment = refined.adjustment
    survey, used = adjustment.survey, adjustment.problem.line_index
    if survey.telemetry is not None or survey.gauge == "world":
        return
    point = adjustment.state.point[:, :2]
    # Right angles and the like determine what lengths of one direction, or a single one, do not.
    ends = point[survey.line_start[used]], point[survey.line_end[used]]
    faults = () if count_known_rows(survey) else describe_line_faults(*ends, point)
    advice = find_next_line(adjustment)
    if advice is None or (advice.relative_sigma < WEAK_SIGMA and not faults):
        return
    what = "; ".join(faults) or "they hardly fix the scene's shape"
    known = "lengths and things" if survey.known else "lengths"
    best, labels = _suggest_length(refined)
    text = (
        f"The known {known} are weak as a set: {what}. Distances between the points are known to "
        f"{format_digits(100 * advice.relative_sigma)} %. Tape another line{best}."
    )
    level: Literal["info", "warning"] = "warning" if advice.relative_sigma >= WEAK_SIGMA else "info"
    yield Message(level, "weak-lengths", text, labels=labels)


def _suggest_length(refined: Refined) -> tuple[str, tuple[str, ...]]:
    """Suggest the line to tape next and its effect, as the end of a sentence; return its ends."""
    advice = find_next_line(refined.adjustment)
    if advice is None or not advice.relative_sigma_after < advice.relative_sigma:
        return "", ()
    label = refined.adjustment.survey.label
    start, end = label[advice.start], label[advice.end]
    text = (
        f"; best from {start!r} to {end!r}, about {advice.length_m:.1f} m long: distances "
        f"would then be known to {format_digits(100 * advice.relative_sigma_after)} % instead of "
        f"{format_digits(100 * advice.relative_sigma)} %"
    )
    return text, (start, end)


def _report_ambiguous_control(refined: Refined) -> Iterator[Message]:
    if not refined.alternatives:
        return
    text = (
        f"The control points fit {len(refined.alternatives) + 1} camera positions equally well. "
        "Pick more control points, wider apart or of other heights, or give the flight log. The "
        "results list the measured values of the others under alternatives."
    )
    yield Message("warning", "ambiguous-pose", text)


def too_many_message(removed: int) -> Message:
    """Report that the removal was stopped: the fault is not a single observation."""
    text = (
        f"{removed} picks and lengths were taken out and still others do not fit, so that was "
        "stopped: do not use these numbers. Something common to them is wrong: look at labels, "
        "the camera, the ground, times."
    )
    return Message("error", "too-many-blunders", text)


MIN_LENGTHS = 3
"""Least number of lengths that determine their common scale, which the log may miss."""

ODD_RATIO = 30.0
"""Ratio of a length to the others of its frame that perspective alone cannot explain."""


def find_length_ratios(survey: Survey, keep: Bools) -> Floats:
    """Compute logarithms (L,) of lengths over their view by a camera that looks straight down.

    Each is relative to the median in its frame, for frames that show three or more; NaN for other
    lengths.
    """
    seen = find_seen_lines(survey)
    usable = np.flatnonzero(keep[seen.start] & keep[seen.end])
    number = np.bincount(seen.frame[usable], minlength=len(survey.frame_id))
    rows = usable[number[seen.frame[usable]] >= MIN_LENGTHS]
    frame, line = seen.frame[rows], seen.line[rows]
    pixel = survey.pixel_px[np.concatenate([seen.start[rows], seen.end[rows]])]
    calibration = survey.calibration
    ray = back_project(calibration.model, calibration.parameters, pixel)
    # Distance of the ends in the image plane z = 1.
    apart = np.linalg.norm(ray[: len(rows)] - ray[len(rows) :], axis=1)
    # Log ratios relative to the median of their frame, then the median over frames.
    ratio = np.log(survey.length_m[line] / apart)
    ratio -= group_medians(ratio, frame, len(survey.frame_id))[frame]
    shown = np.bincount(line, minlength=len(survey.line_start)) > 0
    return np.where(shown, group_medians(ratio, line, len(survey.line_start)), np.nan)


def find_odd_lengths(ratio: Floats) -> Bools:
    """Mark the ratios (L,) that no perspective explains."""
    return np.asarray(np.abs(ratio) > np.log(ODD_RATIO))


def group_medians(value: Floats, group: Ints, groups: int) -> Floats:
    """Compute the lower median of the values of each group; 0 where it has none.

    Parameters
    ----------
    value
        (n,) values, in any unit.
    group
        (n,) group of each.
    groups
        Number of groups.
    """
    if not len(value):
        return np.zeros(groups)
    order = np.lexsort((value, group))
    number = np.bincount(group, minlength=groups)
    first = np.cumsum(number) - number
    middle = np.minimum(first + np.maximum(number - 1, 0) // 2, len(value) - 1)
    return np.where(number > 0, value[order][middle], 0.0)


REPORTED_SIGMAS = 3.0
"""Sigmas from zero beyond which a value is reported."""

LEVEL_DEG = 2.0
"""Slope [deg] up to which people call a ground level."""

SHUTTER_FOUND = (
    "This camera exposes a photo row by row (rolling shutter), as the tie points show. The effect "
    "is corrected as far as they show it. They do not show how far the drone flew during a photo, "
    "so lengths along the flight are less certain. Name the flight's log (`log:`), or state "
    "`readout_ms` in the camera file."
)


def report_learnt(adjustment: Adjustment) -> Iterator[Message]:
    """Report a rolling shutter, and ground that slopes."""
    if adjustment.minimum.converged:
        sure = REPORTED_SIGMAS * _error_ratio(adjustment)
        yield from _report_shutter(adjustment, sure)
        yield from _report_slopes(adjustment, sure)


def _error_ratio(adjustment: Adjustment) -> float:
    """Return the ratio of actual to stated errors, at least 1: a wrong pick may tilt a plane."""
    fit = compute_core_fit(adjustment)
    return float(np.sqrt(max(fit.squares / max(fit.degrees, 1.0), 1.0)))


def _report_shutter(adjustment: Adjustment, sure: float) -> Iterator[Message]:
    rolling, layout = adjustment.survey.rolling, adjustment.problem.layout
    if rolling is None or not layout.readout or rolling.readout.value_s:
        return
    if rolling.by_photos:
        yield Message("info", "shutter-found", SHUTTER_FOUND)
        return
    found_s = float(adjustment.state.readout[0])
    sigma_s = float(np.sqrt(adjustment.shared_covariance(layout.first_readout, 1)[0, 0]))
    if abs(found_s) > sure * sigma_s:
        text = (
            f"This camera exposes a photo row by row (rolling shutter), in "
            f"{1e3 * abs(found_s):.0f} ± {1e3 * sigma_s:.0f} ms. The results take it into account. "
            "If you know the camera's own time, state it as `readout_ms` in the camera file."
        )
        yield Message("info", "shutter-found", text)


def _report_slopes(adjustment: Adjustment, sure: float) -> Iterator[Message]:
    layout, survey = adjustment.problem.layout, adjustment.survey
    if not layout.plane:
        return
    plane = adjustment.state.plane.reshape(-1, PLANE_SIZE)
    fixed = len(plane) - layout.plane // PLANE_SIZE
    for area in range(fixed, len(plane)):
        # Sigma of the slope in its own direction; angle = atan(slope).
        slope = plane[area, 1:]
        first = layout.first_plane + PLANE_SIZE * (area - fixed) + 1
        size = float(np.linalg.norm(slope))
        toward = slope / size if size else slope
        sigma = float(np.sqrt(toward @ adjustment.shared_covariance(first, 2) @ toward))
        angle, error = np.degrees([np.arctan(size), sigma / (1.0 + size**2)])
        usual = np.degrees(REPORTED_SIGMAS * survey.grounds[area].slope_sigma_rad)
        if angle > min(LEVEL_DEG, usual) and angle > sure * error:
            name = survey.grounds[area].name
            where = f"The ground of area {name!r}" if len(plane) > 1 else "The ground"
            text = (
                f"{where} slopes by {angle:.1f} ± {format_digits(error, 1)} degrees. The results "
                "take it into account."
            )
            yield Message("info", "ground-slopes", text)

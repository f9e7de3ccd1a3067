"""Verdict on a result in words, the same wherever it is shown."""

from __future__ import annotations

from itertools import product
from math import isfinite
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools
from uavgram.model.naming import FOOT_M, METRIC, Units, format_count, join_names
from uavgram.model.result.reliability import MeasurementStatus, Reason, Verdict, VerdictLevel
from uavgram.model.result.result import Result
from uavgram.model.result.tables import LineResults, MeasurementResults
from uavgram.views.formatting import NOT_COMPUTED, UNIT_WORDS, format_with_sigma, number

# The usual limit in surveying for a check.
THREE_SIGMA = 3.0

LEVEL_WORDS: dict[VerdictLevel | None, str] = {
    "green": "green, in order",
    "amber": "amber, check this first",
    "red": "red, do not use these numbers",
    None: "none, as nothing is measured",
}
MAX_NAMED = 3
MAX_VALUES = 3
"""Number of measurements up to which the headline gives their values, not their count."""

READING_ERROR_M = 0.1
"""Assumed error of a misread tape [m]: one digit of the decimetres, at least.

A length with a larger minimal detectable bias does not check its own reading.
"""

STATUS_WORDS: dict[MeasurementStatus, str] = {
    "ok": "ok",
    "not-checked": "not checked",
    "doubtful": "doubtful",
    "contradicted": "contradicted",
}


def status_text(rows: MeasurementResults, row: int) -> str:
    """Return how far a measurement can be trusted, or that it was not computed."""
    return STATUS_WORDS[rows.status[row]] if isfinite(rows.value[row]) else NOT_COMPUTED


class VerdictWords(NamedTuple):
    """Verdict for the top of a page.

    Attributes
    ----------
    level
        Its colour.
    sentence
        Summary: the colour, and the first reason.
    reasons
        All of them, the likeliest cause first; none if it is green.
    scale
        Source of the scale: no test shows an error common to all lengths.
    counts
        Number of the given data that were used.
    """

    level: VerdictLevel | None
    sentence: str
    reasons: tuple[Reason, ...]
    scale: str
    counts: str


def verdict_words(result: Result) -> VerdictWords:
    """Return the verdict with its sentences."""
    return VerdictWords(
        result.verdict.level,
        verdict_sentence(result),
        result.verdict.reasons,
        scale_sentence(result),
        counts_sentence(result),
    )


def verdict_sentence(result: Result) -> str:
    """Return colour, value, reason: ``Verdict: amber: D1 is 24.43 ± 0.79 m. Not checked: ...``."""
    level, reasons = result.verdict.level, result.verdict.reasons
    why = [reason_sentence(reason) for reason in reasons[:1]]
    known = f": {_known(result)}" if level in ("green", "amber") else "."
    if (more := len(reasons) - 1) > 0:
        why.append(f"(And {format_count(more, 'other reason')}.)")
    return " ".join([f"Verdict: {LEVEL_WORDS[level]}{known}", *why])


def reason_sentence(reason: Reason) -> str:
    """State error and remedy: in plain words if these exist, else the text of the message.

    Remedies that exclude each other are none: the text lists what may be wrong.
    """
    remedies = [one.words for one in (reason.mend, *reason.instead) if one is not None]
    if reason.cause == "nothing-checks" and reason.plain and not remedies:
        return reason.plain
    if not reason.plain or reason.mend is None:
        return reason.text
    todo = ", or ".join(f"{words[0].lower()}{words[1:]}" for words in remedies)
    aim = "check" if reason.cause == "nothing-checks" else "correct"
    return f"{reason.plain} To {aim} it: {todo}."


def summarise_result(result: Result) -> str:
    """Summarise the result beside the light: ``Check: 3 of 4 measurements are in order.``."""
    level = result.verdict.level
    if level is None:
        return "Nothing is measured yet"
    if level == "red":
        return "Do not use: it does not fit together"
    return f"{'Check' if level == 'amber' else 'In order'}: {_known(result)}"


def _known(result: Result) -> str:
    """Return the values of few measurements, or the number of those of each status."""
    rows, is_green = result.measurements, result.verdict.level == "green"
    count = len(rows.name)
    every = "both" if count == 2 else f"all {count}"
    if count <= MAX_VALUES:
        checked = _checked(result, count)
        if count == 1:
            return f"{_value(rows, 0, is_green=True)}{f', and {checked}' if is_green else ''}."
        values = join_names([_value(rows, row, is_green=is_green) for row in range(count)])
        return f"{values}{f'; {every} fit and {checked}' if is_green else ''}."
    if is_green:
        return f"{every} measurements fit and {_checked(result, count)}."
    if all(status == "ok" for status in rows.status):
        return f"{every} measurements are in order, something else is not."
    names: dict[str, list[str]] = {}
    for row, name in enumerate(rows.name):
        names.setdefault(status_text(rows, row), []).append(name)
    if list(names) == [STATUS_WORDS["not-checked"]]:
        return f"none of the {count} measurements is checked."
    parts = []
    for words, some in sorted(names.items(), key=lambda one: -len(one[1])):
        which = "" if words == STATUS_WORDS["ok"] else f" ({join_names(some, MAX_NAMED)})"
        parts.append(f"{len(some)} {'is' if len(some) == 1 else 'are'} {words}{which}")
    return f"of {count} measurements, {join_names(parts, None)}."


def _value(rows: MeasurementResults, row: int, *, is_green: bool) -> str:
    """Return ``D1 is 24.43 ± 0.79 m (not checked)``; the status only where not all is in order."""
    status = status_text(rows, row)
    if status == NOT_COMPUTED:
        return f"{rows.name[row]} is {NOT_COMPUTED}"
    value = format_with_sigma(rows.value[row], rows.sigma[row], rows.unit[row])
    return f"{rows.name[row]} is {value}{'' if is_green else f' ({status})'}"


def _checked(result: Result, count: int) -> str:
    """State that measurements are checked, and whether only against large mistakes."""
    is_rough = any(mask.any() for mask in classify_readings(result.lines))
    return f"{'is' if count == 1 else 'are'} checked{' for large mistakes' if is_rough else ''}"


STEPPED_M = 10.0
"""Height of cameras [m] above which it is rounded to metres, and below to decimetres."""


def describe_height(result: Result, units: Units) -> str:
    """Return a question on the height of the cameras; empty where nothing determines it.

    A person who was there notices by it lengths that were entered in another unit.
    """
    words = _height_words(result, units)
    return f"Cameras about {words} above the ground: is that right?" if words else ""


def _height_words(result: Result, units: Units = METRIC) -> str:
    """Return the height of the cameras, rounded: ``58 m``; empty where nothing determines it."""
    frames, points = result.frames, result.points
    used = np.array(frames.status, dtype=str) == "refined"
    ground_m = points.position_world_m[:, 2] - points.height_above_ground_m
    if not used.any() or not ground_m.size or result.verdict.level is None:
        return ""
    height_m = np.median(frames.refined.center_world_m[used, 2]) - np.median(ground_m)
    unit, one_m = ("m", 1.0) if units.length == "m" else ("feet", FOOT_M)
    return f"{height_m / one_m:.{0 if height_m > STEPPED_M else 1}f} {unit}"


class CheckedReadings(NamedTuple):
    """Masks (L,) of used lengths that may be misread by a decimetre without notice.

    Attributes
    ----------
    roughly
        Only a larger mistake would be noticed.
    never
        No mistake would.
    """

    roughly: Bools
    never: Bools


def classify_readings(lines: LineResults) -> CheckedReadings:
    """Find the lengths whose readings are checked roughly, or not at all."""
    weak = (np.array(lines.status, dtype=str) == "used") & ~(lines.mdb_m <= READING_ERROR_M)
    is_bounded = lines.mdb_m < lines.length_m
    return CheckedReadings(weak & is_bounded, weak & ~is_bounded)


def describe_undetectable(result: Result) -> str:
    """Return sentences on misread tapes that would go unnoticed; empty where every one shows."""
    lines, (roughly, hidden) = result.lines, classify_readings(result.lines)
    sentences = []
    if roughly.any():
        sigmas = np.zeros(len(roughly))
        if result.evidence is not None:
            sigmas = np.nan_to_num(result.evidence.lines.sigmas)
        first, *_ = order = sorted(np.flatnonzero(roughly).tolist(), key=lambda i: -sigmas[i])
        sizes = [f"{lines.mdb_m[i]:.2f} m at {lines.name[i]}" for i in order]
        sentences.append(
            "Only large mistakes would be noticed: a tape misread by less than "
            f"{join_names(sizes, MAX_NAMED, link='or')} would not."
        )
        if moved := describe_shift(result, first):
            sentences.append(f"At {lines.name[first]} that would make {moved}.")
    if hidden.any():
        sentences.append(
            f"Nothing checks how the tape was read at {_name_lengths(lines, hidden)}; a "
            "measurement that depends on it is shown as not checked."
        )
    return (
        " ".join([*sentences, "To check more, tape one more length nearby."]) if sentences else ""
    )


def describe_shift(result: Result, line: int) -> str:
    """Describe what the largest unnoticed mistake in a length does: ``D1 wrong by up to 0.3 m``."""
    evidence, rows = result.evidence, result.measurements
    if evidence is None or not evidence.lines.on[line]:
        return ""
    name = evidence.lines.on[line]
    unit = rows.unit[rows.name.index(name)]
    change = number(abs(float(evidence.lines.change[line])), 2)
    return f"{name} wrong by up to {change} {UNIT_WORDS.get(unit, unit)}"


def _name_lengths(lines: LineResults, chosen: Bools) -> str:
    return join_names(np.array(lines.name)[chosen].tolist(), MAX_NAMED)


def list_named_picks(verdict: Verdict) -> frozenset[tuple[str, str]]:
    """Return photo and label of the picks that reasons name."""
    return frozenset(
        pick for reason in verdict.reasons for pick in product(reason.frames, reason.labels)
    )


def scale_sentence(result: Result) -> str:
    """Return the source of the scale, and the height of cameras that lengths alone determine.

    The text is empty if the source is unknown.
    """
    basis = next((m.text for m in result.messages if m.code == "scale-basis"), "")
    height = _height_words(result)
    if not basis or not height or result.world.gauge != "plane":
        return basis
    return (
        f"{basis} By your lengths, the cameras were about {height} above the ground; if they were "
        "not, the lengths are wrong, or in another unit."
    )


def counts_sentence(result: Result) -> str:
    """Count the given data that were used."""
    status = np.array(result.frames.status, dtype=str)
    lines = np.array(result.lines.status, dtype=str)
    used = int(np.isin(lines, ("used", "suspect")).sum())
    withheld = int((lines == "checked").sum())
    checks = f" ({withheld} withheld as a check)" if withheld else ""
    computed = int(np.isfinite(result.measurements.value).sum())
    taking = sum(state in ("used", "suspect") for state in result.known.status)
    known = f"{taking} of {len(result.known.name)} other known things used, "
    return (
        f"{int((status == 'refined').sum())} of {len(status)} photos used, "
        f"{used} of {len(lines)} known lengths used{checks}, {known if result.known.name else ''}"
        f"{computed} of {len(result.measurements.name)} measurements computed."
    )

"""The first sentence that a reader sees: is it good, and if not, what to look at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.result.result import Result
from uavgram.views.wording import KNOWN_WORDS, UNIT_WORDS, number

# The usual limits of the trade: three sigma for a check, one in a thousand for a chance event.
THREE_SIGMA = 3.0
RARE = 0.001
MOST_NAMES = 5


@dataclass(frozen=True)
class Verdict:
    """One sentence and its reasons.

    Attributes
    ----------
    level
        ``good``, or ``look`` (something deserves a second look).
    sentence
        For the top of the page.
    reasons
        What to look at, worst first; empty where all is good.
    counts
        How much of what was given was used, in one sentence.
    """

    level: Literal["good", "look"]
    sentence: str
    reasons: tuple[str, ...]
    counts: str


def judge(result: Result) -> Verdict:
    """Sum up a result for someone who has ten seconds."""
    reasons = (
        *_convergence(result),
        *_not_unique(result),
        *_log(result),
        *_bad_lines(result),
        *_bad_known(result),
        *_checks(result),
        *_picks(result),
        *_frames(result),
        *_measurements(result),
        *_agreement(result),
        *_unseen_lines(result),
    )
    counts = _counts(result)
    if reasons:
        return Verdict("look", f"Look at this first: {reasons[0]}", reasons, counts)
    warnings = [message.text for message in result.messages if message.level == "warning"]
    if not warnings:
        return Verdict("good", "Good: everything fits together.", (), counts)
    sentence = f"Good: everything fits together; {_count(len(warnings), 'warning')} to read."
    return Verdict("good", sentence, (), f"{counts} Warned: {_first_sentence(warnings[0])}")


def _first_sentence(text: str) -> str:
    """As much of a message as fits below a heading."""
    end = text.find(". ")
    return text if end < 0 else text[: end + 1]


def _counts(result: Result) -> str:
    status = np.array(result.frames.status, dtype=str)
    lines = np.array(result.lines.status, dtype=str)
    used = int(np.isin(lines, ("used", "suspect")).sum())
    withheld = int((lines == "checked").sum())
    checks = f" ({withheld} withheld as a check)" if withheld else ""
    computed = int(np.isfinite(result.measurements.value).sum())
    taking = sum(state in ("used", "suspect") for state in result.known.status)
    known = f"{taking} of {len(result.known.name)} other known things used, "
    return (
        f"{int((status == 'refined').sum())} of {len(status)} frames refined, "
        f"{used} of {len(lines)} known lengths used{checks}, {known if result.known.name else ''}"
        f"{computed} of {len(result.measurements.name)} measurements computed."
    )


def _convergence(result: Result) -> list[str]:
    if result.solution.converged:
        return []
    return ["The adjustment did not converge: no number below can be trusted."]


def _agreement(result: Result) -> list[str]:
    solution, reasons = result.solution, []
    if solution.degrees_of_freedom <= 0:
        reasons.append("Nothing is redundant: the result fits, but nothing checks it.")
    elif solution.chi2_probability < RARE:
        reasons.append(
            f"The observations disagree more than their sigmas allow (variance factor "
            f"{solution.variance_factor:.2f}; by chance less than once in a thousand times)."
        )
    if solution.alternatives and not result.measurements.is_ambiguous.any():
        reasons.append(
            f"{_count(len(solution.alternatives), 'other camera position')} explain the known "
            "lengths as well: one more length would decide."
        )
    return reasons


def _not_unique(result: Result) -> list[str]:
    """Measurements to which other solutions, which fit as well, give other values."""
    rows = result.measurements
    names = [rows.name[i] for i in np.flatnonzero(rows.is_ambiguous)]
    if not names:
        return []
    return [
        f"{_count(len(names), 'measurement')} not unique: other camera positions explain what is "
        f"known as well, but give other values: {_names(names)}. One more length would decide."
    ]


def _bad_lines(result: Result) -> list[str]:
    lines, reasons = result.lines, []
    for wanted, words in (("suspect", "disagrees with the rest"), ("removed", "was left out")):
        rows = [i for i, status in enumerate(lines.status) if status == wanted]
        rows.sort(key=lambda i: -abs(float(np.nan_to_num(lines.w[i]))))
        reasons += [
            f"Known length '{lines.name[i]}' {words} by {number(abs(lines.residual_m[i]), 3)} m: "
            "read the tape again."
            for i in rows[:MOST_NAMES]
        ]
    return reasons


def _bad_known(result: Result) -> list[str]:
    known, reasons = result.known, []
    said = (("suspect", "disagrees with the rest"), ("removed", "was left out, being off"))
    for wanted, words in said:
        rows = [i for i, status in enumerate(known.status) if status == wanted]
        rows.sort(key=lambda i: -abs(float(np.nan_to_num(known.w[i]))))
        reasons += [
            f"Known thing '{known.name[i]}' ({KNOWN_WORDS.get(known.kind[i], known.kind[i])}) "
            f"{words} by {number(abs(known.residual[i]), 3)} "
            f"{UNIT_WORDS.get(known.unit[i], known.unit[i])}: look at its value and its points."
            for i in rows[:MOST_NAMES]
        ]
    return reasons


def _log(result: Result) -> list[str]:
    """Where the flight log contradicts itself."""
    codes = ("log-position-", "log-attitude-", "log-receiver-")
    faults = [m.text for m in result.messages if m.code.startswith(codes)]
    return [_first_sentence(text).strip() for text in faults[:MOST_NAMES]]


def _unseen_lines(result: Result) -> list[str]:
    lines = zip(result.lines.name, result.lines.status, strict=True)
    unseen = [name for name, status in lines if status == "unseen"]
    known = zip(result.known.name, result.known.status, strict=True)
    without = [name for name, status in known if status == "unseen"]
    reasons = [f"Known length never picked, so not used: {_names(unseen)}."] if unseen else []
    if without:
        reasons.append(f"Known thing with a point never picked, so not used: {_names(without)}.")
    return reasons


def _picks(result: Result) -> list[str]:
    picks, reasons = result.picks, []
    for wanted, words in (("suspect", "suspect"), ("removed", "removed")):
        which = [
            f"'{label}' in {image}"
            for label, image, status in zip(picks.label, picks.image, picks.status, strict=True)
            if status == wanted
        ]
        if which:
            reasons.append(f"{_count(len(which), 'pick')} {words}: {_names(which)}.")
    return reasons


def _checks(result: Result) -> list[str]:
    lines, points = result.line_checks, result.point_checks
    bad = [n for n, z in zip(lines.name, lines.z, strict=True) if abs(z) > THREE_SIGMA]
    z = np.abs(points.error_m) / points.sigma_m if len(points.label) else np.zeros((0, 3))
    outside = np.flatnonzero(z.max(axis=1, initial=0.0) > THREE_SIGMA)
    bad += [points.label[i] for i in outside]
    judged = zip(result.known.name, result.known.status, result.known.w.tolist(), strict=True)
    bad += [name for name, status, w in judged if status == "checked" and abs(w) > THREE_SIGMA]
    return [f"Checks outside three sigma: {_names(bad)}."] if bad else []


def _measurements(result: Result) -> list[str]:
    rows = result.measurements
    missing = [n for n, value in zip(rows.name, rows.value, strict=True) if not np.isfinite(value)]
    return [f"Not computed: {_names(missing)} (see the messages)."] if missing else []


def _frames(result: Result) -> list[str]:
    reasons = []
    logged = result.shared.position_bias_m is not None
    lost = "not found in the flight log" if logged else "without picks, so without a pose"
    for wanted, words in (("rejected", "rejected"), ("unmatched", lost)):
        names = [
            f
            for f, status in zip(result.frames.frame_id, result.frames.status, strict=True)
            if status == wanted
        ]
        if names:
            reasons.append(f"{_count(len(names), 'frame')} {words}: {_names(names)}.")
    return reasons


def _count(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _names(names: list[str]) -> str:
    shown = ", ".join(names[:MOST_NAMES])
    more = len(names) - MOST_NAMES
    return f"{shown} and {more} more" if more > 0 else shown

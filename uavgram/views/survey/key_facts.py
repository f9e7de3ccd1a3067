"""Main facts of a result: accuracy in words, the state of each photo, the origin of the picks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Literal

import numpy as np

from uavgram.model.naming import format_count
from uavgram.model.observations import Source
from uavgram.model.result.result import Result
from uavgram.model.result.tables import SOURCES, count_picks_by_source, is_only_by_program
from uavgram.views.formatting import (
    FRAME_STATE_WORDS,
    SIGNED_KINDS,
    alternatives_text,
    axes_text,
    format_relative_sigma,
    format_with_sigma,
    number,
    order_worst_first,
    size_text,
)
from uavgram.views.survey.verdict import list_named_picks
from uavgram.views.units import format_sigma, units_of

FrameState = Literal["refined", "check", "seeded", "unmatched", "rejected"]


def frame_states(result: Result) -> tuple[FrameState, ...]:
    """Return the (F,) status of each frame; ``check`` if a refined frame deserves a second look.

    That is the case if one of its picks is suspect or was removed, if a reason of the verdict names
    it with a pick, or if the log contradicts its pose.
    """
    odd = {
        image
        for image, status in zip(result.picks.image, result.picks.status, strict=True)
        if status in ("suspect", "removed")
    }
    odd |= {image for image, _ in list_named_picks(result.verdict)}
    odd |= {name for m in result.messages if m.code == "telemetry-strained" for name in m.frames}
    return tuple(
        "check" if status == "refined" and name in odd else status
        for name, status in zip(result.frames.frame_id, result.frames.status, strict=True)
    )


def frame_counts(result: Result) -> str:
    """Count the frames: ``20 photos: 17 refined (1 to check), 1 rejected``, or none rejected."""
    status, states = Counter(result.frames.status), Counter(frame_states(result))
    check = f" ({states['check']} {FRAME_STATE_WORDS['check']})" if states["check"] else ""
    parts = [f"{status['refined']} refined{check}"]
    parts += [
        f"{status[one]} {FRAME_STATE_WORDS[one]}"
        for one in ("seeded", "unmatched", "rejected")
        if status[one]
    ]
    if not status["rejected"]:
        parts.append("none rejected")
    return f"{format_count(len(result.frames.frame_id), 'photo')}: {', '.join(parts)}"


def accuracy_words(result: Result) -> str:
    """State both accuracies: ``Distances between neighbouring points are known to about 1 cm``."""
    points, units = result.points, units_of(result)
    near = points.neighbour_sigma_m
    sentences = []
    if np.isfinite(near).any():
        one = format_sigma(float(np.nanmedian(near)), "m", units)
        sentences.append(f"Distances between neighbouring points are known to about ± {one}.")
    if not points.label:
        return ""
    if result.world.gauge == "plane":
        sentences.append(
            "This survey has no tie to the earth: north is arbitrary, lengths are valid."
        )
    else:
        sigma = np.sqrt(np.trace(points.covariance_m2, axis1=1, axis2=2) / 2)
        place = format_sigma(float(np.median(sigma)), "m", units)
        where = "on the earth"
        if result.world.origin is None:
            where = "relative to the control points and lines, which define east and north,"
        sentences.append(
            f"The position of the survey as a whole {where} is known to about ± {place} (east, "
            "north): an error in it shifts everything together, and changes no length, area or "
            "angle."
        )
    return " ".join(sentences)


Fact = tuple[str, str]


def key_facts(result: Result) -> tuple[Fact, ...]:
    """List photos, least certain length, known length of worst fit, and least certain point."""
    facts = [
        ("photos", frame_counts(result)),
        ("least certain length for its size", _least_certain(result)),
        ("known length that fits worst", _worst_fit(result)),
        _least_known_point(result),
    ]
    return tuple((question, answer) for question, answer in facts if answer)


def least_certain_length(result: Result) -> int | None:
    """Return the row of the measured length with the largest relative sigma."""
    rows = result.measurements
    for i in order_worst_first(rows):
        is_length = rows.unit[i] == "m" and rows.kind[i] not in SIGNED_KINDS
        if is_length and np.isfinite(rows.value[i]):
            return int(i)
    return None


def largest_ellipse(result: Result) -> int | None:
    """Return the row of the least certain point within the survey; None if there is no shape."""
    major = result.points.relative.ellipse_95_m[:, 0]
    return int(np.argmax(major)) if major.any() else None


def _least_certain(result: Result) -> str:
    row, rows = least_certain_length(result), result.measurements
    if row is None:
        return ""
    value, sigma, unit = float(rows.value[row]), float(rows.sigma[row]), rows.unit[row]
    units = units_of(result)
    why = alternatives_text(rows, row, units) or f"({format_relative_sigma(value, sigma, unit)})"
    return f"{rows.name[row]}: {format_with_sigma(value, sigma, unit, units)} {why}"


def _worst_fit(result: Result) -> str:
    lines = result.lines
    removed = np.array([status == "removed" for status in lines.status], dtype=np.bool_)
    # a length that was removed early has no test statistic, and may be off by metres
    alone = lines.residual_m / np.hypot(lines.sigma_m, np.nan_to_num(lines.adjusted_sigma_m))
    w = np.nan_to_num(np.abs(np.where(removed & np.isnan(lines.w), alone, lines.w)), nan=-1.0)
    if not len(w) or w.max() < 0:
        return ""
    row = int(np.argmax(w))
    return (
        f"{lines.name[row]}, {lines.start[row]} to {lines.end[row]}: "
        f"{number(float(lines.residual_m[row]), signed=True)} m off "
        f"({number(float(w[row]), 1)} sigma{', removed' if removed[row] else ''})"
    )


def _least_known_point(result: Result) -> Fact:
    points, units = result.points, units_of(result)
    if np.isfinite(points.neighbour_sigma_m).any():
        row = int(np.nanargmax(points.neighbour_sigma_m))
        sigma, around = float(points.neighbour_sigma_m[row]), points.neighbours[row]
        fact = f"{points.label[row]}: ± {size_text(sigma, units)} ({', '.join(around)})"
        return "point least known against its neighbours", fact
    widest = largest_ellipse(result)  # a single point has no neighbours
    axes = "" if widest is None else axes_text(points.relative.ellipse_95_m[widest], units)
    fact = f"{points.label[widest]}: {axes}" if widest is not None else ""
    return "largest 95 % ellipse within the survey (half axes)", fact


SOURCE_WORDS: dict[Source, str] = {"hand": "by hand", "match": "matched", "target": "target"}

ONLY_PROGRAM = "only the program's picks"
"""Note beside a value that depends on no pick of a person."""


def has_automatic_picks(result: Result) -> bool:
    """Return whether the program made any of the picks."""
    return not result.picks.by_hand.all()


def counts_text(counts: Mapping[Source, int]) -> str:
    """Count picks by source: ``1 by hand, 4 matched``; empty if a person made all."""
    if not set(counts) - {"hand"}:
        return ""
    return ", ".join(
        f"{counts[source]} {SOURCE_WORDS[source]}"
        + ("s" if source == "target" and counts[source] > 1 else "")
        for source in SOURCES
        if counts.get(source)
    )


def picks_text(result: Result) -> str:
    """Describe the origin of all picks in a sentence; empty if people alone made them."""
    told = counts_text(Counter(result.picks.source))
    return f"Picks: {told}." if told else ""


def point_origins(result: Result) -> tuple[str, ...]:
    """Return the (K,) origins of the picks of points; empty texts if a person made all of them."""
    made = count_picks_by_source(result.picks)
    return tuple(counts_text(made.get(label, {})) for label in result.points.label)


def frame_origins(result: Result) -> tuple[str, ...]:
    """Return the (F,) origins of the picks in photos; empty texts if a person made all of them."""
    made: dict[str, Counter[Source]] = {}
    for image, source in zip(result.picks.image, result.picks.source, strict=True):
        made.setdefault(image, Counter())[source] += 1
    return tuple(counts_text(made.get(name, {})) for name in result.frames.frame_id)


def format_frame_ties(result: Result) -> tuple[str, ...]:
    """Format (F,) the tie points of each photo, and rms of their residuals: ``131 (0.21 px)``."""
    frames = result.frames
    pairs = zip(frames.ties.tolist(), frames.ties_rms_px.tolist(), strict=True)
    return tuple(f"{count} ({number(rms, 2)} px)" if count else "0" for count, rms in pairs)


def note_automatic_values(result: Result) -> tuple[str, ...]:
    """Return (M,) the note on each value's picks; empty if a person made some."""
    rows = result.measurements
    alone = is_only_by_program(result.picks, rows.points) & np.isfinite(rows.value)
    return tuple(ONLY_PROGRAM if one else "" for one in alone.tolist())


def ties_text(result: Result) -> str:
    """Describe all tie points in a sentence; empty if none were used."""
    ties = result.ties
    if ties is None:
        return ""
    return (
        f"{ties.points} tie points found by the program connect the photos: seen "
        f"{ties.sightings} times, residuals {number(ties.rms_px, 2)} px (root mean square of one "
        "coordinate)."
    )

"""Lengths that were left out because they are wrong beyond doubt, in words."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.reliability.wrong_units import likely_mistake
from uavgram.estimation.survey.adjustment import Refined
from uavgram.estimation.survey.names import length_name
from uavgram.model.arrays import Floats, Ints
from uavgram.model.flight.photo_poses import PhotoExposures
from uavgram.model.message import Message
from uavgram.model.survey.observations import KnownLines


def judge_gross(
    refined: Refined, lines: KnownLines, survey_index: Ints, seen_m: Floats, sigma_m: Floats
) -> tuple[Message, ...]:
    """One message on each length that was left out; on those with the same mistake, one in all.

    Parameters
    ----------
    refined
        The adjusted survey.
    lines
        All L known lengths of the project.
    survey_index
        (L,) into the lines of the survey handed to refine; -1 for withheld and unseen ones.
    seen_m, sigma_m
        (L,) the lengths as adjusted, and their sigmas.
    """
    gross = {r.index for r in refined.removals if r.kind == "line" and r.before is None}
    out = [i for i, index in enumerate(survey_index) if int(index) in gross]
    what = {i: mistake(lines, i, seen_m[i], sigma_m[i]) for i in out}
    alike = {i: what[i] or i for i in out}  # unknown mistakes: each alone
    groups = [[i for i in out if alike[i] == key] for key in dict.fromkeys(alike.values())]
    return tuple(
        Message(
            "warning",
            "line-left-out",
            _text(refined, lines, group, what[group[0]], (seen_m, sigma_m)),
            lengths=tuple(lines.name[i] for i in group),
        )
        for group in groups
    )


def mistake(lines: KnownLines, i: int, seen_m: float, sigma_m: float) -> str:
    """What was probably mistaken in a length that should be `seen_m`; empty where nothing fits."""
    if not seen_m > 0:
        return ""
    ratio = lines.length_m[i] / seen_m
    return likely_mistake(ratio, float(np.hypot(sigma_m, lines.sigma_m[i] / ratio)) / seen_m)


def _text(
    refined: Refined,
    lines: KnownLines,
    found: list[int],
    what: str,
    adjusted: tuple[Floats, Floats],
) -> str:
    ask = f": {what}?" if what else ""
    taped = [f"{lines.length_m[i]:.10g} m taped" for i in found]
    seen = [f"{adjusted[0][i]:.4g} m (sigma {adjusted[1][i]:.2g} m)" for i in found]
    if len(found) == 1:
        name, start, end = (each[found[0]] for each in (lines.name, lines.start, lines.end))
        opening = (
            f"The {length_name(name, start, end)} was left out: {taped[0]}, but "
            f"{_against(refined)} say {seen[0]}{ask or '.'}"
        )
    else:
        names = [lines.name[i] for i in found]
        each = zip(names, taped, seen, strict=True)
        listed = "; ".join(f"{name!r} {given}, {is_} seen" for name, given, is_ in each)
        opening = (
            f"{len(found)} lengths were left out, wrong in one way by what {_against(refined)} "
            f"say{ask} {listed}."
        )
    return (
        f"{opening} With so gross an error, nothing else would fit. Look at reading and unit, and "
        "at the labels of the ends."
    )


def _against(refined: Refined) -> str:
    """What speaks against a length."""
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

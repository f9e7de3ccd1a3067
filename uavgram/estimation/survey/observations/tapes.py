"""Known lengths as a tape reads them: what all lengths of one tape have in common is its scale.

**Sign.** A tape of scale s reads a true length l as ``l / (1 + s)``. One that is 1 % too long (a
mark that says 1.00 m stands at 1.01 m) has s = +0.01 and reads short.

Only tapes whose lengths take part have an unknown; the scale of another one is as far from 0 as
its prior says.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.survey.observations import KnownLines
from uavgram.model.survey.survey import Survey


class Taped(NamedTuple):
    """n lengths to read: labels of their ends (n,), names of their tapes, whether level (n,)."""

    start: Ints
    end: Ints
    tape: tuple[str, ...]
    level: Bools


def taped_lines(survey: Survey, line: Ints) -> Taped:
    """Some of the known lengths of a survey, by row."""
    return Taped(
        survey.line_start[line],
        survey.line_end[line],
        tuple(survey.line_tape[i] for i in line) if survey.line_tape else ("",) * len(line),
        _level(survey.line_along, line),
    )


def taped_known(lines: KnownLines, row: Ints, start: Ints, end: Ints) -> Taped:
    """Some of the known lengths of a project.

    Parameters
    ----------
    lines
        All of them.
    row
        (n,) which.
    start, end
        (n,) the labels of their ends among those of a survey.
    """
    return Taped(start, end, tuple(lines.tape_of(i) for i in row), _level(lines.along, row))


def _level(along: tuple[str, ...], row: Ints) -> Bools:
    return np.array([bool(along) and along[i] == "horizontal" for i in row], dtype=np.bool_)


def tapes_of(survey: Survey, line: Ints) -> tuple[str, ...]:
    """Tapes whose scale is an unknown where these known lengths take part, in their order."""
    names = dict.fromkeys(taped_lines(survey, line).tape)
    return tuple(name for name in names if survey.scale_sigma_of(name) > 0)


def tape_rows(known: tuple[str, ...], tape: tuple[str, ...]) -> Ints:
    """(n,) place of each of n tapes among the known ones; -1 for those that are not."""
    place = {name: k for k, name in enumerate(known)}
    return np.array([place.get(name, -1) for name in tape], dtype=np.int64)


def unlearnt(
    known: tuple[str, ...], taped: Taped, reading_m: Floats, sigma_of: Callable[[str], float]
) -> Floats:
    """(n, U) errors of readings by one sigma of each tape that no adjusted length was read on.

    Parameters
    ----------
    known
        Tapes of the adjustment.
    taped, reading_m
        n lengths, and what a right tape reads.
    sigma_of
        Prior of the scale of a tape; 0 where it is exact.
    """
    others = [name for name in dict.fromkeys(taped.tape) if name not in known]
    own = np.array([[name == tape for name in others] for tape in taped.tape], dtype=np.float64)
    sigma = np.array([sigma_of(name) for name in others])
    return -sigma * reading_m[:, None] * own.reshape(len(taped.tape), len(others))

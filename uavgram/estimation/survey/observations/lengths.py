"""Known lengths, and the scales of the tapes that they were read on.

**Sign.** A tape of scale s reads a true length l as ``l / (1 + s)``. A tape that is 1 % too long
(its mark of 1.00 m is at 1.01 m) has s = +0.01 and reads short.

Only tapes whose lengths take part have an unknown; the scale of another tape deviates from 0 by its
prior sigma.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observations.observation import (
    ErrorSource,
    Kind,
    Member,
    Misfit,
    Observation,
    Subjects,
)
from uavgram.estimation.survey.observations.priors import make_independent_prior
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Remedy, propose_length_removal
from uavgram.model.naming import format_digits, format_misfit
from uavgram.model.observations import KnownLines
from uavgram.model.survey import Survey

TAPED = ErrorSource(
    "known lengths",
    "how exactly the known lengths were taped",
    "More, longer or better taped lengths would help there.",
)
TAPE_SCALE = ErrorSource(
    "tape",
    "how well the scale of the tape is known, which all its lengths share",
    "A tape that was compared with a better one would help there (`tape.scale_sigma`).",
)


class TapedLengths(NamedTuple):
    """Tape readings of n lengths: labels of their ends (n,), tapes, whether horizontal (n,)."""

    start: Ints
    end: Ints
    tape: tuple[str, ...]
    level: Bools


def select_taped_lines(survey: Survey, line: Ints) -> TapedLengths:
    """Return some of the known lengths of a survey, by row."""
    return TapedLengths(
        survey.line_start[line],
        survey.line_end[line],
        tuple(survey.line_tape[i] for i in line) if survey.line_tape else ("",) * len(line),
        _level(survey.line_along, line),
    )


def select_taped_known(lines: KnownLines, row: Ints, start: Ints, end: Ints) -> TapedLengths:
    """Return some of the known lengths of a project.

    Parameters
    ----------
    lines
        All known lengths.
    row
        (n,) rows of those to return.
    start, end
        (n,) the labels of their ends among those of a survey.
    """
    return TapedLengths(start, end, tuple(lines.tape[i] for i in row), _level(lines.along, row))


def _level(along: tuple[str, ...], row: Ints) -> Bools:
    return np.array([bool(along) and along[i] == "horizontal" for i in row], dtype=np.bool_)


def list_tapes(survey: Survey, line: Ints) -> tuple[str, ...]:
    """Return the tapes with an unknown scale if these known lengths take part, in their order."""
    names = dict.fromkeys(select_taped_lines(survey, line).tape)
    return tuple(name for name in names if survey.scale_sigma_of(name) > 0)


def find_tape_rows(known: tuple[str, ...], tape: tuple[str, ...]) -> Ints:
    """Return the (n,) positions of n tapes among the known ones; -1 for others."""
    place = {name: k for k, name in enumerate(known)}
    return np.array([place.get(name, -1) for name in tape], dtype=np.int64)


def compute_unlearnt(
    known: tuple[str, ...], taped: TapedLengths, reading_m: Floats, sigma_of: Callable[[str], float]
) -> Floats:
    """Compute (n, U) errors of readings by one sigma of each tape without an adjusted length.

    Parameters
    ----------
    known
        Tapes of the adjustment.
    taped, reading_m
        n lengths, and the readings of a correct tape.
    sigma_of
        Function that returns the prior sigma of the scale of a tape; 0 if it is exact.
    """
    others = [name for name in dict.fromkeys(taped.tape) if name not in known]
    own = np.array([[name == tape for name in others] for tape in taped.tape], dtype=np.float64)
    sigma = np.array([sigma_of(name) for name in others])
    return -sigma * reading_m[:, None] * own.reshape(len(taped.tape), len(others))


class Lengths(Observation):
    """Known lengths, as their tapes read them."""

    kind = Kind(
        "lengths",
        TAPED,
        "known lengths",
        role="reading",
        rank=1,
        plural="known lengths",
        check="their readings and stated errors",
        misfit_code="line-suspect",
        advice="Look at the readings, at their ends and at their picks.",
        is_core=True,
        has_table=True,
    )

    def is_part(self) -> bool:
        """Return whether a length takes part."""
        return bool(len(self.problem.line_index))

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw readings between points that took part; each tape has a scale of its own."""
        lines, own = stated.lines, dict(stated.own_scale_sigma)
        names = range(len(lines.name))
        kept = [i for i in names if {lines.start[i], lines.end[i]} <= truth.row.keys()]
        again = lines.take(kept)
        start = [truth.row[name] for name in again.start]
        end = [truth.row[name] for name in again.end]
        leg = truth.place_m[end] - truth.place_m[start]
        leg[[again.along_of(i) == "horizontal" for i in range(len(kept))], 2] = 0.0
        tape = again.tape
        scale = {
            name: own.get(name, stated.tape.scale_sigma) * float(truth.rng.standard_normal())
            for name in dict.fromkeys(tape)
        }
        true = np.linalg.norm(leg, axis=1) * (1.0 + np.array([scale[name] for name in tape]))
        noise = again.sigma_m * truth.rng.standard_normal(len(kept))
        return replace(stated, lines=replace(again, length_m=true + noise))

    @cached_property
    def _taped(self) -> tuple[TapedLengths, Ints]:
        """Lengths that take part, and the unknowns of each."""
        taped = select_taped_lines(self.problem.survey, self.problem.line_index)
        return taped, self.problem.columns_of_readings(taped)

    def rows(self, state: State) -> Block | None:
        """Compare the predicted readings with the actual ones."""
        survey, (taped, columns) = self.problem.survey, self._taped
        reading, jacobian = self.problem.read(state, taped)
        sigma = survey.length_sigma_m[self.problem.line_index]
        residual = (reading - survey.length_m[self.problem.line_index]) / sigma
        return Block(residual[..., None], columns, jacobian[..., None, :] / sigma[:, None, None])

    def sigma(self, found: Minimum[State]) -> Floats:
        """Return the (L, 1) standard deviations of the readings [m]."""
        del found
        return self.problem.survey.length_sigma_m[self.problem.line_index, None]

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield the derivatives of each length by the heights of its ends."""
        taped, problem, state = self._taped[0], self.problem, found.state
        world, _, _ = problem.world_points(state, np.arange(problem.layout.points))
        along = world[taped.end] - world[taped.start]
        reading, _ = problem.read(state, taped)
        # d reading / d up = up / length, over 1 + scale = length / reading
        slope = along[:, 2] * reading / np.sum(along**2, axis=1)
        slope = np.where(taped.level, 0.0, slope)
        slope = slope / problem.survey.length_sigma_m[problem.line_index]
        yield taped.end, slope[:, None]
        yield taped.start, -slope[:, None]

    def describe(self, row: int) -> str:
        """Return ``'L2' ('R3' to 'R4')``."""
        survey, line = self.problem.survey, self.problem.line_index[row]
        start, end = survey.label[survey.line_start[line]], survey.label[survey.line_end[line]]
        return describe_ends(survey.line_name[line] if survey.line_name else "", start, end)

    def title(self, member: Member) -> str:
        """Return ``length 'L2' ('R3' to 'R4')``."""
        return f"length {self.describe(member.row)}"

    def subjects(self, row: int) -> Subjects:
        """Return its name and the labels of its ends."""
        survey, line = self.problem.survey, self.problem.line_index[row]
        ends = survey.line_start[line], survey.line_end[line]
        name = survey.line_name[line : line + 1]
        return {"lengths": tuple(name), "labels": tuple(survey.label[k] for k in ends)}

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a length that does not fit."""
        survey, line = self.problem.survey, self.problem.line_index[found.member.row]
        taped = survey.length_m[line]
        # Without the length the rest shows its reading plus the estimated error w sigma / sqrt(r).
        error = abs(found.w) * survey.length_sigma_m[line] / np.sqrt(found.redundancy)
        rest = taped + np.copysign(error, found.off[0])
        what = self.describe(found.member.row)
        how = f"taped {taped:.3f} m, the rest shows {rest:.3f} m ({format_misfit(found.w)})"
        return (
            f"The length {what} does not fit: {how}. Look at the reading, at its ends and at their "
            f"picks.",
            f"{what} {how}",
        )

    def remedy(self, row: int) -> Remedy | None:
        """Return the removal of the length."""
        survey, line = self.problem.survey, self.problem.line_index[row]
        return propose_length_removal([survey.line_name[line] if survey.line_name else ""])


class TapeScales(Observation):
    """Priors of the scales of tapes."""

    kind = Kind("tape", TAPE_SCALE, "scale of the tape", units=("%",))

    def is_part(self) -> bool:
        """Return whether a scale is an unknown."""
        return bool(self.problem.tapes)

    def rows(self, state: State) -> Block | None:
        """Compare the scales with 0."""
        tapes = self.problem.tapes
        sigma = np.array([self.problem.survey.scale_sigma_of(tape) for tape in tapes])
        return make_independent_prior(state.tape, sigma, self.problem.layout.first_tape)

    def describe(self, row: int) -> str:
        """Return ``the tape``, or ``the tape 'red'``."""
        name = self.problem.tapes[row]
        return f"the tape {name!r}" if name else "the tape"

    def axis(self, member: Member) -> str:
        """Return ``scale of the tape 'red'``."""
        return f"scale of {self.describe(member.row)}"

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a tape that is longer or shorter than stated."""
        # Without its prior the scale would be the estimate divided by the prior's redundancy.
        free = found.off[0] / found.redundancy
        what = self.describe(found.member.row)
        size, side = f"{format_digits(100.0 * abs(free))} %", "long" if free > 0 else "short"
        return (
            f"By all other readings, {what} seems to be {size} too {side}: compare it with "
            f"another one, or state how good it is (`tape.scale_sigma`). This is "
            f"{format_misfit(found.w)}.",
            f"{what} seems to be {size} too {side} ({format_misfit(found.w)})",
        )


def describe_ends(name: str, start: str, end: str) -> str:
    """Return a length as ``'L2' ('R3' to 'R4')``; only its ends if it has no name.

    Parameters
    ----------
    name
        Name of the length; may be empty.
    start, end
        Labels of its ends.
    """
    return f"{name!r} ({start!r} to {end!r})" if name else f"{start!r} to {end!r}"

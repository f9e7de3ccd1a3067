"""What could be wrong with a survey, and how its cost compares with that of others.

Each hypothesis is either a change of what people wrote (a `Mend`, tested by adjusting anew) or an
error that all observations of a kind have in common (`Moved`, tested in the linear model).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import CHECKED, Explained, Moved
from uavgram.estimation.survey.adjustment import Adjustment, LeftOutCause, Refined
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Bools, Floats
from uavgram.model.message import Message
from uavgram.model.survey.mend import Mend
from uavgram.model.survey.observations import Along
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.doubt import LOST
from uavgram.stages.refine.minima import Participants

PRICE = 6.0
"""Logarithm of the odds that an observed number that may have any value is where it is: of the
range of values that gross errors take over the sigma of the number."""

SPOILT = (LeftOutCause.MISPLACED_FRAME, LeftOutCause.GROSS)
"""Why picks are left out that somebody should look at."""


class Standing(NamedTuple):
    """An adjusted survey whose misfits are to be explained.

    Attributes
    ----------
    taking
        What takes part, and what was left out.
    refined
        Its adjustment.
    """

    taking: Participants
    refined: Refined

    @property
    def survey(self) -> Survey:
        """All observations, as they are taken now."""
        return self.taking.survey

    @property
    def adjustment(self) -> Adjustment:
        """The adjustment."""
        return self.refined.adjustment

    @property
    def spoilt(self) -> Bools:
        """(P,) picks that were left out because they contradict the rest."""
        out = np.zeros(len(self.survey.pick_frame), dtype=np.bool_)
        for index, why in self.refined.pick_reason.items():
            out[index] = why.cause in SPOILT
        return out

    @property
    def cost(self) -> float:
        """Weighted sum of squares, with what was left out, and lost, at its price."""
        used = np.zeros(len(self.taking.keep), dtype=np.bool_)
        used[self.refined.pick_index] = True
        lost = int((self.taking.keep & ~used & ~self.spoilt).sum())
        return self.adjustment.minimum.cost + 2.0 * PRICE * self.left_out + LOST * lost

    @property
    def left_out(self) -> int:
        """Numbers that were left out because they contradict the rest."""
        return int(2 * self.spoilt.sum() + self.refined.line_removed.sum())


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Something that could be wrong.

    Attributes
    ----------
    tell
        The message, of what the linear test found (None where there is none); None where it is no
        cause of its own to tell of, but what others are compared with: a single wrong pick or
        length, of which the tests of the residuals speak.
    mend
        What people should change; None where there is nothing of that kind.
    remedy
        What is to be done on request, where that is not what it is tested by; None: the mend.
    is_clear
        Whether nothing else would explain the same: else it is told, and not mended on request.
    back
        Picks that it leaves as they are, and that take part again where they had been left out.
    is_of_all
        Whether the whole survey begins elsewhere with it: it is adjusted from first values.
    begun
        The state that its adjustment begins from, of the present one; None: the present one.
    freed
        The survey with less prior knowledge, by which it is adjusted from then on: no reading is
        changed by it. Where neither is there, only the linear test judges it.
    moved
        How its unknowns move the observations in the linear model; none where nothing is known.
    amount
        Value of its only unknown, where that is known; None: any.
    checked
        Share of its directions that has to show in the residuals (see `explained`).
    settled
        Its unknowns (q,) and their covariance (q, q) in the survey that was freed and adjusted,
        for `tell`; left out, those of the linear test are told.
    price
        Logarithm of the number of its kind that are possible, and of the range of its unknowns
        over what is known of them afterwards (see `PRICE`).
    promise
        Fall of the sum of squares to be expected, where `moved` does not tell, or tells less
        because it is linear.
    settles
        Lengths and frames, by name, of which it explains that they did not fit.
    """

    tell: Callable[[Explained | None], Message] | None
    mend: Mend | None = None
    remedy: Mend | None = None
    is_clear: bool = True
    back: frozenset[int] = frozenset()
    is_of_all: bool = False
    begun: Callable[[State], State] | None = None
    freed: Callable[[Survey], Survey] | None = None
    moved: tuple[Moved, ...] = ()
    amount: float | None = None
    checked: float = CHECKED
    settled: Callable[[Adjustment], tuple[Floats, Floats]] | None = None
    price: float = 0.0
    promise: float = 0.0
    settles: frozenset[str] = frozenset()


def mended(
    standing: Standing, mend: Mend, back: frozenset[int] = frozenset(), *, lines_back: bool = False
) -> Participants:
    """What takes part once a survey is mended.

    Picks and lengths that the mend changes take part again where they had been left out, and so do
    lengths that end where all picks get another label.

    Parameters
    ----------
    standing
        Where it stands.
    mend
        By index into its survey.
    back
        Picks that take part again as they are.
    lines_back
        Whether lengths that were left out take part again.
    """
    taking, refined = standing.taking, standing.refined
    survey = mended_survey(standing.survey, mend)
    used = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    used[refined.pick_index] = True
    used[list(mend.picks | back)] = True
    used[list(mend.without_picks)] = False
    removed = refined.line_removed & (not lines_back)
    removed[lines_touched(standing.survey, mend)] = False
    removed[list(mend.without_lines)] = True
    reason = {
        i: why
        for i, why in refined.pick_reason.items()
        if not used[i] and i not in mend.without_picks
    }
    return Participants(survey, used & taking_part(taking), removed, reason, taking.known_removed)


def lines_touched(survey: Survey, mend: Mend) -> Bools:
    """(L,) lengths that a mend changes, or that end where it changes the labels of all picks."""
    relabelled = np.zeros(len(survey.pick_label), dtype=np.bool_)
    relabelled[list(mend.label_of_pick)] = True
    changed = np.setdiff1d(survey.pick_label[relabelled], survey.pick_label[~relabelled])
    touched: Bools = np.isin(survey.line_start, changed) | np.isin(survey.line_end, changed)
    touched[list(mend.lines)] = True
    return touched


def taking_part(taking: Participants) -> Bools:
    """(P,) picks that may take part at all: those within the lens."""
    may = np.ones(len(taking.keep), dtype=np.bool_)
    beyond = [i for i, why in taking.reason.items() if why.cause is LeftOutCause.BEYOND_LENS]
    may[beyond] = False
    return may


def mended_survey(survey: Survey, mend: Mend) -> Survey:
    """The observations as they are once mended; nothing is taken out.

    Parameters
    ----------
    survey
        All observations.
    mend
        By index into it.
    """
    label, pixel = survey.pick_label.copy(), survey.pixel_px.copy()
    start, end = survey.line_start.copy(), survey.line_end.copy()
    length, free = survey.length_m.copy(), survey.is_free.copy()
    for pick, right in mend.label_of_pick.items():
        label[pick] = right
    for pick, place in mend.pixel_of_pick.items():
        pixel[pick] = place
    for line, value in mend.length_m.items():
        length[line] = value
    for line, ends in mend.ends.items():
        start[line], end[line] = ends
    for of, height in mend.free.items():
        free[of] = height
    along: tuple[Along, ...] = survey.line_along
    if mend.level:
        written: list[Along] = [*along] or ["slope"] * len(start)
        for line in mend.level:
            written[line] = "horizontal"
        along = tuple(written)
    return replace(
        survey,
        pick_label=label,
        pixel_px=pixel,
        line_start=start,
        line_end=end,
        length_m=length,
        is_free=free,
        line_along=along,
    )

"""Apply corrections to a survey, and record each change from old to new values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uavgram.estimation.survey.adjustment import Refined, Removal
from uavgram.estimation.survey.observations.lengths import named_ends
from uavgram.estimation.survey.observations.observation import Member, Suspicion
from uavgram.model.arrays import Bools
from uavgram.model.survey.corrections import Cause, SurveyCorrection
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.causes.hypothesis import mended_survey

MOST_LISTED = 4
"""Changes of a correction that are listed; the cause's message names the rest."""


class Adapted(NamedTuple):
    """Corrected survey.

    Attributes
    ----------
    survey
        The survey with the corrections.
    without
        (P,) picks that were removed.
    removals
        A record of each correction.
    """

    survey: Survey
    without: Bools
    removals: tuple[Removal, ...]


def adapted(survey: Survey, causes: Sequence[Cause], before: Refined) -> Adapted:
    """Apply all possible corrections of certain causes.

    Parameters
    ----------
    survey
        The survey before the corrections.
    causes
        Causes of its misfits, in the order in which they were found.
    before
        Its adjustment.
    """
    without = np.zeros(len(survey.pick_frame), dtype=np.bool_)
    removals = []
    for cause in causes:
        if cause.mend is None:
            continue
        is_now = mended_survey(survey, cause.mend)
        without[list(cause.mend.without_picks)] = True
        size = float(np.sqrt(max(cause.gain, 0.0)))
        removals.append(
            Removal(
                kind="mend",
                index=-1,
                suspicion=Suspicion(Member("mend", -1, 0), size, (), ()),
                before=before,
                cause=cause,
                mended=(_words(survey, cause.mend), _words(is_now, cause.mend)),
            )
        )
        survey = is_now
    return Adapted(survey, without, tuple(removals))


def _words(survey: Survey, mend: SurveyCorrection) -> str:
    """Describe a survey's values of all items that a correction changes."""
    label, frame = survey.label, survey.frame_id
    parts = [
        f"{label[survey.pick_label[pick]]!r} in {frame[survey.pick_frame[pick]]!r} at "
        f"({survey.pixel_px[pick, 0]:.1f}, {survey.pixel_px[pick, 1]:.1f}) px"
        for pick in sorted(mend.picks | mend.without_picks)
    ]
    for line in sorted(mend.lines | mend.without_lines):
        name = survey.line_name[line] if survey.line_name else ""
        ends = named_ends(name, label[survey.line_start[line]], label[survey.line_end[line]])
        parts.append(f"length {ends} {survey.length_m[line]:.3f} m")
    for of in sorted(mend.free):
        height = "at a height to be found" if survey.is_free[of] else "on the ground"
        parts.append(f"{label[of]!r} {height}")
    more = len(parts) - MOST_LISTED
    return "; ".join(parts[:MOST_LISTED]) + (f"; and {more} more" if more > 0 else "")

"""Whether what was mended of a survey is what was wrong with it, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hostile_surveys import HostileSurvey

from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Bools
from uavgram.model.survey import SurveyCorrection

AS_READ_M = 0.05
"""By which a mended length may differ from what was read."""


def is_repaired(refined: Refined, faulty: HostileSurvey, sound: HostileSurvey) -> bool:
    """Whether an adjustment has taken the sound survey in place of the faulty one.

    Picks that lie elsewhere than in the sound survey have to be left out, and no others; labels
    that were raised have to be found free, and no others.

    Parameters
    ----------
    refined
        The adjustment, with all its mends.
    faulty, sound
        As it was handed in, and as it should have been: the same picks and lengths, by number.
    """
    mends = [one.mend for one in refined.causes if one.mend is not None]
    raised = (faulty.height_m != 0) & ~faulty.off_ground
    if raised.any():
        sound = faulty
    out = np.array(refined.pick_removed)
    out[list(refined.pick_reason)] = True
    moved = (faulty.pick_px != sound.pick_px).any(axis=1)
    return (
        bool((out == moved).all())
        and _has_right_labels(mends, faulty, sound, out)
        and not refined.line_removed.any()
        and _has_right_lengths(mends, faulty, sound)
        and _raised_labels(refined, mends, faulty) == set(np.flatnonzero(raised).tolist())
    )


def _has_right_labels(
    mends: Sequence[SurveyCorrection], faulty: HostileSurvey, sound: HostileSurvey, out: Bools
) -> bool:
    label, names = faulty.pick_label.copy(), _names(faulty)
    for mend in mends:
        for pick, to in mend.label_of_pick.items():
            label[pick] = names[to]
    return bool((label == sound.pick_label)[~out].all())


def _has_right_lengths(
    mends: Sequence[SurveyCorrection], faulty: HostileSurvey, sound: HostileSurvey
) -> bool:
    length, ends, names = faulty.line_length_m.copy(), faulty.line.copy(), _names(faulty)
    for mend in mends:
        for line, value in mend.length_m.items():
            length[line] = value
        for line, (start, end) in mend.ends.items():
            ends[line] = names[start], names[end]
    near = np.abs(length - sound.line_length_m) < AS_READ_M
    return bool(near.all() and (np.sort(ends) == np.sort(sound.line)).all())


def _raised_labels(
    refined: Refined, mends: Sequence[SurveyCorrection], faulty: HostileSurvey
) -> set[int]:
    names = _names(faulty)
    free = {int(name.removeprefix("P")) for name in refined.off_ground}
    for mend in mends:
        free |= {names[label] for label, is_free in mend.free.items() if is_free}
        free -= {names[label] for label, is_free in mend.free.items() if not is_free}
    return free


def _names(survey: HostileSurvey) -> list[int]:
    """Labels as the program numbers them: in the order in which they are first picked."""
    return list(dict.fromkeys(survey.pick_label.tolist()))

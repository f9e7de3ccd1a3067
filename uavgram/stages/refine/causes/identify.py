"""Identify the likeliest causes of misfits, one after another, until the rest fits.

Detection, identification, adaptation (Teunissen 1990, "Quality control in integrated navigation
systems"). Where a survey does not fit:

1. Hypotheses of all kinds are tested in the linear model (`screened`).
2. The most promising ones are tested by an adjustment of the corrected survey (`tried`), all at the
   stated noise.
3. The likeliest one is reported, and the next is looked for in the survey corrected for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from uavgram.model.message import Message
from uavgram.model.survey.corrections import Cause, SurveyCorrection
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.causes.detection import asks
from uavgram.stages.refine.causes.flight.camera import other_camera_file
from uavgram.stages.refine.causes.flight.log import (
    shifted_control,
    shifted_heights,
    stepped_places,
    turned_camera,
    wrong_clock,
)
from uavgram.stages.refine.causes.hypothesis import Hypothesis, Standing
from uavgram.stages.refine.causes.labels.elsewhere import elsewhere_in_a_photo
from uavgram.stages.refine.causes.labels.everywhere import swapped_everywhere
from uavgram.stages.refine.causes.labels.heights import off_the_ground
from uavgram.stages.refine.causes.labels.in_a_photo import swapped_in_a_photo, wrong_picks
from uavgram.stages.refine.causes.labels.two_views import swapped_beside_another
from uavgram.stages.refine.causes.lengths.common import common_to_lengths, taped_level
from uavgram.stages.refine.causes.lengths.ends import labels_instead, other_ends
from uavgram.stages.refine.causes.lengths.readings import wrong_lengths, wrong_readings
from uavgram.stages.refine.causes.photos.mirrored import all_mirrored
from uavgram.stages.refine.causes.photos.other_camera import photos_of_another_zoom
from uavgram.stages.refine.causes.photos.turned import (
    photos_elsewhere,
    photos_in_disorder,
    photos_in_order,
    photos_turned_together,
    turned_photos,
)
from uavgram.stages.refine.causes.trials import (
    Judged,
    as_noisy_as_it_is,
    screened,
    tried,
    without_lengths,
)
from uavgram.stages.remedies import with_remedies

MOST_CAUSES, MOST_TRIED, MOST_OF_A_KIND, MOST_DOUBTED = 6, 9, 3, 2
"""Largest numbers of reported causes; of hypotheses that are tested by an adjustment each time, and
of each kind among them; and of those that are also tested with the noise that would explain the
misfit instead."""

SURE = float(np.log(20.0))
"""Logarithm of the odds above which a hypothesis is reported, or a less likely one no longer
tried."""

PROPOSALS: tuple[Callable[[Standing], Iterable[Hypothesis]], ...] = (
    wrong_picks,
    wrong_lengths,
    swapped_in_a_photo,
    swapped_beside_another,
    wrong_readings,
    other_ends,
    common_to_lengths,
    taped_level,
    elsewhere_in_a_photo,
    swapped_everywhere,
    off_the_ground,
    photos_in_order,
    turned_photos,
    photos_turned_together,
    photos_in_disorder,
    all_mirrored,
    wrong_clock,
    turned_camera,
    shifted_control,
    shifted_heights,
    stepped_places,
    other_camera_file,
    photos_of_another_zoom,
)
"""Functions that propose hypotheses, by kind, for a survey that does not fit."""


class Identified(NamedTuple):
    """Result of the identification.

    Attributes
    ----------
    causes
        Causes, likeliest first; none where everything fits.
    freed
        For each cause, the function that removes wrong prior knowledge for further adjustments;
        None: no prior is wrong.
    wrong, right
        Picks that take part and are wrong, and those that were left out because of them.
    lines
        Lengths because of which picks were left out.
    """

    causes: tuple[Cause, ...]
    freed: tuple[Callable[[Survey], Survey] | None, ...]
    wrong: frozenset[int] = frozenset()
    right: frozenset[int] = frozenset()
    lines: frozenset[int] = frozenset()


def identify(standing: Standing) -> Identified:
    """Identify the causes of the misfits of a survey.

    Parameters
    ----------
    standing
        The survey as it is adjusted at the stated noise.
    """
    found = _one_after_another(standing)
    if not (found.causes or found.right) and asks(standing):
        # A wrong length against a log is visible only in an adjustment without it.
        without = without_lengths(standing)
        other = found if without is standing else _one_after_another(without)
        if other.causes:
            right = frozenset(np.flatnonzero(standing.spoilt).tolist())
            mends = [cause.mend for cause in other.causes if cause.mend is not None]
            lines = frozenset(line for mend in mends for line in mend.lines)
            found = other._replace(right=right, lines=lines)
    rest = photos_elsewhere(standing, found.causes, found.right)
    return found._replace(
        causes=(*found.causes, *rest), freed=(*found.freed, *(None for _ in rest))
    )


def _one_after_another(standing: Standing) -> Identified:
    """Identify the likeliest cause, then that of the remaining misfit, until the rest fits."""
    causes: list[Cause] = []
    freed: list[Callable[[Survey], Survey] | None] = []
    wrong, right = frozenset[int](), frozenset[int]()
    stated = standing
    for _ in range(MOST_CAUSES):
        is_asked = asks(standing) or _are_taped_level(standing)
        found = _likeliest(standing) if is_asked else None
        if found is None:
            break
        best, rival = found
        if best.hypothesis.tell is not None:
            causes.append(_with_remedies(_cause(best, rival), best, rival, stated.survey))
            # With two causes that explain as much, the result uses neither.
            freed.append(best.hypothesis.freed if rival is None else None)
        if best.hypothesis.back and best.hypothesis.mend is not None and rival is None:
            wrong |= best.hypothesis.mend.picks
            right |= best.hypothesis.back
        if best.after is None:
            break
        standing = best.after
    return Identified(tuple(causes), tuple(freed), wrong, right)


def _are_taped_level(standing: Standing) -> bool:
    """Return whether the linear test alone shows lengths taped level, without another misfit."""
    return any(one.odds > SURE for one in screened(standing, taped_level(standing)))


def _cause(best: Judged, rival: Judged | None) -> Cause:
    """Describe the likeliest hypothesis for people, and mention one that explains as much."""
    hypothesis = best.hypothesis
    assert hypothesis.tell is not None  # noqa: S101  (the caller asked)
    message = hypothesis.tell(best.found)
    if rival is not None and rival.hypothesis.tell is not None:
        other = rival.hypothesis.tell(rival.found).text.split(": ")[0]
        message = replace(
            message, text=f"{message.text} Or else, and nothing tells which: {other}."
        )
    return Cause(
        message=message,
        # An ambiguous cause is reported, but not corrected.
        mend=(hypothesis.remedy or hypothesis.mend) if hypothesis.is_clear and not rival else None,
        gain=best.gain,
        settles=hypothesis.settles,
    )


def _with_remedies(cause: Cause, best: Judged, rival: Judged | None, written: Survey) -> Cause:
    """Add corrections for the cause, and for its rivals."""
    one, rivals = best.hypothesis, [] if rival is None else [rival.hypothesis]
    if rival is not None and _blames_tapes(rival) and not _blames_tapes(best):
        rivals = []  # never offer to change a right reading
    mends = [each.remedy or each.mend for each in (one, *rivals)]
    message = cause.message
    if mends[0] is not None and (swapped := labels_instead(written, mends[0])) is not None:
        mends.append(swapped)
        message = _of_both(message, written, swapped)
    if not one.is_clear:
        lines = (k for k, name in enumerate(written.line_name) if name in one.settles)
        mends.append(SurveyCorrection(without_lines=frozenset(lines)))
    return replace(cause, message=with_remedies(message, written, mends))


def _of_both(message: Message, written: Survey, swapped: SurveyCorrection) -> Message:
    """Mention in the message on another end that two labels may be swapped instead.

    Then the measurements at either of them are in doubt, too.
    """
    pair = [written.label[k] for k in sorted(set(swapped.label_of_pick.values()))]
    named = " and ".join(map(repr, pair))
    return replace(
        message,
        text=f"{message.text} Or the labels {named} are swapped in all photos, and nothing shows "
        "which: look which point is which.",
        labels=tuple(dict.fromkeys((*message.labels, *pair))),
    )


def _likeliest(standing: Standing) -> tuple[Judged, Judged | None] | None:
    """Return the likeliest hypothesis, unless chance or noise explains as much; and its rival."""
    kinds = [_nearly_as_likely(screened(standing, propose(standing))) for propose in PROPOSALS]
    every = sorted((one for kind in kinds for one in kind), key=lambda one: -one.odds)
    proposed = list(_each_once(standing.survey, every))
    trials: list[Judged] = []
    for one in proposed[:MOST_TRIED]:
        best = max((each.odds for each in trials if not _blames_tapes(each)), default=-np.inf)
        # Before a tape is reported as wrong, try less likely hypotheses that explain as much.
        accused = any(each.odds > SURE and _blames_tapes(each) for each in trials)
        if one.odds < (-SURE if accused else 0.0) or best > one.odds + SURE:
            break  # the others promise less in the linear model
        trials.append(tried(standing, one))
    # The rest may still be noisier than stated. Use the same noise for all trials; otherwise it
    # would decide between two that explain nearly all.
    noise = min((one.noise for one in trials if one.after is not None), default=1.0)
    trials = [one.at_noise(noise) for one in trials]
    sure = [one for one in trials if one.odds > SURE]
    noisy: Standing | None = None
    for one in sorted(sure, key=lambda one: -one.odds)[:MOST_DOUBTED]:
        if one.after is not None and not asks(one.after):
            return _with_rival(one, trials)  # it explains all, without more noise
        noisy = noisy or as_noisy_as_it_is(standing)
        if noisy is standing or tried(noisy, one).odds > SURE:
            return _with_rival(one, trials)
    return None


def _nearly_as_likely(kind: Sequence[Judged]) -> list[Judged]:
    """Return the likeliest of one kind, and others of nearly the same odds in the linear model."""
    return [one for one in kind[:MOST_OF_A_KIND] if one.odds > kind[0].odds - 2.0 * SURE]


def _each_once(survey: Survey, proposed: Iterable[Judged]) -> Iterator[Judged]:
    """Drop hypotheses with the same relabelling as an earlier one: none is its own rival."""
    known: set[frozenset[tuple[int, int]]] = set()
    for one in proposed:
        mend = one.hypothesis.mend or SurveyCorrection()
        right = ((k, v) for k, v in mend.label_of_pick.items() if survey.pick_label[k] != v)
        if changed := frozenset(right):
            if changed in known and not mend.without_picks:
                continue
            known.add(changed)
        yield one


def _with_rival(best: Judged, trials: Sequence[Judged]) -> tuple[Judged, Judged | None]:
    """Return the hypothesis to report, and another one that leaves no larger misfit.

    If the observations cannot separate them, one that assumes no wrong tape comes first.
    """
    if best.hypothesis.tell is None:
        return best, None
    others = [one for one in trials if one is not best and one.odds > -SURE]
    single = [one for one in others if one.hypothesis.tell is None]
    if best.after is not None and any(one.odds > best.odds - SURE for one in single):
        return max(single, key=lambda one: one.odds), None  # one wrong reading is enough
    rivals = [one for one in others if one.hypothesis.tell is not None and _does(one, best)]
    if not rivals:
        return best, None
    rival = max(rivals, key=lambda one: (not _blames_tapes(one), one.odds))
    if _blames_tapes(best) and not _blames_tapes(rival):
        return rival, best
    return best, rival if best.after is not None else None


def _does(one: Judged, best: Judged) -> bool:
    """Return whether a hypothesis does as well as the best: by the remaining cost, or by its odds.

    Against a hypothesis that changes the whole survey by a known amount, such as the ratio of two
    units, one with free unknowns leaves an equally small cost, but is less likely.
    """
    if one.after is None or best.after is None or best.hypothesis.is_of_all:
        return one.odds > best.odds - SURE
    return one.after.cost < best.after.cost + 2.0 * SURE


def _blames_tapes(judged: Judged) -> bool:
    hypothesis = judged.hypothesis
    if any(moved.kind == "lengths" for moved in hypothesis.moved):
        return True
    mend = hypothesis.mend
    return mend is not None and bool(mend.lines | mend.without_lines)

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
from typing import NamedTuple, TypeAlias

import numpy as np

from uavgram.estimation.survey.adjustment import Explanation
from uavgram.model.message import JUST_AS_LIKELY, Message
from uavgram.model.survey import Cause, Survey, SurveyCorrection
from uavgram.stages.refine.causes.common_length_errors import (
    propose_common_errors,
    propose_taped_level,
)
from uavgram.stages.refine.causes.detection import has_misfit, needs_cause
from uavgram.stages.refine.causes.flight_log import (
    propose_position_step,
    propose_shifted_control,
    propose_shifted_heights,
    propose_turned_camera,
    propose_wrong_clock,
)
from uavgram.stages.refine.causes.hypothesis import SURE_LOG_ODDS, Diagnosis, Hypothesis
from uavgram.stages.refine.causes.length_ends import propose_other_ends
from uavgram.stages.refine.causes.length_readings import (
    propose_other_units,
    propose_slips,
    propose_wrong_lengths,
)
from uavgram.stages.refine.causes.mirrored_photos import (
    propose_all_mirrored,
    propose_exchanged_axes,
)
from uavgram.stages.refine.causes.moved_points import (
    propose_moved_left_out,
    propose_moved_points,
)
from uavgram.stages.refine.causes.other_camera import (
    propose_other_camera_file,
    propose_other_lens,
    propose_other_zoom,
    propose_other_zoom_of_all,
)
from uavgram.stages.refine.causes.swapped_labels import (
    propose_swapped_by_two_views,
    propose_swapped_everywhere,
)
from uavgram.stages.refine.causes.trials import (
    JudgedHypothesis,
    explain_by_noise,
    screen_hypotheses,
    try_hypothesis,
)
from uavgram.stages.refine.causes.turned_photos import (
    propose_labels_moved_on,
    propose_only_photo,
    propose_photos_in_disorder,
    propose_photos_in_order,
    propose_photos_turned_together,
    propose_turned_photos,
)
from uavgram.stages.refine.causes.wrong_heights import (
    propose_heights,
    propose_heights_in_other_unit,
)
from uavgram.stages.refine.causes.wrong_picks import (
    propose_other_places,
    propose_swapped_in_photo,
    propose_wrong_picks,
)
from uavgram.stages.remedies import add_remedies

MAX_CAUSES, MAX_TRIED, MAX_TRIED_OF_A_KIND, MAX_TRIED_WITH_NOISE = 6, 9, 3, 2
"""Largest numbers of reported causes; of hypotheses that are tested by an adjustment each time, and
of each kind among them; and of those that are also tested with the noise that would explain the
misfit instead."""

Proposal: TypeAlias = Callable[[Diagnosis], Iterable[Hypothesis]]
"""Function that proposes hypotheses of a kind for a survey."""

HYPOTHESES: tuple[Proposal, ...] = (
    propose_wrong_picks,
    propose_wrong_lengths,
    propose_swapped_in_photo,
    propose_swapped_by_two_views,
    propose_other_units,
    propose_slips,
    propose_other_ends,
    propose_common_errors,
    propose_taped_level,
    propose_other_places,
    propose_moved_left_out,
    propose_swapped_everywhere,
    propose_heights,
    propose_photos_in_order,
    propose_turned_photos,
    propose_photos_turned_together,
    propose_photos_in_disorder,
    propose_all_mirrored,
    propose_exchanged_axes,
    propose_wrong_clock,
    propose_turned_camera,
    propose_shifted_control,
    propose_shifted_heights,
    propose_position_step,
    propose_other_zoom,
)
"""Functions that propose hypotheses, by kind, for a survey that does not fit."""

ERRORS_OF_ONLY_PHOTO: tuple[Proposal, ...] = (
    propose_only_photo,
    propose_labels_moved_on,
)
"""Those on all picks of a survey with a single photo."""

COMMON_ERRORS: tuple[Proposal, ...] = (
    propose_other_units,
    propose_common_errors,
    propose_taped_level,
    propose_moved_points,
    propose_heights_in_other_unit,
    propose_all_mirrored,
    propose_exchanged_axes,
    propose_swapped_everywhere,
    propose_wrong_clock,
    propose_turned_camera,
    propose_shifted_control,
    propose_shifted_heights,
    propose_position_step,
    propose_other_zoom_of_all,
    propose_other_camera_file,
    propose_other_lens,
)
"""Those on errors common to all readings of a kind, or to all photos."""


class IdentifiedCauses(NamedTuple):
    """Result of the identification.

    Attributes
    ----------
    causes
        Causes, likeliest first; none where everything fits.
    freed
        For each cause, the function that removes wrong prior knowledge for further adjustments;
        None: no prior is wrong.
    explanations
        For each cause, the corrected survey adjusted, and likewise for its rival; none where that
        was not tried.
    wrong, wrong_lines
        Picks, and lengths, that the causes prove wrong.
    possible
        Mistakes that explain the remaining misfit about as well as wrong readings do, the likeliest
        first.
    cost
        Cost of the corrected survey, with the prices of the causes.
    fits
        Whether the corrected survey fits.
    left_out
        Number of its readings that were left out because they contradict the rest.
    judged
        Evidence of each cause.
    restored
        The survey with photos that had been left out, but fit without any cause, or without a
        length that no other observation checks; else None.
    """

    causes: tuple[Cause, ...]
    freed: tuple[Callable[[Survey], Survey] | None, ...]
    explanations: tuple[tuple[Explanation, ...], ...]
    wrong: frozenset[int] = frozenset()
    wrong_lines: frozenset[int] = frozenset()
    possible: tuple[JudgedHypothesis, ...] = ()
    cost: float = np.inf
    fits: bool = False
    left_out: int = 0
    judged: tuple[JudgedHypothesis, ...] = ()
    restored: Diagnosis | None = None

    def is_likelier(self, cost: float) -> bool:
        """Return whether there are causes, with odds of 20 to 1 against another explanation."""
        return bool(self.causes) and self.cost + 2.0 * SURE_LOG_ODDS < cost

    def list_rivals(self, cost: float) -> tuple[JudgedHypothesis, ...]:
        """List the causes that are about as likely as another explanation of such a cost."""
        if not self.causes:
            return self.possible
        difference = cost - self.cost
        if difference < -2.0 * SURE_LOG_ODDS:
            return ()
        return tuple(replace(one, odds=difference / 2.0) for one in self.judged)


def identify_common_errors(
    diagnosis: Diagnosis, hypotheses: Sequence[Proposal], goal: float = np.inf
) -> IdentifiedCauses:
    """Identify at most two errors, each common to all readings of a kind, or to all photos.

    Parameters
    ----------
    diagnosis
        The survey with all its readings.
    hypotheses
        Functions that propose the errors.
    goal
        Cost above which the errors, and their rivals, are of no use.
    """
    return _identify_in_turn(diagnosis, hypotheses, most=2, goal=goal)


def identify_causes(diagnosis: Diagnosis) -> IdentifiedCauses:
    """Identify the causes of the misfits of a survey.

    Parameters
    ----------
    diagnosis
        The survey as it is adjusted at the stated noise.
    """
    found = _identify_in_turn(diagnosis)
    if diagnosis.left_out or not found.possible or found.possible[0].odds < 0.0:
        return found  # what was left out is reported, and what may be wrong instead
    near = [one for one in found.possible if one.odds > found.possible[0].odds - SURE_LOG_ODDS]
    message, *others = describe_possible(near)
    for other in others:
        message = _mention_rival(message, other)
    cause = Cause(message=message, mend=None, gain=found.possible[0].gain)
    return found._replace(causes=(*found.causes, cause))


def _identify_in_turn(
    diagnosis: Diagnosis,
    hypotheses: Sequence[Proposal] = HYPOTHESES,
    most: int = MAX_CAUSES,
    goal: float = np.inf,
) -> IdentifiedCauses:
    """Identify the likeliest cause, then that of the remaining misfit, until the rest fits.

    Of several causes that reach the goal together, the first explains at least its share.
    """
    causes: list[Cause] = []
    freed: list[Callable[[Survey], Survey] | None] = []
    explanations: list[tuple[Explanation, ...]] = []
    judged: list[JudgedHypothesis] = []
    wrong, wrong_lines = frozenset[int](), frozenset[int]()
    possible: tuple[JudgedHypothesis, ...] = ()
    stated, price = diagnosis, 0.0
    restored: Diagnosis | None = None
    for left in range(most, 0, -1):
        if not needs_cause(diagnosis) and not _are_taped_level(diagnosis):
            break
        squares = diagnosis.adjustment.minimum.cost
        limit = squares - (squares - (goal - price)) / left
        best, others = _find_likeliest(diagnosis, hypotheses, limit)
        if best is None:
            possible = () if causes else others
            break
        rival = others[0] if others else None
        price += 2.0 * best.hypothesis.price - (0.0 if best.after else best.gain)
        if best.hypothesis.message is not None:
            causes.append(_add_remedies(_cause(best, rival), best, rival, stated.survey))
            freed.append(_choose_release(best, rival))
            explanations.append(_list_explanations(diagnosis, best, others))
            wrong |= _list_wrong_picks(best, rival)
            wrong_lines |= _list_wrong_lines(best, rival)
            judged.append(best)
        if best.after is None:
            break
        diagnosis = _take_back(best.after)
        one = best.hypothesis
        if one.message is None and (one.back or one.is_of_all) and not causes:
            restored = diagnosis
    cost = diagnosis.cost + price
    return IdentifiedCauses(
        tuple(causes),
        tuple(freed),
        tuple(explanations),
        wrong,
        wrong_lines,
        possible,
        cost=cost,
        fits=not has_misfit(diagnosis),
        left_out=diagnosis.count_readings(),
        judged=tuple(judged),
        restored=restored,
    )


def _take_back(diagnosis: Diagnosis) -> Diagnosis:
    """Readjust with all that was left out, and return the better state.

    After the correction of a mistake, readings may fit that had contradicted it.
    """
    if not diagnosis.left_out:
        return diagnosis
    every = Hypothesis(message=None, mend=SurveyCorrection(), is_of_all=True)
    judged = try_hypothesis(diagnosis, JudgedHypothesis(every, None, 0.0, 0.0))
    return judged.after if judged.after is not None and judged.odds > 0.0 else diagnosis


def _list_explanations(
    diagnosis: Diagnosis, best: JudgedHypothesis, rivals: Sequence[JudgedHypothesis]
) -> tuple[Explanation, ...]:
    """List the corrected surveys of a cause and its rivals, where they were adjusted."""
    judged = [best, *rivals]
    for one in (best, *rivals):
        for mend in one.hypothesis.equal:
            other = replace(one, hypothesis=Hypothesis(message=None, mend=mend), found=None)
            judged.append(try_hypothesis(diagnosis, other))
    # A rival is reported as just as likely, and an equal correction fits as well.
    odds = max(one.odds for one in (best, *rivals))
    return tuple(Explanation(one.after.adjustment, odds) for one in judged if one.after is not None)


def add_possible(found: IdentifiedCauses, possible: Sequence[JudgedHypothesis]) -> IdentifiedCauses:
    """Add hypotheses that are about as likely as the causes, or as gross errors without a cause."""
    causes = list(found.causes)
    if causes and possible:
        for other in describe_possible(possible):
            message = _mention_rival(causes[0].message, other)
            causes[0] = replace(causes[0], message=message, mend=None)
        found = found._replace(causes=tuple(causes), wrong=frozenset())
    return found._replace(possible=(*found.possible, *possible))


def _list_wrong_picks(best: JudgedHypothesis, rival: JudgedHypothesis | None) -> frozenset[int]:
    """List the picks that a cause proves wrong: none where another cause explains as much."""
    one = best.hypothesis
    if best.after is None or one.mend is None or rival:
        return frozenset()
    if one.equal or not one.is_clear:
        # Of two places of a point, either is right, but not both.
        return one.mend.apart
    return one.mend.picks | one.mend.without_picks


def _list_wrong_lines(best: JudgedHypothesis, rival: JudgedHypothesis | None) -> frozenset[int]:
    """List the lengths that a cause proves wrong: none where another cause explains as much."""
    one = best.hypothesis
    if best.after is None or one.mend is None or rival or one.equal or not one.is_clear:
        return frozenset()
    return one.mend.lines


def _choose_release(
    best: JudgedHypothesis, rival: JudgedHypothesis | None
) -> Callable[[Survey], Survey] | None:
    """Return the function that removes the prior knowledge which a cause or its rival proves wrong.

    Where the rival is no error of prior knowledge, nothing shows that any is wrong.
    """
    one = best.hypothesis.freed
    if one is None or rival is None:
        return one
    other = rival.hypothesis.freed
    return None if other is None else lambda survey: other(one(survey))


def _are_taped_level(diagnosis: Diagnosis) -> bool:
    """Return whether the linear test alone shows lengths taped level, without another misfit."""
    return any(
        one.odds > SURE_LOG_ODDS
        for one in screen_hypotheses(diagnosis, propose_taped_level(diagnosis))
    )


def _cause(best: JudgedHypothesis, rival: JudgedHypothesis | None) -> Cause:
    """Describe the likeliest hypothesis for people, and mention one that explains as much."""
    hypothesis = best.hypothesis
    assert hypothesis.message is not None  # noqa: S101  (the caller asked)
    message = hypothesis.message(best.found)
    if rival is not None and rival.hypothesis.message is not None:
        other = rival.hypothesis.message(rival.found)
        message = _mention_rival(message, other)
    return Cause(
        message=message,
        # An ambiguous cause is reported, but not corrected.
        mend=(hypothesis.remedy or hypothesis.mend) if hypothesis.is_clear and not rival else None,
        gain=best.gain,
        settles=hypothesis.settles,
    )


def _add_remedies(
    cause: Cause, best: JudgedHypothesis, rival: JudgedHypothesis | None, written: Survey
) -> Cause:
    """Add corrections for the cause, and for its rivals."""
    one, rivals = best.hypothesis, [] if rival is None else [rival.hypothesis]
    if rival is not None and _blames_tapes(rival) and not _blames_tapes(best):
        rivals = []  # never offer to change a right reading
    mends = [each.remedy or each.mend for each in (one, *rivals)] + [*one.equal]
    message = cause.message
    if one.mend is not None and one.mend.ends:
        for swapped in one.equal:
            message = _mention_swap(message, written, swapped)
    if not one.is_clear:
        lines = (k for k, name in enumerate(written.line_name) if name in one.settles)
        mends.append(SurveyCorrection(without_lines=frozenset(lines)))
    return replace(cause, message=add_remedies(message, written, mends))


def _mention_swap(message: Message, written: Survey, swapped: SurveyCorrection) -> Message:
    """Mention in the message on another end that two labels may be swapped instead.

    Then the measurements at either of them are in doubt, too.
    """
    pair = [written.label[k] for k in sorted(set(swapped.label_of_pick.values()))]
    named = " and ".join(map(repr, pair))
    where = "in all photos" if len(written.frame_id) > 1 else "in the photo"
    either = _add_alternative(
        message,
        f"Or the labels {named} are swapped {where}, and nothing shows which: look which point is "
        "which.",
    )
    return replace(either, labels=tuple(dict.fromkeys((*message.labels, *pair))))


def _mention_rival(message: Message, rival: Message) -> Message:
    """Mention another cause that is about as likely."""
    other = f"{rival.split_text(': ')[0]}."
    return replace(
        _add_alternative(message, f"{JUST_AS_LIKELY} {other}"),
        mentions=(*message.mentions, *rival.names()),
        equals=(*message.equals, other),
    )


def _add_alternative(message: Message, sentence: str) -> Message:
    """Insert another cause behind the first sentence, so that a summary contains both."""
    first, *rest = message.split_text()
    text = f"{first}. {sentence} {'. '.join(rest)}" if rest else f"{first} {sentence}"
    return replace(message, text=text)


def describe_possible(possible: Iterable[JudgedHypothesis]) -> tuple[Message, ...]:
    """Describe hypotheses for people."""
    described = ((one.hypothesis.message, one.found) for one in possible)
    return tuple(message(found) for message, found in described if message is not None)


def _find_likeliest(
    diagnosis: Diagnosis, hypotheses: Sequence[Proposal], limit: float = np.inf
) -> tuple[JudgedHypothesis | None, tuple[JudgedHypothesis, ...]]:
    """Return the likeliest hypothesis, unless chance or noise explains as much; and its rivals.

    Without one, the others are those that explain something and are not unlikely. Hypotheses that
    leave a sum of squares above a limit are of no use.
    """
    kinds = [
        _nearly_as_likely(screen_hypotheses(diagnosis, propose(diagnosis)))
        for propose in hypotheses
    ]
    every = sorted((one for kind in kinds for one in kind), key=lambda one: -one.odds)
    squares = diagnosis.adjustment.minimum.cost
    promising = (one for one in every if squares - one.gain <= limit)
    proposed = list(_drop_duplicates(diagnosis.survey, promising))
    trials: list[JudgedHypothesis] = []
    for one in proposed[:MAX_TRIED]:
        best = max((each.odds for each in trials if not _blames_tapes(each)), default=-np.inf)
        # Before a tape is reported as wrong, try less likely hypotheses that explain as much.
        accused = any(each.odds > SURE_LOG_ODDS and _blames_tapes(each) for each in trials)
        if one.odds < (-SURE_LOG_ODDS if accused else 0.0) or best > one.odds + SURE_LOG_ODDS:
            break  # the others promise less in the linear model
        trials.append(try_hypothesis(diagnosis, one, limit))
        limit = min(limit, _bound_rivals(trials[-1]))
    # The rest may still be noisier than stated. Use the same noise for all trials; otherwise it
    # would decide between two that explain nearly all.
    noise = min((one.noise for one in trials if one.after is not None), default=1.0)
    trials = [one.rescale_odds(noise) for one in trials]
    sure = [one for one in trials if one.odds > SURE_LOG_ODDS]
    noisy: Diagnosis | None = None
    for one in sorted(sure, key=lambda one: -one.odds)[:MAX_TRIED_WITH_NOISE]:
        if one.after is not None and not needs_cause(one.after):
            return _choose_with_rivals(one, trials)  # it explains all, without more noise
        noisy = noisy or explain_by_noise(diagnosis)
        noisier = replace(one, hypothesis=replace(one.hypothesis, adjusted=None))
        odds = np.inf if noisy is diagnosis else try_hypothesis(noisy, noisier).odds
        if odds > SURE_LOG_ODDS:
            return _choose_with_rivals(one, trials)
        trials[trials.index(one)] = replace(one, odds=odds)  # noise explains about as much
    possible = (
        one
        for one in trials
        if one.after is not None
        and one.hypothesis.message is not None
        and -SURE_LOG_ODDS < one.odds <= SURE_LOG_ODDS
        and one.gain > 2.0 * SURE_LOG_ODDS
    )
    return None, tuple(sorted(possible, key=lambda one: -one.odds))


def _bound_rivals(one: JudgedHypothesis) -> float:
    """Bound the sum of squares of the rivals of a hypothesis that explains all; else no bound."""
    is_sure = one.odds > SURE_LOG_ODDS and one.noise == 1.0 and not _blames_tapes(one)
    if one.after is None or not is_sure or needs_cause(one.after):
        return np.inf
    return one.after.cost + 2.0 * one.hypothesis.price + 4.0 * SURE_LOG_ODDS


def _nearly_as_likely(kind: Sequence[JudgedHypothesis]) -> list[JudgedHypothesis]:
    """Return the likeliest of one kind, and others of nearly the same odds in the linear model."""
    return [
        one for one in kind[:MAX_TRIED_OF_A_KIND] if one.odds > kind[0].odds - 2.0 * SURE_LOG_ODDS
    ]


def _drop_duplicates(
    survey: Survey, proposed: Iterable[JudgedHypothesis]
) -> Iterator[JudgedHypothesis]:
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


def _choose_with_rivals(
    best: JudgedHypothesis, trials: Sequence[JudgedHypothesis]
) -> tuple[JudgedHypothesis, tuple[JudgedHypothesis, ...]]:
    """Return the hypothesis to report, and others that leave no larger misfit.

    If the observations cannot separate them, one that assumes no wrong tape comes first.
    """
    if best.hypothesis.message is None:
        return best, ()
    others = [one for one in trials if one is not best and one.odds > -SURE_LOG_ODDS]
    single = [one for one in others if one.hypothesis.message is None]
    if best.after is not None and any(one.odds > best.odds - SURE_LOG_ODDS for one in single):
        return max(single, key=lambda one: one.odds), ()  # one wrong reading is enough
    rivals = [
        one for one in others if one.hypothesis.message is not None and _does_as_well(one, best)
    ]
    rivals.sort(key=lambda one: (_blames_tapes(one), -one.odds))
    is_better = (
        bool(rivals)
        and rivals[0].hypothesis.is_clear
        and not _blames_tapes(rivals[0])
        and not (_has_less_freedom(best, rivals[0]) and rivals[0].odds < best.odds - SURE_LOG_ODDS)
    )
    if is_better and _blames_tapes(best):
        return rivals[0], (best, *rivals[1:])
    return best, tuple(rivals) if best.after is not None else ()


def _does_as_well(one: JudgedHypothesis, best: JudgedHypothesis) -> bool:
    """Return whether a hypothesis does as well as the best: by the remaining cost, or by its odds.

    Against a hypothesis that changes the whole survey by a known amount, such as the ratio of two
    units, or one with fewer unknowns of the same prior, one with free unknowns leaves an equally
    small cost, but is less likely.
    """
    same = {moved.kind for moved in one.hypothesis.moved} & {
        moved.kind for moved in best.hypothesis.moved
    }
    freed = one.hypothesis.freed is not None and best.hypothesis.freed is not None
    is_known = _has_less_freedom(best, one)
    if one.after is None or best.after is None or is_known or (same and freed):
        # A free unknown may agree with a known amount by chance.
        margin = 2.0 if is_known and one.hypothesis.freed is not None else 1.0
        return one.odds > best.odds - margin * SURE_LOG_ODDS
    return one.after.cost < best.after.cost + 2.0 * SURE_LOG_ODDS


def _has_less_freedom(best: JudgedHypothesis, other: JudgedHypothesis) -> bool:
    """Return whether a hypothesis changes the whole survey by a known amount, and another not."""
    is_freer = other.hypothesis.freed is not None or not other.hypothesis.is_of_all
    return best.hypothesis.is_of_all and is_freer


def _blames_tapes(judged: JudgedHypothesis) -> bool:
    hypothesis = judged.hypothesis
    if any(moved.kind == "lengths" for moved in hypothesis.moved):
        return True
    mend = hypothesis.mend
    return mend is not None and bool(mend.lines | mend.without_lines)

"""Adjust robustly from first values without some of the observations.

First values may depend on gross errors. Without a gross error they lead to the right minimum, where
the robust adjustment leaves it out.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, combinations, islice

import numpy as np

from uavgram.estimation.first_poses.resection import MIN_PICKS, find_consensus
from uavgram.estimation.reliability.redundancy import GROSS_SIGMAS, MAX_GROSS_SHARE
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause
from uavgram.estimation.survey.observations.kinds import READINGS
from uavgram.estimation.survey.selection import select_control
from uavgram.geometry.camera.projection import back_project
from uavgram.model.arrays import Bools, Ints
from uavgram.stages.refine.cleaned_adjustment import DISAGREEING, are_ends
from uavgram.stages.refine.exchanged_readings import MIN_DECREASE_SHARE, MOST_STARTS
from uavgram.stages.refine.first_values import find_agreeing_control
from uavgram.stages.refine.minima import FULL, QUICK_TRIAL, Participants, Patience, adjust_on_trial
from uavgram.stages.refine.rival_errors import MAX_RIVAL_INCREASE, falls_with_all, is_known_mistake
from uavgram.stages.refine.robust_adjustment import ZERO_WEIGHT, decide, minimise_weighted_cost
from uavgram.stages.refine.robust_candidate import (
    MISPLACED,
    MOST_ALTERNATIVES,
    MOST_GROSS_OF_A_PHOTO,
    Candidate,
    add_small_roughness,
    adjust_from_reduced,
    adjust_from_softened,
    bound_cost,
    sort_by_cost,
)

MOST_IN_PAIRS = 7
"""Largest number of lengths that are left out in pairs, without a log."""

SEVERAL_PHOTOS, MOST_LENGTHS_ALONE = 3, 3
"""Number of photos that show the shape of the ground without lengths; and largest number of lengths
that give its size in turn."""

MOST_PROPOSED = 3
"""Number of single gross errors that are tried in place of several."""

MOST_CONTESTING = 2
"""Number of photos of a point up to which the clicks in one may be wrong, or those in the other."""

EITHER = LeftOut(
    LeftOutCause.MISPLACED_FRAME,
    "it and the other photo contradict each other, and nothing shows which of the two is wrong: "
    "look whether both show the same points, and whether one was mirrored or turned",
)


def _are_most_left(whole: Participants, rest: Participants) -> bool:
    """Return whether few frames were left out; if many were, the frames are not at fault."""
    before, after = (np.unique(one.survey.pick_frame[one.keep]) for one in (whole, rest))
    return len(after) >= (1.0 - MAX_GROSS_SHARE) * len(before)


def take_until_agreed(candidates: Iterable[Candidate]) -> Iterator[Candidate]:
    """Take candidates up to the first that fits, and in which nearly all observations agree."""
    for one in candidates:
        yield one
        if one.is_agreed() and one.fits():
            return


def try_without_references(taking: Participants, found: Sequence[Candidate]) -> Iterator[Candidate]:
    """Adjust robustly from first values without a click, a known thing, control, or lengths.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    whole = add_small_roughness(taking)
    parts = (
        _leave_out_contradicting_control,
        _leave_out_each_click,
        _leave_out_each_known_thing,
        _leave_out_each_length,
        _leave_out_all_but_a_length,
    )
    each = chain.from_iterable(leave_out(whole) for leave_out in parts)
    yield from _adjust_from_parts(each, whole, taking, found)


def try_without_two_lengths(
    taking: Participants, found: Sequence[Candidate]
) -> Iterator[Candidate]:
    """Adjust robustly from first values without each pair of lengths, where no log gives others.

    Several photos that agree need no such search, nor does an explanation likelier than two errors.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    if found and found[0].explains():
        is_costly = found[0].cost(taking) + MAX_RIVAL_INCREASE > 2.0 * GROSS_SIGMAS**2
        if not is_costly or len(np.unique(taking.survey.pick_frame)) > 1:
            return
    whole = add_small_roughness(taking)
    lines = np.flatnonzero(~taking.line_removed).tolist()
    if taking.survey.telemetry is None and 4 < len(lines) <= MOST_IN_PAIRS:
        parts = map(whole.leave_out_lines, combinations(lines, 2))
        yield from _adjust_from_parts(parts, whole, taking, found)


def _adjust_from_parts(
    parts: Iterable[Participants],
    whole: Participants,
    taking: Participants,
    found: Sequence[Candidate],
) -> Iterator[Candidate]:
    """Adjust robustly from parts of the observations, with the patience that each one deserves."""
    for part in parts:
        patience = _choose_patience(taking, found)
        for candidate in adjust_from_reduced(part, whole, taking, patience):
            found = sort_by_cost(taking, [*found, candidate])
            yield candidate


def try_without_suspects(taking: Participants, found: Sequence[Candidate]) -> Iterator[Candidate]:
    """Adjust robustly without all photos that contradict the rest, until no other one does.

    A photo of another place, mirrored, or with its labels in disorder spoils the tests of all
    others. Without it, the adjustment starts again from new first values.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    names, rest = found[0].misplaced if found else (), taking
    while names:
        before, rest = rest, taking.leave_out_frames(names, MISPLACED)
        # A photo without picks takes part by matches alone, which stay.
        if rest.keep.sum() == before.keep.sum() or not _are_most_left(taking, rest):
            return
        each = chain(_adjust_from_rest(rest), adjust_from_softened(rest))
        best = sort_by_cost(rest, take_until_agreed(each))[:1]
        yield from best
        # One wrong pick may have spoilt a photo, also in another one that shows its point.
        yield from chain.from_iterable(_try_without_wrong_picks(taking, one) for one in best)
        names = (*names, *best[0].misplaced) if best and best[0].misplaced else ()


def try_without_photos(taking: Participants, found: Sequence[Candidate]) -> Iterator[Candidate]:
    """Adjust robustly without one photo until the rest fits, or with those of its picks that agree.

    Where either of two photos fits alone, nothing shows which of them is wrong.

    Parameters
    ----------
    taking
        Participating observations.
    found
        Candidates so far, that of least cost first.
    """
    photos = _photos_by_gross_picks(taking, found)
    is_explained = bool(found) and found[0].explains() and not found[0].may_hide_a_photo()
    if not 1 < len(photos) <= MOST_STARTS or is_explained:
        return
    parts = (taking.leave_out_frames([name], MISPLACED) for name in photos)
    each = (one for rest in parts for one in _adjust_from_rest(rest))
    fitting = (one for one in each if one.explains() and one.leaves_no_other())
    best = _better_of_two(taking, fitting) if len(photos) == 2 else list(islice(fitting, 1))
    for candidate in best:
        agreeing = list(_try_without_wrong_picks(taking, candidate))
        yield from agreeing
        # A photo of several whose picks mostly agree shows this place, also where that is no
        # better.
        if len(photos) == 2 or not any(one.explains() for one in agreeing):
            yield candidate


def _adjust_from_rest(rest: Participants) -> Iterator[Candidate]:
    """Adjust robustly from the ordinary minima of the remaining observations."""
    whole = add_small_roughness(rest)
    return adjust_from_reduced(whole, whole, rest)


def _photos_by_gross_picks(taking: Participants, found: Sequence[Candidate]) -> list[str]:
    """Return names of photos with picks, those with the largest share of gross errors first."""
    frame, names = taking.survey.pick_frame, taking.survey.frame_id
    number = np.bincount(frame[taking.keep], minlength=len(names))
    used = found[0].used if found else np.flatnonzero(taking.keep)
    wrong = 1.0 - np.bincount(frame[used], minlength=len(names)) / np.maximum(number, 1)
    return [names[k] for k in np.argsort(-wrong, kind="stable") if number[k]]


def _better_of_two(taking: Participants, alone: Iterable[Candidate]) -> list[Candidate]:
    """Return the better of the candidates without either of two photos.

    Where each of the two fits alone, the picks of the photo are left out with the reason `EITHER`:
    their costs are of different observations, so the smaller one is no evidence.
    """
    fitting = sort_by_cost(taking, alone)
    if len(fitting) < 2:
        return fitting
    best = fitting[0].taking
    left = np.flatnonzero(taking.keep & ~best.keep).tolist()
    reason = {**best.reason, **dict.fromkeys(left, EITHER)}
    return [replace(fitting[0], taking=replace(best, reason=reason))]


def _try_without_wrong_picks(taking: Participants, without: Candidate) -> Iterator[Candidate]:
    """Adjust robustly with the picks of left-out photos that agree on a pose, among wrong ones.

    Labels that are swapped, or one wrong pick, rotate and move their photo, and all of its picks
    contradict the others.

    Parameters
    ----------
    taking
        Participating observations.
    without
        Candidate without some photos, whose points place them again.
    """
    survey, problem = taking.survey, without.annealed.problem
    row = np.array([problem.survey.row_of_label.get(name, -1) for name in survey.label])
    world_m, _, _ = problem.world_points(without.annealed.minimum.state, row)
    camera, known = survey.calibration, (row >= 0) & ~survey.is_free
    left = taking.keep & ~without.taking.keep & known[survey.pick_label]
    wrong: list[int] = []
    for frame in np.unique(survey.pick_frame[left]).tolist():
        picks = np.flatnonzero(left & (survey.pick_frame == frame))
        ray = back_project(camera.model, camera.parameters, survey.pixel_px[picks])
        is_in_lens = np.isfinite(ray).all(axis=1)
        picks, ray = picks[is_in_lens], ray[is_in_lens]
        sigma = survey.pick_sigma_px[picks] / camera.parameters[0]
        agree = find_consensus(world_m[survey.pick_label[picks]], ray, sigma)
        if agree is None or 2 * agree.sum() <= len(picks) or agree.sum() <= MIN_PICKS:
            return  # so few agree on any pose
        wrong += picks[~agree].tolist()
    whole = add_small_roughness(taking)
    yield from adjust_from_reduced(
        whole.leave_out_picks(dict.fromkeys(wrong, MISPLACED)), whole, taking
    )


def _choose_patience(taking: Participants, found: Sequence[Candidate]) -> Patience:
    """Choose the patience with a part whose missing observation could be the gross error.

    Where few gross errors explain everything, a part that still contains some is no rival, and not
    worth a robust adjustment; few iterations show whether it does.
    """
    limit = bound_cost(taking, found)
    if not found or not found[0].explains() or len(found[0].unplaced):
        return FULL._replace(limit=limit)
    goal = found[0].cost(taking) + MAX_RIVAL_INCREASE - GROSS_SIGMAS**2
    return QUICK_TRIAL._replace(goal=goal, limit=limit)


def _leave_out_contradicting_control(whole: Participants) -> Iterator[Participants]:
    """Leave out the control that contradicts most other control, in the network of the photos.

    Where the photos have no network without control, in the pose of one photo.
    """
    survey = whole.survey
    if survey.telemetry is not None or len(survey.control_label) < 3:
        return
    without = select_control(survey, np.zeros(len(survey.control_label), dtype=np.bool_))
    network = adjust_on_trial(replace(whole, survey=replace(without, gauge="plane")), QUICK_TRIAL)
    if network is None:
        agree = _find_control_of_one_pose(whole)
    else:
        names = [survey.label[k] for k in survey.control_label]
        row = network.adjustment.label_rows(names)
        point = network.adjustment.state.point[row, :2]
        here = np.where(row[:, None] >= 0, point, np.nan)
        agree = find_agreeing_control(here, survey.control_world_m[:, :2])
    if agree.any() and not agree.all():
        yield replace(whole, survey=select_control(survey, agree))


def _find_control_of_one_pose(whole: Participants) -> Bools:
    """Mark the control points (C,) that agree on a pose of the photo with most of them."""
    survey, camera = whole.survey, whole.survey.calibration
    row = np.full(len(survey.label), -1)
    row[survey.control_label] = np.arange(len(survey.control_label))
    usable = whole.keep & (row[survey.pick_label] >= 0)
    number = np.bincount(survey.pick_frame[usable], minlength=len(survey.frame_id))
    picks = np.flatnonzero(usable & (survey.pick_frame == number.argmax()))
    # One click of each point.
    of, first = np.unique(row[survey.pick_label[picks]], return_index=True)
    picks = picks[first]
    ray = back_project(camera.model, camera.parameters, survey.pixel_px[picks])
    is_in_lens = np.isfinite(ray).all(axis=1)
    of, picks, ray = of[is_in_lens], picks[is_in_lens], ray[is_in_lens]
    sigma = survey.pick_sigma_px[picks] / camera.parameters[0]
    found = find_consensus(survey.control_world_m[of], ray, sigma) if len(of) else None
    agree = np.zeros(len(survey.control_label), dtype=np.bool_)
    if found is not None and found.sum() >= MIN_PICKS:
        agree[of[found]] = True
    return agree


def _leave_out_each_click(whole: Participants) -> Iterator[Participants]:
    """Leave out each point of a single photo without a log at which lengths and the like end."""
    survey = whole.survey
    picks = np.flatnonzero(whole.keep)
    if survey.telemetry is not None or len(np.unique(survey.pick_frame[picks])) != 1:
        return
    things = [k for one in survey.known for k in one.label]
    is_end = are_ends(survey, survey.pick_label[picks])
    is_end |= np.isin(survey.pick_label[picks], [*things, *survey.control_label])
    labels = np.unique(survey.pick_label[picks[is_end]])
    for label in labels.tolist() if len(labels) <= MOST_STARTS else []:
        own = picks[survey.pick_label[picks] == label].tolist()
        yield whole.leave_out_picks(dict.fromkeys(own, DISAGREEING))


def _leave_out_each_known_thing(whole: Participants) -> Iterator[Participants]:
    """Leave out each known thing, and all control points or, where no log places photos, each."""
    survey, number = whole.survey, len(whole.survey.control_label)
    things = [one.index for one in survey.known if one.index not in whole.known_removed]
    for thing in things if len(things) <= MOST_STARTS else []:
        yield replace(whole, known_removed=whole.known_removed | {thing})
    each, together = np.eye(number, dtype=np.bool_), np.ones((1, number), dtype=np.bool_)
    left_out = each if survey.telemetry is None else together
    for rows in left_out if len(left_out) <= MOST_STARTS else []:
        if rows.any():
            yield replace(whole, survey=select_control(survey, ~rows))


def _leave_out_each_length(whole: Participants) -> Iterator[Participants]:
    """Leave out all lengths where there is a log, and each one where no third photo checks it.

    First values without a log may depend on a wrong length, and so may the poses of one or two
    photos with one. Where all lengths are in another unit, they and the log may force all other
    observations into agreement with them.
    """
    survey, lines = whole.survey, np.flatnonzero(~whole.line_removed).tolist()
    if survey.telemetry is not None and lines:
        yield whole.leave_out_lines(lines)
    are_few = len(np.unique(survey.pick_frame[whole.keep])) < SEVERAL_PHOTOS
    if (survey.telemetry is None or are_few) and len(lines) <= MOST_STARTS:
        yield from (whole.leave_out_lines([line]) for line in lines)


def _leave_out_all_but_a_length(whole: Participants) -> Iterator[Participants]:
    """Leave out all references but one length, where several photos show the shape of the ground.

    Several wrong lengths, as at a label that is swapped, may distort the first values of all
    photos.
    """
    survey, lines = whole.survey, np.flatnonzero(~whole.line_removed)
    photos = len(np.unique(survey.pick_frame[whole.keep]))
    if survey.telemetry is not None or photos < SEVERAL_PHOTOS or not len(lines):
        return
    without = select_control(survey, np.zeros(len(survey.control_label), dtype=np.bool_))
    longest = lines[np.argsort(-survey.length_m[lines], kind="stable")][:MOST_LENGTHS_ALONE]
    for line in longest.tolist():
        rest = np.setdiff1d(lines, line).tolist()
        yield replace(whole.leave_out_lines(rest), survey=without)


def try_single_error(
    candidate: Candidate, restored: Mapping[str, Ints] | None = None
) -> Iterator[Candidate]:
    """Try one gross error in place of others, or of a misfit that has none.

    A single wrong pick can rotate its photo, so that many lengths and other picks of the photo no
    longer fit. Or a length is a gross error, and a wrong pick at one of its ends would explain as
    much. The linear model proposes single readings. For each, the restored gross errors take part
    again, and that reading is left out in their place.

    Parameters
    ----------
    candidate
        A robust adjustment.
    restored
        Rows of its gross errors, by group; None for all of them.
    """
    found = candidate.annealed
    gross = {name: found.gross(name) for name in found.misfit if len(found.gross(name))}
    if sum(map(len, gross.values())) > MOST_STARTS:
        return
    restored = gross if restored is None else restored
    whole, falls = falls_with_all(found, restored)
    proposed = sorted(
        (
            (fall, name, row)
            for name, each in falls.items()
            for row, fall in enumerate(each.tolist())
        ),
        reverse=True,
    )
    back = {(name, row) for name, rows in restored.items() for row in rows.tolist()}
    out = {(name, row) for name, rows in gross.items() for row in rows.tolist()} - back
    new = [one for one in proposed if one[1:] not in out and {one[1:]} != back]
    least = max(MIN_DECREASE_SHARE * whole, GROSS_SIGMAS**2)
    likely = [one for one in new if one[0] >= least][:MOST_PROPOSED]
    # Few control points hold a scene without a log: an error bends it beyond the linear model.
    if set(restored) == {"control"} and candidate.taking.survey.telemetry is None:
        others = (one for one in new if one[1] == "control" and one not in likely)
        likely += islice(others, MOST_PROPOSED)
    limit = bound_cost(candidate.taking, [candidate])
    for _, name, row in likely:
        weight = {one: np.ones(len(misfit)) for one, misfit in found.misfit.items()}
        for group, own in (*out, (name, row)):
            weight[group][own] = ZERO_WEIGHT
        with suppress(SingularError, ValueError):  # undetermined, or impossible
            minimum = minimise_weighted_cost(found.problem, found.minimum.state, weight)
            yield replace(candidate, annealed=decide(found.problem, minimum, weight, limit))


def exchange_gross_errors(candidate: Candidate) -> Iterator[Candidate]:
    """Try another reading in place of each gross error of a candidate that may be the wrong one.

    A length with a known mistake, such as another unit, has no rivals.
    """
    found = candidate.annealed
    gross = [(name, row) for name in READINGS for row in found.gross(name).tolist()]
    if len(gross) > MOST_GROSS_OF_A_PHOTO:
        return
    for name, row in gross:
        if name != "lengths" or not is_known_mistake(found, row):
            each = try_single_error(candidate, {name: np.array([row])})
            yield from (one for one in each if not one.misplaced)


def try_other_clicks(taking: Participants, candidate: Candidate) -> Iterator[Candidate]:
    """Adjust robustly with a gross click of a point in place of the others.

    A wrong click on the end of a length leads to another pose, in which the right one is gross.
    The others are those of the same photo, or of the only other one: more photos decide.
    """
    survey = taking.survey
    gross = np.setdiff1d(candidate.first.pick_index, candidate.used)
    gross = gross[are_ends(survey, survey.pick_label[gross])]
    if not 0 < len(gross) <= MOST_ALTERNATIVES:
        return
    whole, patience = add_small_roughness(taking), _choose_patience(taking, [candidate])
    for pick in gross.tolist():
        own = np.flatnonzero(whole.keep & (survey.pick_label == survey.pick_label[pick]))
        frame = survey.pick_frame[own]
        if len(np.unique(frame)) > MOST_CONTESTING:
            own = own[frame == survey.pick_frame[pick]]
        others = np.setdiff1d(own, gross)
        if len(others):
            rest = whole.leave_out_picks(dict.fromkeys(others.tolist(), DISAGREEING))
            yield from adjust_from_reduced(rest, whole, taking, patience)

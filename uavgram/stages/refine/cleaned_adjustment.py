"""Adjust without the gross errors of a candidate, as usual, and record what was left out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.first_poses.first_values import FirstValues
from uavgram.estimation.reliability.redundancy import GROSS_SIGMAS
from uavgram.estimation.solver.normal_equations import SingularError
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause, Reading, Refined
from uavgram.estimation.survey.observations.known import describe_thing
from uavgram.estimation.survey.observations.lengths import describe_ends
from uavgram.estimation.survey.selection import select_control
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import join_names, join_photo_names
from uavgram.model.survey import Survey
from uavgram.stages.refine.left_out import (
    report_control_exchanged,
    report_control_left_out,
    report_heights_left_out,
)
from uavgram.stages.refine.minima import (
    FULL,
    Participants,
    adjust_on_trial,
    find_best_minima,
    find_minima_from,
)
from uavgram.stages.refine.rival_errors import MAX_RIVAL_INCREASE, compute_repeated_cost
from uavgram.stages.refine.robust_adjustment import (
    ZERO_WEIGHT,
    Annealed,
    compute_squared_misfits,
    count_photos_of_picks,
    decide,
    minimise_weighted_cost,
)
from uavgram.stages.refine.robust_candidate import MISPLACED, OFF_GROUND_M, Candidate

CORRELATED_SIGMA_FACTOR = 3.0
"""Factor of the sigmas of poses of a log that is wrong as a whole: their errors go together."""

DISAGREEING = LeftOut(
    LeftOutCause.GROSS, "all other observations contradict it, and leave no place for its point"
)


@dataclass(frozen=True, eq=False)
class Robust:
    """Survey adjusted without its gross errors.

    Attributes
    ----------
    survey
        Survey without control points that are gross errors, and with a height of its own for each
        label that is off the ground.
    refined
        Its adjustment; `line_removed`, `known_removed`, `pick_reason` and `pose_widened` hold the
        other gross errors.
    control
        Rows of the control points of the original survey that were left out.
    labels
        Names of labels off the ground.
    heights
        Names of labels whose stated heights are gross errors: they have heights of their own.
    contradicting
        Names of labels whose picks contradict each other. These picks have sigmas as large as their
        misfit, since no observation shows which of them is wrong.
    exchanged
        Names of two control points that have each other's coordinates in `survey`; empty for none.
    """

    survey: Survey
    refined: Refined
    control: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    labels: tuple[str, ...] = ()
    heights: tuple[str, ...] = ()
    contradicting: tuple[str, ...] = ()
    exchanged: tuple[str, ...] = ()

    def count_others(self) -> int:
        """Count the gross errors that are no picks, lengths or poses of the log."""
        heights = len(self.labels) + len(self.heights)
        known = len(self.refined.known_removed)
        mistakes = int(bool(self.exchanged))
        return heights + known + len(self.control) + len(self.contradicting) + mistakes

    def count_numbers(self) -> int:
        """Count the numbers of these: two of a control point, or of a label that contradicts."""
        return self.count_others() + len(self.control) + len(self.contradicting)

    def messages(self, survey: Survey) -> Iterator[Message]:
        """Report what was left out of control and heights, and picks that contradict."""
        names = (survey.label[k] for k in survey.control_label[self.control])
        contested = [self.refined.is_contested("control", name) for name in names]
        control = self.control[~np.array(contested, dtype=np.bool_)]
        yield from report_control_left_out(survey, self.refined, control)
        if not self.refined.is_contested("control", _name_pair(self.exchanged)):
            yield from report_control_exchanged(survey, self.refined, self.exchanged)
        yield from report_heights_left_out(survey, self.refined, self.heights)
        for label in self.contradicting:
            own = survey.pick_label == survey.label.index(label)
            frames = tuple(dict.fromkeys(survey.frame_id[k] for k in survey.pick_frame[own]))
            what = f"{label!r} in {join_photo_names(frames)}"
            text = (
                f"The picks of {what} contradict each other. Nothing shows which of them is wrong, "
                "so what depends on it is uncertain by as much as they differ. Pick it again in "
                "these photos, or in another one too."
            )
            several = MessagePlural(
                "The picks of {count} points contradict each other",
                what,
                ending="Pick them again in these photos, or in another one too.",
            )
            yield Message(
                "warning",
                "picks-contradict",
                text,
                frames=frames,
                labels=(label,),
                several=several,
            )


def list_left_out(survey: Survey, robust: Robust) -> set[Reading]:
    """List the readings that a robust adjustment leaves out as gross errors."""
    label, refined = survey.label, robust.refined
    found: set[Reading] = set()
    for k in _list_gross_picks(refined):
        name, frame = label[survey.pick_label[k]], survey.frame_id[survey.pick_frame[k]]
        found.add(Reading("pixels", name, f"the click on {name!r} in {frame!r}", (name,), (frame,)))
    for k in np.flatnonzero(refined.line_removed).tolist():
        ends = (label[survey.line_start[k]], label[survey.line_end[k]])
        name = survey.line_name[k] if survey.line_name else ""
        found.add(Reading("lengths", name, f"the length {describe_ends(name, *ends)}", ends))
    for thing in survey.known:
        if thing.index in refined.known_removed:
            points = tuple(label[k] for k in thing.label)
            words = f"the known {describe_thing(thing.kind, thing.name, points)}"
            found.add(Reading("known", thing.name, words, points))
    for k in survey.control_label[robust.control].tolist():
        words = f"the coordinates of the control point {label[k]!r}"
        found.add(Reading("control", label[k], words, (label[k],)))
    if robust.exchanged:
        name = _name_pair(robust.exchanged)
        words = f"the coordinates of the control points {join_names(map(repr, robust.exchanged))}"
        found.add(Reading("control", name, f"{words} (exchanged)", robust.exchanged))
    return found


def _name_pair(names: Sequence[str]) -> str:
    """Return the name of two control points with exchanged coordinates, as of one reading."""
    return " and ".join(names)


def are_ends(survey: Survey, label: Ints) -> Bools:
    """Mark the labels (n,) at which a length ends."""
    return np.asarray(np.isin(label, survey.line_start) | np.isin(label, survey.line_end))


def _list_gross_picks(refined: Refined) -> set[int]:
    """Return picks that were left out as gross errors."""
    return {k for k, why in refined.pick_reason.items() if why.cause is LeftOutCause.GROSS}


def adjust_without_candidate(candidate: Candidate) -> Robust | None:
    """Adjust without the gross errors of a candidate, as usual; None where that has no result."""
    taking, first, found = candidate.taking, candidate.first, candidate.annealed
    survey, reduced, problem = taking.survey, found.problem.survey, found.problem
    picks = found.gross("pixels")
    # Picks that contradict each other stay, with a sigma as large as their misfit.
    lost = np.flatnonzero(np.isin(reduced.pick_label, _find_contradicting(found)))
    sigma_px = survey.pick_sigma_px.copy()
    sigma_px[first.pick_index[lost]] = _spread_px(found, lost)
    reason = {
        int(first.pick_index[row]): _far_off(found, row)
        for row in np.setdiff1d(picks, lost).tolist()
    }
    removed = taking.line_removed.copy()
    removed[first.line_index[problem.line_index[found.gross("lengths")]]] = True
    known = frozenset(problem.known[problem.known_thing[k]].index for k in found.gross("known"))
    # Points with gross roughness get heights of their own.
    rough = problem.third.rough[found.gross("roughness")]
    off_ground = rough[np.abs(found.minimum.state.point[rough, 2]) > OFF_GROUND_M]
    names = tuple(reduced.label[k] for k in off_ground)
    heights = tuple(reduced.label[k] for k in problem.third.stated[found.gross("heights")])
    wrong = {reduced.label[reduced.control_label[k]] for k in found.gross("control")}
    is_wrong = np.array([survey.label[k] in wrong for k in survey.control_label], dtype=np.bool_)
    wrong_poses = find_wrong_poses(found, taking.pose_widened)
    rest = replace(
        select_control(survey, ~is_wrong),
        is_free=survey.is_free | np.isin(survey.label, [*names, *heights]),
        pick_sigma_px=sigma_px,
    )
    left = replace(
        taking,
        survey=rest,
        line_removed=removed,
        known_removed=taking.known_removed | known,
        pose_widened={**taking.pose_widened, **wrong_poses},
    )
    left = left.leave_out_picks(reason)
    unplaced = {k: first.pick_reason.get(k, MISPLACED) for k in candidate.unplaced.tolist()}
    placed = left.leave_out_picks(unplaced)
    whole = None
    if unplaced:  # without the gross errors, first values may have a place for all picks
        whole = adjust_on_trial(left, FULL)
    if whole is not None:  # a pick that has a place there is not undetermined, but contradicts
        placed = placed.leave_out_picks(
            dict.fromkeys(
                np.intersect1d(candidate.unplaced, whole.pick_index).tolist(), DISAGREEING
            )
        )
    results = [_adjust_rest(placed, found), whole]
    number = int(left.keep.sum())
    refined = min(filter(None, results), key=lambda one: _cost_of_all(one, number), default=None)
    if refined is None:
        return None
    contradicting = tuple(reduced.label[k] for k in np.unique(reduced.pick_label[lost]))
    control = np.flatnonzero(is_wrong)
    return Robust(
        rest, refined, control, names, heights, contradicting, exchanged=candidate.exchanged
    )


def find_wrong_poses(found: Annealed, before: Mapping[str, float]) -> dict[str, float]:
    """Find poses by the log that are gross errors, and factors that enlarge their sigmas.

    Where they are half of the poses or more, together with earlier ones, the log as a whole is less
    exact than stated, and all its poses have one factor.

    Parameters
    ----------
    found
        A robust adjustment.
    before
        Factors by which sigmas of wrong poses are enlarged in it, by photo.

    Returns
    -------
    Factors of the stated sigmas, by photo.
    """
    prior, frame_id = found.problem.survey.telemetry, found.problem.survey.frame_id
    if prior is None:
        return {}
    squares = compute_squared_misfits(found.problem, found.minimum, found.weight)["telemetry"]
    name = [frame_id[k] for k in prior.frame_index]
    factor = np.sqrt(squares) * [before.get(one, 1.0) for one in name]
    rows = np.flatnonzero(squares > GROSS_SIGMAS**2)
    if 2 * len({name[k] for k in rows} | before.keys()) < len(name):
        return {name[k]: float(factor[k]) for k in rows}
    common = CORRELATED_SIGMA_FACTOR * float(np.sqrt(np.mean(factor**2)))
    return dict.fromkeys(name, common) if len(rows) else {}


def _adjust_rest(left: Participants, found: Annealed) -> Refined | None:
    """Adjust the rest, from the robust adjustment where other first values lead nowhere near it."""
    number = int(left.keep.sum())
    results: list[Refined] = []
    with suppress(GeometryError):
        results.append(find_best_minima(left))
    if not results or _cost_of_all(results[0], number) > (False, found.cost + MAX_RIVAL_INCREASE):
        with suppress(GeometryError):
            results.append(find_minima_from(left, lambda survey: [_first_values(found, survey)]))
    return min(results, key=lambda one: _cost_of_all(one, number), default=None)


def _cost_of_all(refined: Refined, picks: int) -> tuple[bool, float]:
    """Return a sort key of adjustments of so many picks: converged ones first, then by cost."""
    minimum, lost = refined.adjustment.minimum, picks - len(refined.pick_index)
    return not minimum.converged, minimum.cost + GROSS_SIGMAS**2 * lost


def _first_values(found: Annealed, survey: Survey) -> FirstValues:
    """Return first values from a robust adjustment that has the survey's labels and frames."""
    state, reduced = found.minimum.state, found.problem.survey
    frame = [reduced.frame_id.index(name) for name in survey.frame_id]
    label = [reduced.row_of_label[name] for name in survey.label]
    free = survey.is_free | (survey.height_sigma_m > 0)
    return FirstValues(
        point_m=state.point[label, :2],
        center=state.center[frame],
        rotation=state.rotation[frame],
        height_m=float(state.plane[0]),
        departure_m=np.where(free, state.point[label, 2], 0.0),
    )


def _find_contradicting(found: Annealed) -> list[int]:
    """Find labels whose picks contradict each other, without evidence for which of them is wrong.

    Either all picks of the label are gross errors, or others of its picks could be the gross errors
    with an equally good fit of the rest.
    """
    gross = np.zeros(len(found.problem.survey.pick_label), dtype=np.bool_)
    gross[found.gross("pixels")] = True
    survey = found.problem.survey
    label, count = survey.pick_label, len(survey.label)
    number, wrong = (np.bincount(of, minlength=count) for of in (label, label[gross]))
    place = survey.pick_frame * count + label
    photos, doubted = (count_photos_of_picks(survey, rows) for rows in (slice(None), gross))
    # Labels with gross picks in at least half of their photos.
    asked = np.flatnonzero((number > 1) & (2 * doubted >= photos)).tolist()
    # At the end of a length each click is tried in place of the others (`try_other_clicks`).
    repeated = label[gross & np.isin(place, place[~gross])]
    tried = set(repeated[are_ends(survey, repeated)].tolist())
    return [
        k
        for k in asked
        if wrong[k] == number[k]
        or (
            k not in tried
            and not _shows_photo_at_fault(found, gross, label == k)
            and _is_as_good(found, gross, label == k)
        )
    ]


def _shows_photo_at_fault(found: Annealed, gross: Bools, own: Bools) -> bool:
    """Return whether contradicting picks are of a photo in which picks of other points left too.

    Such errors go together, as of two labels that are swapped: the photo is in doubt, not the
    point.
    """
    frame = found.problem.survey.pick_frame
    others = np.bincount(frame[gross & ~own], minlength=frame.max() + 1)
    left, stayed = others[frame[gross & own]], others[frame[own & ~gross]]
    return bool(left.min() > stayed.max() or stayed.min() > left.max())


def _is_as_good(found: Annealed, gross: Bools, own: Bools) -> bool:
    """Return whether removed picks of a point may take the place of its remaining ones.

    Parameters
    ----------
    found
        The robust adjustment.
    gross, own
        Picks that take no part, and picks of the point.
    """
    problem = found.problem
    # Exchange the roles of the point's picks, and decide again.
    weight = {**found.weight, "pixels": np.where(gross ^ own, ZERO_WEIGHT, 1.0)}
    try:
        minimum = minimise_weighted_cost(problem, found.minimum.state, weight)
        other = decide(problem, minimum, weight, found.cost)
    except (SingularError, ValueError):  # undetermined, or impossible
        return False
    is_other = own & gross & (other.misfit["pixels"] <= GROSS_SIGMAS)
    cost, least = (one.cost - compute_repeated_cost(one) for one in (other, found))
    return bool(is_other.any()) and cost <= least + MAX_RIVAL_INCREASE


def _spread_px(found: Annealed, rows: Ints) -> Floats:
    """Compute sigmas (n,) [px] of picks of points whose picks contradict each other.

    Each is at least as large as the misfit of a gross pick, and such that the mean of a point's
    picks has a sigma of half the distance between them.
    """
    survey, misfit = found.problem.survey, found.misfit["pixels"][rows]
    blocks = found.problem.evaluate(found.minimum.state)
    assert blocks is not None  # noqa: S101  (the iterations ended there)
    own_px = survey.pick_sigma_px
    off_px = np.linalg.norm(blocks["pixels"].residual, axis=1) * own_px
    label = survey.pick_label[rows]
    # sigma = distance / 2 * sqrt(n), so that the mean of n picks has half the distance as sigma.
    spread_px = np.zeros(len(survey.label))
    for one in np.unique(label):
        mine = np.flatnonzero(survey.pick_label == one)
        takes_part = (found.misfit["pixels"][mine] <= GROSS_SIGMAS).any()
        # The point is at the picks that take part, or, if none does, between all of them.
        apart_px = off_px[mine].max() * (1.0 if takes_part else 2.0)
        spread_px[one] = apart_px / 2.0 * np.sqrt(len(mine))
    gross = misfit > GROSS_SIGMAS
    return np.asarray(np.maximum(spread_px[label], np.where(gross, misfit, 1.0) * own_px[rows]))


def _far_off(found: Annealed, row: int) -> LeftOut:
    """Describe the reason why a pick is a gross error."""
    blocks = found.problem.evaluate(found.minimum.state)
    assert blocks is not None  # noqa: S101  (the iterations ended there)
    sigma_px = found.problem.survey.pick_sigma_px[row]
    off_px = float(np.linalg.norm(blocks["pixels"].residual[row]) * sigma_px)
    return LeftOut(
        LeftOutCause.GROSS,
        f"all other observations contradict it: they show its point {off_px:.0f} px away",
    )

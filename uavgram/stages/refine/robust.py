"""Leave out gross errors by one robust adjustment over every kind of observation.

Graduated non-convexity (Blake and Zisserman 1987; Yang, Antonante, Tzoumas and Carlone 2020,
"Graduated non-convexity for robust spatial perception"): all readings begin with sigmas a hundred
times as large, so that first values need not be good, and each gets a weight by its own misfit
while the sigmas shrink to those stated. The misfit is standardised by what all other observations
know of it (Baarda's w, here of observations of any weight), so that a reading that bends its
neighbours is found, and not the neighbours. Observations that then stand beyond doubt take no part.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from uavgram.errors import GeometryError
from uavgram.estimation.reliability.test_statistics import cofactors
from uavgram.estimation.solver.levenberg_marquardt import Minimum, minimise
from uavgram.estimation.solver.normal_equations import Block, SingularError
from uavgram.estimation.survey.adjustment import LeftOut, LeftOutCause, Refined
from uavgram.estimation.survey.likelihood import SurveyProblem
from uavgram.estimation.survey.terms.tapes import tape_rows, taped_lines
from uavgram.estimation.survey.unknowns import State, advance
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, Several
from uavgram.model.naming import listed_photos
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.begin.softened import SLACK
from uavgram.stages.refine.continued import carried, lines_used
from uavgram.stages.refine.left_out import control_left_out
from uavgram.stages.refine.minima import Participants, best_minima
from uavgram.stages.refine.off_ground.shown import photos_of

READINGS = ("pixels", "lengths", "known", "control")
"""Groups whose sigmas shrink: what people read. Those of priors stay as they are stated."""

ROBUST = (*READINGS, "matches", "ties", "telemetry", "roughness", "heights", "tape")
"""Groups whose observations get weights."""

SCHEDULE = (100.0, 30.0, 10.0, 3.0, 1.0, 1.0, 1.0)
"""Factors of the sigmas of readings, one adjustment each."""

CAUCHY = 3.0
"""Standardised misfit at which an observation has half its weight."""

GROSS = 6.0
"""Standardised misfit beyond which an observation is a gross error, times the noise of its kind."""

MINOR = 5.0
"""The same in an ordinary adjustment from which on there may be gross errors at all."""

LEAST_REDUNDANCY = 0.01
"""Redundancy number below which nothing checks an observation, and its misfit says nothing."""

MOST_OF_A_KIND = 0.4
"""Share of a kind's observations that may be gross errors: with more, the kind is noisier."""

NOISIEST = 5.0
"""Factor by which sigmas of lengths, known things and control may be too small: with more, none of
them is right, as where all are in another unit."""

OFF_GROUND_M = 0.1
"""Departure from the ground from which on a point has a height of its own."""

MOST_ROUNDS = 6
"""Rounds in which observations leave and come back."""

NEARLY_NONE = 1e-8
"""Weight of what takes no part."""

EACH = 15
"""Iterations of each adjustment."""


@dataclass(frozen=True, eq=False)
class Outliers:
    """Observations that are gross errors, by index into the survey that was adjusted.

    Attributes
    ----------
    picks, lines, control, labels
        Picks, lengths, control points, and labels that are not on the ground.
    known
        Numbers of known things.
    """

    picks: Ints
    lines: Ints
    known: frozenset[int]
    control: Ints
    labels: Ints

    def __len__(self) -> int:
        every = (self.picks, self.lines, self.known, self.control, self.labels)
        return sum(len(one) for one in every)


@dataclass(frozen=True, eq=False)
class Annealed:
    """A robust adjustment.

    Attributes
    ----------
    problem, minimum
        Its likelihood with the stated sigmas, and where the weighted one ended.
    frames
        Names of frames most of whose picks are gross errors, or that the log has turned.
    weight
        Of each observation, by group.
    misfit
        Standardised misfit of each observation, by group, in units of its kind's noise.
    cost
        Sum of squares, each observation's no larger than a gross error's.
    """

    problem: SurveyProblem
    minimum: Minimum[State]
    frames: tuple[str, ...]
    weight: Mapping[str, Floats]
    misfit: Mapping[str, Floats]
    cost: float


def anneal(problem: SurveyProblem, state: State) -> Annealed:
    """Adjust robustly from first values.

    Raises
    ------
    SingularError
        An unknown is not determined.
    """
    noise: dict[str, float] = {}
    weight: dict[str, Floats] = {}
    minimum: Minimum[State] | None = None
    squares: dict[str, Floats] = {}
    for factor in SCHEDULE:
        scale = {name: factor if name in READINGS else 1.0 for name in ROBUST}
        if minimum is not None:
            squares = _squares(problem, minimum, weight)
            noise = _noise(squares) if factor == 1.0 else {}
            weight = {
                name: 1.0 / (1.0 + value / (CAUCHY * noise.get(name, 1.0)) ** 2)
                for name, value in squares.items()
            }
        minimum = _weighted(problem, state, weight, scale)
        state = minimum.state
    assert minimum is not None  # noqa: S101  (the schedule is not empty)
    return _decided(problem, minimum, weight)


def _decided(
    problem: SurveyProblem, minimum: Minimum[State], weight: Mapping[str, Floats]
) -> Annealed:
    """The adjustment in which each observation takes part whole, or not at all.

    What takes no part is predicted by the rest, and comes back where it agrees with that; so do
    neighbours of a gross error, which shared its misfit as long as all had weights. What has to
    leave a second time stays out.
    """
    out: dict[str, Bools] = {}
    frames: tuple[str, ...] = ()
    left: dict[str, Bools] = {}
    for _ in range(MOST_ROUNDS):
        squares = _squares(problem, minimum, weight)
        noise = _noise(squares)
        misfit = {name: np.sqrt(value) / noise[name] for name, value in squares.items()}
        now = {name: value > GROSS for name, value in misfit.items()}
        for name, gone in now.items():
            before = out.get(name, np.zeros_like(gone))
            came_back = left.get(name, np.zeros_like(before))
            gone[came_back & before] = True
            left[name] = came_back | (before & ~gone)
        if not out:
            bad = np.flatnonzero(_bad_frames(problem, minimum, now)).tolist()
            frames = tuple(problem.survey.frame_id[k] for k in bad)
        if not out and "roughness" in now:
            # Where a point's picks contradict the ground, they may agree on a height above it.
            off = problem.third.rough[now["roughness"]]
            now["pixels"] &= ~np.isin(problem.survey.pick_label, off)
        if out and "tape" in now:  # what single lengths do not explain
            now["lengths"] |= now["tape"][_tape_rows(problem)]
        if out and all(np.array_equal(gone, out[name]) for name, gone in now.items()):
            break
        out = now
        weight = {name: np.where(gone, NEARLY_NONE, 1.0) for name, gone in out.items()}
        minimum = _weighted(problem, minimum.state, weight, {})
    misfit = {
        name: np.where(out[name], np.maximum(value, 1.01 * GROSS), np.minimum(value, GROSS))
        for name, value in misfit.items()
    }
    blocks = problem.evaluate(minimum.state) or {}
    cost = sum(_truncated(name, block) for name, block in blocks.items())
    return Annealed(problem, minimum, frames, weight, misfit, cost)


def _bad_frames(problem: SurveyProblem, minimum: Minimum[State], out: Mapping[str, Bools]) -> Bools:
    """(F,) frames most of whose picks are gross errors, or whose camera the log has turned.

    A photo that was turned when it was picked fits by all its picks, but for the log.
    """
    survey = problem.survey
    frames = len(survey.frame_id)
    number = np.bincount(survey.pick_frame, minlength=frames)
    wrong = np.bincount(survey.pick_frame[out["pixels"]], minlength=frames)
    is_bad = (wrong > MOST_OF_A_FRAME * number) & (wrong > 2)
    if survey.telemetry is not None and out["telemetry"].any():
        blocks = problem.evaluate(minimum.state)
        assert blocks is not None  # noqa: S101  (the iterations ended there)
        turned = np.linalg.norm(blocks["telemetry"].residual[:, 3:], axis=1) > GROSS
        is_bad[survey.telemetry.frame_index[out["telemetry"] & turned]] = True
    few = is_bad.sum() <= MOST_OF_A_KIND * frames
    return np.asarray(is_bad & few)


def _tape_rows(problem: SurveyProblem) -> Ints:
    """(n,) the tape of each length that takes part."""
    return tape_rows(problem.tapes, taped_lines(problem.survey, problem.line_index).tape)


def _truncated(name: str, block: Block) -> float:
    square = np.sum(block.residual**2, axis=1)
    return float(np.minimum(square, GROSS**2).sum() if name in ROBUST else square.sum())


def _weighted(
    problem: SurveyProblem, state: State, weight: Mapping[str, Floats], scale: Mapping[str, float]
) -> Minimum[State]:
    """The minimum with weights and factors of the sigmas."""

    def evaluate(now: State) -> dict[str, Block] | None:
        blocks = problem.evaluate(now)
        return blocks and {
            name: _scaled(block, np.sqrt(weight.get(name, ONE)) / scale.get(name, 1.0))
            for name, block in blocks.items()
        }

    layout = problem.layout
    return minimise(
        state,
        evaluate,
        lambda now, step: advance(layout, now, step),
        layout.size,
        layout.structure,
        EACH,
        at_rest=1e-4,
        slack=SLACK,
    )


ONE = np.ones(1)


def _scaled(block: Block, by: Floats) -> Block:
    """Rows times factors, (n,) or (1,) for all."""
    if (by == 1.0).all():
        return block
    each = np.broadcast_to(by, len(block.residual))
    return Block(
        block.residual * each[:, None], block.columns, block.jacobian * each[:, None, None]
    )


def _squares(
    problem: SurveyProblem, minimum: Minimum[State], weight: Mapping[str, Floats]
) -> dict[str, Floats]:
    """Squared standardised misfits (n,) of all observations, by group.

    Of an observation of weight w, with whitened residual r at full weight and the cofactor matrix
    Q = I - w A of the weighted one (A: what the unknowns' covariance makes of its prediction), the
    error of the prediction without it is Q^-1 r, and its covariance I + Q^-1 A; so the square is
    r^T [(Q + A) Q]^-1 r. With w = 1 this is Baarda's statistic, with w = 0 the prediction's.
    """
    covariance = minimum.factor.covariance()
    found = {}
    for name in ROBUST:
        block = minimum.blocks.get(name)
        if block is None or not len(block.residual):
            continue
        own = weight.get(name, np.ones(len(block.residual)))
        redundancy, axes = np.linalg.eigh(cofactors(block, covariance))
        along = np.einsum("nra,nr->na", axes, block.residual) / np.sqrt(own)[:, None]
        checked = redundancy > LEAST_REDUNDANCY
        redundancy = np.where(checked, redundancy, 1.0)
        predicted = np.maximum(1.0 - redundancy, 0.0) / own[:, None]
        each = along**2 / ((redundancy + predicted) * redundancy)
        found[name] = np.sum(np.where(checked, each, 0.0), axis=1)
    if "roughness" in found:  # one photo alone shows no height
        seen = photos_of(problem.survey)[problem.third.rough]
        found["roughness"][seen < 2] = 0.0
    return found


def _noise(squares: Mapping[str, Floats]) -> dict[str, float]:
    """By what the sigmas of each kind are too small, at least one: from most of them.

    The median of the squares of what is checked over that of chi-square; of few, the value that
    leaves no more than a share of them as gross errors.
    """
    factor = {}
    for name, value in squares.items():
        checked = value[value > 0]
        factor[name] = 1.0
        if len(checked):
            middle = float(np.quantile(checked, 0.5)) / MEDIAN[name]
            factor[name] = max(1.0, float(np.sqrt(middle))) if len(checked) >= 8 else 1.0
            most = max(1, int(MOST_OF_A_KIND * len(checked)))
            least = np.sort(checked)[::-1][most] if most < len(checked) else 0.0
            factor[name] = max(factor[name], float(np.sqrt(least)) / GROSS)
            if name in ("lengths", "known", "control"):
                factor[name] = min(factor[name], NOISIEST)
    return factor


MEDIAN = {
    "pixels": 1.386,
    "matches": 1.386,
    "ties": 1.386,
    "lengths": 0.455,
    "known": 0.455,
    "control": 2.366,
    "telemetry": 5.348,
    "tape": 0.455,
    "roughness": 0.455,
    "heights": 0.455,
}
"""Medians of chi-square with as many degrees of freedom as an observation of each kind has."""


@dataclass(frozen=True, eq=False)
class Robust:
    """A survey adjusted without its gross errors.

    Attributes
    ----------
    survey
        Without control points that are gross errors, and with heights of its own for each label
        that is off the ground.
    refined
        Its adjustment; `line_removed`, `known_removed` and `pick_reason` have the rest.
    control
        Control points of the survey handed in that were left out.
    labels
        Names of labels off the ground.
    contradicting
        Names of labels whose picks contradict each other: they have sigmas as large as their
        misfit, since nothing shows which of them is wrong.
    """

    survey: Survey
    refined: Refined
    control: Ints
    labels: tuple[str, ...] = ()
    contradicting: tuple[str, ...] = ()

    def messages(self, survey: Survey) -> Iterator[Message]:
        """Report control points that were left out of a survey, and picks that contradict."""
        yield from control_left_out(survey, self.refined, self.control)
        for label in self.contradicting:
            own = survey.pick_label == survey.label.index(label)
            frames = tuple(dict.fromkeys(survey.frame_id[k] for k in survey.pick_frame[own]))
            text = (
                f"The picks of {label!r} contradict each other, in {listed_photos(frames)}. "
                "Nothing shows which of them is wrong, so the point is uncertain by as much as "
                "they differ. Pick it anew in these photos, or in another one too."
            )
            yield Message(
                "warning",
                "picks-contradict",
                text,
                frames=frames,
                labels=(label,),
                several=Several(
                    "The picks of {count} points contradict each other",
                    f"{label!r} in {listed_photos(frames)}",
                    ending="Pick them anew in these photos, or in another one too.",
                ),
            )


def adjust_robustly(taking: Participants, plain: Refined | None = None) -> Robust:
    """Adjust without observations that are gross errors.

    Parameters
    ----------
    taking
        What takes part.
    plain
        Its ordinary adjustment, where that is known.

    Raises
    ------
    GeometryError
        The observations do not determine the survey.
    """
    none = np.zeros(0, dtype=np.int64)
    failed: GeometryError | None = None
    try:
        plain = plain or best_minima(taking)
        if _is_in_order(taking, plain):
            return Robust(taking.survey, plain, none)
    except GeometryError as why:
        failed = why
    agreed = _most_agreed(taking)
    while agreed and agreed[0].annealed.frames:
        best = agreed[0]
        without = _most_agreed(best.taking.without_frames(best.annealed.frames, MISPLACED))
        if not without:
            break
        agreed = without
    found = _without_outliers(agreed)
    if found is not None:
        return found
    if plain is None:
        assert failed is not None  # noqa: S101  (one of the two is always there)
        raise failed
    return Robust(taking.survey, plain, none)


def _is_in_order(taking: Participants, refined: Refined) -> bool:
    """Whether an ordinary adjustment leaves nothing to be asked."""
    adjustment = refined.adjustment
    if not adjustment.minimum.converged or len(refined.pick_reason) > len(taking.reason):
        return False
    squares = _squares(adjustment.problem, adjustment.minimum, {})
    return all(value.max(initial=0.0) < MINOR**2 for value in squares.values())


@dataclass(frozen=True, eq=False)
class Candidate:
    """A robust adjustment from certain first values.

    Attributes
    ----------
    taking
        What takes part.
    first
        The adjustment that it began from.
    annealed
        Where it ended.
    """

    taking: Participants
    first: Refined
    annealed: Annealed

    def cost(self, picks: int) -> float:
        """Of the adjustment; each of so many picks that has no place in it counts as gross."""
        return self.annealed.cost + GROSS**2 * (picks - len(self.first.pick_index))

    def is_agreed(self, picks: int) -> bool:
        """Whether nearly everything takes part, and no other length could be wrong instead."""
        if len(self.first.pick_index) < picks:
            return False
        misfit = list(self.annealed.misfit.values())
        gross = sum(int((one > GROSS).sum()) for one in misfit)
        if gross > max(1, AGREED * sum(map(len, misfit))):
            return False
        lengths = np.flatnonzero(self.annealed.misfit.get("lengths", np.zeros(0)) > GROSS)
        return not any(_has_rival(self.annealed, row) for row in lengths.tolist())


def _has_rival(found: Annealed, row: int) -> bool:
    """Whether another length explains the misfit of one that was left out, in the linear model.

    With the length back, the unknowns move by -S J^T V^-1 e, where e is its error, V = 1 + J S J^T
    the variance of that and S the covariance of the unknowns; the residuals r and cofactors Q of
    the others become r - X V^-1 e and Q + X V^-1 X^T, with X = J' S J^T. The other is a rival where
    the sum of squares then falls nearly as much without it as without the length.
    """
    minimum = found.minimum
    block, weight = minimum.blocks["lengths"], np.sqrt(found.weight["lengths"])
    own = block.jacobian[row, 0] / weight[row]
    right = np.zeros((found.problem.layout.size, 1))
    np.add.at(right[:, 0], block.columns[row], own)
    pull = minimum.factor.solve(right)
    variance = 1.0 + float(right[:, 0] @ pull[:, 0])
    error = float(block.residual[row, 0] / weight[row])
    moved = block.times(slice(None), pull)[:, 0, 0]
    residual = block.residual[:, 0] - moved * error / variance
    cofactor = cofactors(block, minimum.factor.covariance())[:, 0, 0] + moved**2 / variance
    others = (found.misfit["lengths"] <= GROSS) & (cofactor > LEAST_REDUNDANCY)
    fall = residual[others] ** 2 / cofactor[others]
    return bool((fall > error**2 / variance - RIVAL).any())


MOST_ALTERNATIVES = 4
"""Other minima with hundredfold sigmas from which robust adjustments begin."""

MOST_STARTS = 12
"""Lengths, and photos, that are left out of the first values in turn."""

AGREED = 0.03
"""Share of all observations, and at least one, that may be gross errors where no other first values
are tried."""


def _most_agreed(taking: Participants) -> list[Candidate]:
    """Robust adjustments from all first values, that of least cost first."""
    picks, found = int(taking.keep.sum()), list[Candidate]()
    for candidate in _candidates(taking):
        found.append(candidate)
        if candidate.is_agreed(picks):
            return [candidate]
    return sorted(found, key=lambda one: one.cost(picks))


def _without_outliers(agreed: Sequence[Candidate]) -> Robust | None:
    """The ordinary adjustment without gross errors; None where there is none.

    Others that explain as much without other observations are its alternatives.
    """
    best, *others = agreed or (None,)
    robust = None if best is None else _without(best)
    if best is None or robust is None:
        return None
    picks = int(best.taking.keep.sum())
    refined, own = robust.refined, robust.refined.line_removed
    rivals: set[int] = set()
    minima = [*refined.alternatives]
    for other in others:
        if other.cost(picks) - best.cost(picks) > RIVAL:
            break
        rival = _without(other)
        lines = np.zeros_like(own) if rival is None else rival.refined.line_removed & ~own
        if rival is None or not lines.any():
            continue
        rivals |= set(np.flatnonzero(lines).tolist())
        if rival.refined.adjustment.survey.label == refined.adjustment.survey.label:
            minima.append(rival.refined.adjustment)
    names = frozenset(robust.survey.line_name[k] for k in rivals if robust.survey.line_name)
    return replace(robust, refined=replace(refined, alternatives=tuple(minima), rival_lines=names))


RIVAL = 2.0 * float(np.log(20.0))
"""Difference of costs up to which another explanation has odds of more than 1 in 20."""


def _candidates(taking: Participants) -> Iterator[Candidate]:
    """Robust adjustments from hundredfold sigmas; then from first values without what may be wrong.

    First values may hang on a wrong length, or on a photo that shows something else: so each of
    these is left out in turn.
    """
    for candidate in _from(replace(taking, survey=_softer(taking.survey, SCHEDULE[0]))):
        yield replace(candidate, taking=taking)
    rough = replace(taking, survey=_softer(taking.survey, 1.0))
    lines = np.flatnonzero(~taking.line_removed)
    for line in lines.tolist() if 3 < len(lines) <= MOST_STARTS else ():
        for candidate in _from(rough.without_lines([line]), back=line):
            yield replace(candidate, taking=taking)
    frames = np.unique(taking.survey.pick_frame[taking.keep])
    if taking.survey.telemetry is None and 2 < len(frames) <= MOST_STARTS:
        for frame in frames.tolist():
            soft = replace(taking, survey=_softer(taking.survey, SCHEDULE[0]))
            for candidate in _from(soft.without_frame(frame, MISPLACED)):
                yield replace(candidate, taking=taking.without_frame(frame, MISPLACED))


def _from(taking: Participants, back: int | None = None) -> Iterator[Candidate]:
    """Robust adjustments from all minima of what takes part.

    Parameters
    ----------
    taking
        What takes part, with hundredfold sigmas; or with those stated, where `back` is given.
    back
        A length that takes no part, and whose misfit there is asked.
    """
    try:
        first = best_minima(taking)
    except GeometryError:
        return
    softness = SCHEDULE[0] if back is None else 1.0
    for adjustment in (first.adjustment, *first.alternatives[:MOST_ALTERNATIVES]):
        used = lines_used(adjustment)
        if back is not None:
            used |= first.line_index == back
        survey = _softer(adjustment.survey, 1.0 / softness)
        problem = SurveyProblem(survey, adjustment.problem.pivot_m, used)
        state = carried(adjustment, problem)
        try:
            if back is None:
                yield Candidate(taking, first, anneal(problem, state))
                continue
            out = first.line_index[problem.line_index] == back
            weight = {"lengths": np.where(out, NEARLY_NONE, 1.0)}
            minimum = _weighted(problem, state, weight, {})
            yield Candidate(taking, first, _decided(problem, minimum, weight))
        except (SingularError, ValueError):
            continue


def _softer(survey: Survey, factor: float) -> Survey:
    """The survey with larger sigmas of readings, and ground that is rough at least a little."""
    return replace(
        survey,
        pick_sigma_px=factor * survey.pick_sigma_px,
        length_sigma_m=factor * survey.length_sigma_m,
        control_sigma_m=factor * survey.control_sigma_m,
        known=tuple(replace(one, sigma=factor * one.sigma) for one in survey.known),
        grounds=tuple(
            replace(one, roughness_sigma_m=max(one.roughness_sigma_m, LEAST_ROUGHNESS_M))
            for one in survey.grounds
        ),
        tape_scale_sigma=max(survey.tape_scale_sigma, LEAST_TAPE_SCALE),
        own_scale_sigma=tuple(
            (name, max(sigma, LEAST_TAPE_SCALE)) for name, sigma in survey.own_scale_sigma
        ),
    )


LEAST_ROUGHNESS_M = 0.02
"""Roughness of the ground with which points off it are looked for, where less is stated."""


LEAST_TAPE_SCALE = 1e-3
"""Sigma of the scale of a tape, where less is stated: an outlier of it are all lengths together."""


MISPLACED = LeftOut(
    LeftOutCause.MISPLACED_FRAME,
    "most of its picks contradict the other photos, the lengths and the log: look for labels in "
    "disorder, for a photo of another place, or one that was mirrored or turned",
)

MOST_OF_A_FRAME = 0.5
"""Share of a frame's picks that are gross errors, from which on the frame is not used."""


def _outliers(found: Annealed) -> Outliers:
    """What a robust adjustment shows to be gross errors."""
    problem = found.problem

    def rows(name: str) -> Ints:
        return np.flatnonzero(found.misfit.get(name, np.zeros(0)) > GROSS)

    rough = problem.third.rough[rows("roughness")]
    off = np.abs(found.minimum.state.point[rough, 2]) > OFF_GROUND_M
    return Outliers(
        picks=rows("pixels"),
        lines=problem.line_index[rows("lengths")],
        known=frozenset(problem.known[k].index for k in problem.known_thing[rows("known")])
        if problem.known
        else frozenset(),
        control=rows("control"),
        labels=rough[off],
    )


def _without(best: Candidate) -> Robust | None:
    """The ordinary adjustment of what is no gross error; None where that has no result."""
    taking, first, found = best.taking, best.first, best.annealed
    out, reduced = _outliers(found), found.problem.survey
    survey = taking.survey
    reason: dict[int, LeftOut] = {}
    lost = _contradicting(reduced, out.picks)
    sigma_px = survey.pick_sigma_px.copy()
    sigma_px[first.pick_index[lost]] *= found.misfit["pixels"][lost]
    for row in np.setdiff1d(out.picks, lost).tolist():
        reason[int(first.pick_index[row])] = _far_off(found, row)
    removed = taking.line_removed.copy()
    removed[first.line_index[out.lines]] = True
    names = tuple(reduced.label[k] for k in out.labels)
    control_names = {reduced.label[reduced.control_label[k]] for k in out.control}
    control = np.array(
        [k for k, of in enumerate(survey.control_label) if survey.label[of] in control_names],
        dtype=np.int64,
    )
    is_free = survey.is_free | np.isin(survey.label, names)
    stays = np.ones(len(survey.control_label), dtype=np.bool_)
    stays[control] = False
    rest = replace(
        survey,
        is_free=is_free,
        pick_sigma_px=sigma_px,
        control_label=survey.control_label[stays],
        control_world_m=survey.control_world_m[stays],
        control_sigma_m=survey.control_sigma_m[stays],
    )
    keep = taking.keep.copy()
    keep[list(reason)] = False
    left = Participants(
        rest, keep, removed, {**taking.reason, **reason}, taking.known_removed | out.known
    )
    try:
        refined = best_minima(left)
    except GeometryError:
        return None
    contradicting = tuple(reduced.label[k] for k in np.unique(reduced.pick_label[lost]))
    return Robust(rest, refined, control, names, contradicting)


def _contradicting(survey: Survey, out: Ints) -> Ints:
    """(n,) gross picks of labels of which all picks are gross: they contradict each other."""
    number = np.bincount(survey.pick_label, minlength=len(survey.label))
    gross = np.bincount(survey.pick_label[out], minlength=len(survey.label))
    is_lost = (gross == number) & (number > 1)
    return np.asarray(out[is_lost[survey.pick_label[out]]])


def _far_off(found: Annealed, row: int) -> LeftOut:
    """Why a pick takes no part."""
    survey = found.problem.survey
    block = found.problem.evaluate(found.minimum.state)
    off = (
        0.0
        if block is None
        else float(np.linalg.norm(block["pixels"].residual[row])) * float(survey.pick_sigma_px[row])
    )
    return LeftOut(
        LeftOutCause.GROSS,
        f"all other observations contradict it: they show its point {off:.0f} px away; look at "
        "its place and its label",
    )

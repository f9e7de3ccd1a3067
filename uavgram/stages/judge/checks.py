"""Test withheld lengths and check points, each by itself and all together.

They share poses, so their errors are correlated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.estimation.reliability.redundancy import compute_upper_tail
from uavgram.estimation.reliability.stated_values import describe_displacement, explain_coordinates
from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.lengths import TapedLengths, select_taped_known
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import format_odds
from uavgram.model.observations import KnownLines, KnownWorldPoints
from uavgram.model.result.reliability import ChecksOverall
from uavgram.model.result.tables import PointChecks


@dataclass(frozen=True, eq=False)
class Withheld:
    """Set of C withheld readings and coordinates, compared with the adjustment.

    Attributes
    ----------
    names
        Names of the K lengths and points, the lengths first.
    lengths
        Number of the lengths.
    of
        (C,) index of the length or point of each value.
    stated, error
        (C,) stated values, and adjusted minus stated values [m].
    solved
        (size, C) covariance of the unknowns times the gradients of the values.
    joint
        (C, C) covariance of the errors.
    """

    names: tuple[str, ...]
    lengths: int
    of: Ints
    stated: Floats
    error: Floats
    solved: Floats
    joint: Floats

    def fits(self, limit: float) -> Bools:
        """Mark values (C,) whose error is at most so many of their sigmas."""
        return np.asarray(np.abs(self.error) <= limit * np.sqrt(np.diag(self.joint)))


def compare_withheld(
    adjustment: Adjustment, lines: KnownLines, known: KnownWorldPoints
) -> Withheld | None:
    """Compare withheld values with an adjusted survey; None where none was withheld, or was seen.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    lines
        All known lengths; the withheld ones that were seen are judged.
    known
        Check points; judged where coordinates have a meaning.
    """
    start, end = adjustment.label_rows(lines.start), adjustment.label_rows(lines.end)
    row = np.flatnonzero(~lines.adjust & (start >= 0) & (end >= 0))
    label = _find_judged_rows(adjustment, known)
    chosen = np.flatnonzero(label >= 0)
    if not len(row) and not len(chosen):
        return None
    taped = select_taped_known(lines, row, start[row], end[row])
    value, unknown, gradient = _values(adjustment, taped, label[chosen])
    stated = np.concatenate([lines.length_m[row], known.world_m[chosen].ravel()])
    sigma = np.concatenate([lines.sigma_m[row], known.sigma_m[chosen].ravel()])
    right = np.zeros((adjustment.minimum.factor.size, len(value)))
    np.add.at(right, (unknown, np.arange(len(value))[:, None]), gradient)
    solved = adjustment.minimum.factor.solve(right)
    # Joint covariance: propagated unknowns, stated sigmas, and scales of tapes not in the survey.
    joint = right.T @ solved
    joint = 0.5 * (joint + joint.T) + np.diag(sigma**2)
    tapes = adjustment.unlearnt(taped, value[: len(row)])
    joint[: len(row), : len(row)] += tapes @ tapes.T
    return Withheld(
        names=(*(lines.name[i] for i in row), *(known.label[i] for i in chosen)),
        lengths=len(row),
        of=np.concatenate([np.arange(len(row)), len(row) + np.arange(3 * len(chosen)) // 3]),
        stated=stated,
        error=value - stated,
        solved=solved,
        joint=joint,
    )


def judge_overall(
    adjustment: Adjustment, withheld: Withheld | None, significance: float
) -> tuple[ChecksOverall | None, tuple[Message, ...]]:
    """Test all checks with their joint covariance by one chi-square; None where none was withheld.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    withheld
        Its withheld values.
    significance
        Probability below which the checks as a whole do not fit.
    """
    if withheld is None:
        return None, ()
    error, joint, lengths = withheld.error, withheld.joint, withheld.lengths
    squared = float(error @ np.linalg.solve(joint, error))
    share = np.abs(error[:lengths]) / withheld.stated[:lengths]
    overall = ChecksOverall(
        count=len(error),
        chi2=squared,
        probability=compute_upper_tail(squared, len(error)),
        rms_error_m=float(np.sqrt(np.mean(error**2))),
        mean_error_percent=float(100.0 * share.mean()) if lengths else np.nan,
    )
    if overall.probability >= significance or not adjustment.minimum.converged:
        return overall, ()
    off = _find_single_misfits(error, joint, withheld.of, significance)
    return overall, (_checks_message(overall, list(withheld.names), off, lengths),)


def _find_judged_rows(adjustment: Adjustment, known: KnownWorldPoints) -> Ints:
    """Return rows (C,) of check points among the adjusted ones; none without a world frame."""
    is_free = adjustment.survey.gauge == "plane"
    return adjustment.label_rows(() if is_free else known.label)


def _values(
    adjustment: Adjustment, taped: TapedLengths, label: Ints
) -> tuple[Floats, Ints, Floats]:
    """Return readings, then coordinates (n,), and gradients (n, k) by the unknowns (n, k)."""
    length, by_length, columns = adjustment.problem.readings(adjustment.state, taped)
    world, by_point, unknowns = adjustment.points_with_jacobian(label)
    value = np.concatenate([length, world.ravel()])
    unknown = np.zeros((len(value), columns.shape[1]), dtype=np.int64)
    gradient = np.zeros(unknown.shape)
    unknown[: len(length)], gradient[: len(length)] = columns, by_length
    of_point = slice(len(length), None), slice(unknowns.shape[1])  # a length has two points
    unknown[of_point] = np.repeat(unknowns, 3, axis=0)
    gradient[of_point] = by_point.reshape(world.size, unknowns.shape[1])
    return value, unknown, gradient


def _find_single_misfits(error: Floats, joint: Floats, of: Ints, significance: float) -> list[int]:
    """Find few checks that do not fit by themselves, if all others fit without them; else none.

    Parameters
    ----------
    error, joint
        (n,), (n, n) all errors and their covariance.
    of
        (n,) index of the check of each error.
    """
    off = []
    for check in range(int(of[-1]) + 1):
        own = np.flatnonzero(of == check)
        squared = float(error[own] @ np.linalg.solve(joint[np.ix_(own, own)], error[own]))
        if compute_upper_tail(squared, len(own)) < significance:
            off.append(check)
    rest = np.flatnonzero(~np.isin(of, off))
    if not off or not len(rest) or 2 * len(off) > int(of[-1]) + 1:
        return []
    squared = float(error[rest] @ np.linalg.solve(joint[np.ix_(rest, rest)], error[rest]))
    return off if compute_upper_tail(squared, len(rest)) >= significance else []


def _checks_message(
    overall: ChecksOverall, names: list[str], off: list[int], lengths: int
) -> Message:
    """Report a misfit of the checks: `off` are rows of `names`, of which the first are lengths."""
    cause = (
        "the stated errors of lengths, picks or log are too small, or something common to all is "
        "wrong. Until this is cleared up, do not trust the uncertainties"
    )
    if off:
        cause = (
            f"that is {', '.join(repr(names[k]) for k in off)} alone; the other "
            f"{len(names) - len(off)} fit. Look there first"
        )
    text = (
        f"The withheld lengths and points are further off than their uncertainties allow: {cause} "
        f"({overall.count} values; chance alone does this "
        f"{format_odds(overall.probability)} times)."
    )
    return Message(
        "warning",
        "checks-misfit",
        text,
        lengths=tuple(names[k] for k in off if k < lengths),
        labels=tuple(names[k] for k in off if k >= lengths),
    )


FEW_CHECKS = 3
"""Number of check points above which a misfit of most of them is one fault and not several."""


def judge_points(
    adjustment: Adjustment, known: KnownWorldPoints, significance: float
) -> tuple[PointChecks, tuple[Message, ...]]:
    """Compare check points with their known coordinates; report misfits and points never picked.

    Nothing is judged with gauge ``plane``, where coordinates have no meaning.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    known
        Check points in the world [m].
    significance
        Probability of a false suspicion in a survey without errors.
    """
    index = _find_judged_rows(adjustment, known)
    seen = np.flatnonzero(index >= 0)
    position, covariance = adjustment.points()
    error = position[index[seen]] - known.world_m[seen]
    joint = covariance[index[seen]] + known.sigma_m[seen][:, :, None] ** 2 * np.eye(3)
    # Squared Mahalanobis distances, chi-square with three degrees of freedom.
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(joint, error[..., None])[..., 0])
    checks = PointChecks(
        label=tuple(known.label[i] for i in seen),
        error_m=error,
        sigma_m=np.sqrt(np.einsum("nii->ni", joint)),
        mahalanobis=np.sqrt(squared),
    )
    messages = [
        Message(
            "warning",
            "check-unseen",
            f"The check point {known.label[i]!r} has no usable pick: pick it, or correct its name.",
            labels=(known.label[i],),
            several=MessagePlural(
                "{count} check points have no usable pick",
                repr(known.label[i]),
                ending="Pick them, or correct their names.",
            ),
        )
        for i in np.flatnonzero(index < 0)
    ]
    if adjustment.minimum.converged:
        off = [compute_upper_tail(float(each), 3) < significance for each in squared]
        messages += _report_suspects(checks, known.world_m[seen], np.flatnonzero(off))
    return checks, tuple(messages)


def _report_suspects(checks: PointChecks, stated_m: Floats, off: Ints) -> list[Message]:
    """Report each check point that is off; or all in one message, where most of several are.

    Parameters
    ----------
    checks
        Comparison of C points.
    stated_m
        (C, 3) their known coordinates.
    off
        Rows of those that are off.
    """
    found_m = stated_m + checks.error_m
    if len(off) < FEW_CHECKS or 2 * len(off) <= len(checks.label):
        return [_off(checks, int(i), explain_coordinates(stated_m[i], found_m[i])) for i in off]
    middle, sigma = (np.median(each[off], axis=0) for each in (-checks.error_m, checks.sigma_m))
    likely = explain_coordinates(np.median(stated_m[off], axis=0), np.median(found_m[off], axis=0))
    text = (
        f"{len(off)} of {len(checks.label)} check points are off, the median "
        f"{describe_displacement(middle, sigma)}. Check their common data: the datum of their "
        f"heights, their coordinate system{likely} and the origin."
    )
    labels = tuple(checks.label[i] for i in off)
    return [Message("warning", "check-suspect", text, labels=labels)]


def _off(checks: PointChecks, i: int, likely: str) -> Message:
    label, where = checks.label[i], describe_displacement(-checks.error_m[i], checks.sigma_m[i])
    several = MessagePlural(
        "{count} check points are off",
        f"{label!r} is {where}{likely}",
        ending="Look at their coordinates and their picks.",
    )
    text = f"The check point {label!r} is {where}: look at its coordinates{likely} and its picks."
    return Message("warning", "check-suspect", text, labels=(label,), several=several)

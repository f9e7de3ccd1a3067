"""Judge: how every length, pick, prior and check fits the adjusted survey."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from uavgram.estimation.adjustment import Adjustment, Refined
from uavgram.estimation.reliability import (
    correlated_w,
    critical_value,
    group_fit,
    minimal_detectable_bias,
    reliability,
)
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message
from uavgram.model.observations import KnownLines, KnownWorldPoints
from uavgram.model.result import (
    GroupFactor,
    LineChecks,
    LineResults,
    LineStatus,
    PickResults,
    PickStatus,
    PointChecks,
)

PRIOR_NAMES = {
    "boresight": ("boresight x", "boresight y", "boresight z"),
    "lever_arm": ("lever arm forward", "lever arm right", "lever arm down"),
    "position_bias": ("position bias east", "position bias north", "position bias up"),
    "heading_bias": ("heading bias",),
    "clock": ("clock offset",),
    "plane": ("ground height", "ground slope east", "ground slope north"),
}
POSE_AXES = ("east", "north", "up", "image x axis", "image y axis", "optical axis")


@dataclass(frozen=True, kw_only=True, eq=False)
class PickTable:
    """All P picks of the project, defaults filled in, and where each stands in the survey.

    Attributes
    ----------
    image, label, pixel_px, sigma_px
        As given.
    survey_index
        (P,) into the picks of the survey handed to refine; -1 for those of unmatched frames.
    """

    image: tuple[str, ...]
    label: tuple[str, ...]
    pixel_px: Floats
    sigma_px: Floats
    survey_index: Ints


def judge_picks(
    refined: Refined, table: PickTable, significance: float
) -> tuple[PickResults, tuple[Message, ...]]:
    """Residual, w, redundancy and status of every pick."""
    count = len(table.image)
    residual, w = np.full((count, 2), np.nan), np.full(count, np.nan)
    redundancy = np.full(count, np.nan)
    status: list[PickStatus] = ["unused"] * count
    adjustment = refined.adjustment
    block = adjustment.minimum.blocks["pixels"]
    numbers = reliability(block, adjustment.covariance)
    row_of = {int(s): row for row, s in enumerate(refined.pick_index)}
    messages = []
    for i, survey_index in enumerate(table.survey_index):
        row = row_of.get(int(survey_index), -1)
        if survey_index >= 0 and refined.pick_removed[survey_index]:
            status[i] = "removed"
        if row < 0:
            continue
        residual[i] = block.residual[row] * table.sigma_px[i]
        w[i] = numbers.w[row][np.abs(numbers.w[row]).argmax()]
        redundancy[i] = numbers.redundancy[row].mean()
        suspect = abs(w[i]) > critical_value(significance)
        status[i] = "suspect" if suspect else "used"
        if suspect:
            text = (
                f"The pick of {table.label[i]!r} in {table.image[i]!r} does not fit (w = "
                f"{w[i]:.1f}, residual {residual[i, 0]:+.1f}, {residual[i, 1]:+.1f} px): look at "
                "the place and at the label."
            )
            messages.append(Message("warning", "pick-suspect", text))
    results = PickResults(
        image=table.image,
        label=table.label,
        pixel_px=table.pixel_px,
        sigma_px=table.sigma_px,
        residual_px=residual,
        w=w,
        redundancy=redundancy,
        status=tuple(status),
    )
    return results, tuple(messages)


def judge_lines(
    refined: Refined, lines: KnownLines, survey_index: Ints, significance: float
) -> tuple[LineResults, LineChecks, tuple[Message, ...]]:
    """Adjusted length, residual, w, redundancy and status of every known length.

    Parameters
    ----------
    refined
        The adjusted survey.
    lines
        All L known lengths of the project.
    survey_index
        (L,) into the lines of the survey handed to refine; -1 for withheld and unseen ones.
    significance
        Of the test for blunders.
    """
    columns = {name: np.full(len(lines.name), np.nan) for name in _LINE_COLUMNS}
    status: list[LineStatus] = ["unseen"] * len(lines.name)
    adjustment = refined.adjustment
    _adjusted_lengths(adjustment, lines, columns)
    _fit_of_observed(refined, survey_index, columns, significance)
    messages: list[Message] = []
    known = adjustment.survey.label
    for i, name in enumerate(lines.name):
        missing = [p for p in (lines.start[i], lines.end[i]) if p not in known]
        if missing:
            messages.append(_unseen(name, missing, known))
        elif not lines.adjust[i]:
            status[i] = "checked"
            sigma = np.hypot(columns["adjusted_sigma_m"][i], lines.sigma_m[i])
            columns["w"][i] = columns["residual_m"][i] / sigma
        elif refined.line_removed[int(survey_index[i])]:
            status[i] = "removed"
        else:
            suspect = abs(columns["w"][i]) > critical_value(significance)
            status[i] = "suspect" if suspect else "used"
        if status[i] == "suspect" or (
            status[i] == "checked" and abs(columns["w"][i]) > critical_value(significance)
        ):
            messages.append(_does_not_fit(lines, i, columns))
    results = LineResults(
        name=lines.name,
        start=lines.start,
        end=lines.end,
        length_m=lines.length_m,
        sigma_m=lines.sigma_m,
        status=tuple(status),
        **columns,
    )
    return results, _line_checks(results), tuple(messages)


_LINE_COLUMNS = ("adjusted_m", "adjusted_sigma_m", "residual_m", "w", "redundancy", "mdb_m")


def _adjusted_lengths(
    adjustment: Adjustment, lines: KnownLines, columns: dict[str, Floats]
) -> None:
    start = np.array([adjustment.label_index(p) for p in lines.start], dtype=np.int64)
    end = np.array([adjustment.label_index(p) for p in lines.end], dtype=np.int64)
    seen = np.flatnonzero((start >= 0) & (end >= 0))
    for i in seen:
        length, gradient, unknowns = adjustment.problem.lengths_between(
            adjustment.state, start[[i]], end[[i]]
        )
        joint = adjustment.minimum.factor.joint(unknowns[0])
        columns["adjusted_m"][i] = length[0]
        columns["adjusted_sigma_m"][i] = np.sqrt(gradient[0] @ joint @ gradient[0])
    columns["residual_m"][:] = columns["adjusted_m"] - lines.length_m


def _fit_of_observed(
    refined: Refined, survey_index: Ints, columns: dict[str, Floats], significance: float
) -> None:
    adjustment = refined.adjustment
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return
    numbers = reliability(block, adjustment.covariance)
    used = refined.line_index[adjustment.problem.line_index]
    row_of = {int(s): row for row, s in enumerate(used)}
    sigma = adjustment.survey.length_sigma_m[adjustment.problem.line_index]
    mdb = minimal_detectable_bias(numbers.redundancy[:, 0], sigma, significance)
    for i, index in enumerate(survey_index):
        row = row_of.get(int(index), -1)
        if row >= 0:
            columns["w"][i] = numbers.w[row, 0]
            columns["redundancy"][i] = numbers.redundancy[row, 0]
            columns["mdb_m"][i] = mdb[row]


def _unseen(name: str, missing: list[str], known: tuple[str, ...]) -> Message:
    words = []
    for label in missing:
        near = get_close_matches(label, known, n=1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        words.append(f"{label!r}{hint}")
    text = f"The length {name!r} is not used: no usable pick of {', '.join(words)}."
    return Message("warning", "line-unseen", text)


def _does_not_fit(lines: KnownLines, i: int, columns: dict[str, Floats]) -> Message:
    text = (
        f"The length {lines.name[i]!r} does not fit: taped {lines.length_m[i]:.3f} m, adjusted "
        f"{columns['adjusted_m'][i]:.3f} m (w = {columns['w'][i]:.1f}). Look at the reading, at "
        "its ends and at their picks."
    )
    return Message("warning", "line-suspect", text)


def _line_checks(lines: LineResults) -> LineChecks:
    chosen = np.flatnonzero([s == "checked" for s in lines.status])
    sigma = np.hypot(lines.adjusted_sigma_m, lines.sigma_m)[chosen]
    return LineChecks(
        name=tuple(lines.name[i] for i in chosen),
        error_m=lines.residual_m[chosen],
        sigma_m=sigma,
        z=lines.residual_m[chosen] / sigma,
    )


def judge_points(
    adjustment: Adjustment, known: KnownWorldPoints
) -> tuple[PointChecks, tuple[Message, ...]]:
    """Result minus known coordinates of check points; those never picked are named.

    Nothing is judged with gauge ``plane``: coordinates mean nothing there.
    """
    index = np.array([adjustment.label_index(p) for p in known.label], dtype=np.int64)
    if adjustment.survey.gauge == "plane":
        index = index[:0]
    seen = np.flatnonzero(index >= 0)
    position, covariance = adjustment.points()
    error = position[index[seen]] - known.world_m[seen]
    joint = covariance[index[seen]] + known.sigma_m[seen][:, :, None] ** 2 * np.eye(3)
    squared = np.einsum("ni,ni->n", error, np.linalg.solve(joint, error[..., None])[..., 0])
    checks = PointChecks(
        label=tuple(known.label[i] for i in seen),
        error_m=error,
        sigma_m=np.sqrt(np.einsum("nii->ni", joint)),
        mahalanobis=np.sqrt(squared),
    )
    messages = tuple(
        Message(
            "warning", "check-unseen", f"The check point {known.label[i]!r} has no usable pick."
        )
        for i in np.flatnonzero(index < 0)
    )
    return checks, messages


GROUP_WORDS = {
    "pixels": "picks (their sigmas, or a wrong label)",
    "lengths": "known lengths (their sigmas, or a wrong reading)",
    "control": "control points (their sigmas, or a wrong label)",
    "telemetry": "telemetry (its sigmas, the gimbal or the times)",
    "calibration": "calibration of the camera (its sigmas, or another focus or resolution)",
}


def judge_groups(
    adjustment: Adjustment, significance: float
) -> tuple[tuple[GroupFactor, ...], tuple[Message, ...]]:
    """Variance factor of each group of observations; a message on each that is too large."""
    groups, messages = [], []
    for name, block in adjustment.minimum.blocks.items():
        if name == "gauge":
            continue
        fit = group_fit(block, adjustment.minimum.factor, adjustment.covariance)
        groups.append(GroupFactor(name=name, observations=block.residual.size, **fit._asdict()))
        if fit.probability < significance and name in GROUP_WORDS:
            text = (
                f"The {GROUP_WORDS[name]} fit worse than stated: variance factor "
                f"{fit.variance_factor:.1f}, probability {fit.probability:.1g}. The uncertainties "
                "of the results are too small until this is cleared up."
            )
            messages.append(Message("warning", "group-misfit", text))
    return tuple(groups), tuple(messages)


def judge_priors(adjustment: Adjustment, significance: float) -> tuple[Message, ...]:
    """Messages on priors that the observations contradict: telemetry, mount, clock, plane."""
    blocks, covariance = adjustment.minimum.blocks, adjustment.covariance
    limit = critical_value(significance)
    messages = []
    for name, parts in PRIOR_NAMES.items():
        if name in blocks:
            w = reliability(blocks[name], covariance).w[:, 0]
            messages += [_strained(parts[i], w[i]) for i in np.flatnonzero(np.abs(w) > limit)]
    if "telemetry" in blocks:
        w = correlated_w(blocks["telemetry"], covariance, adjustment.problem.telemetry_whitening)
        messages += _strained_frames(adjustment, w, np.abs(w) > limit)
    return tuple(messages)


def _strained(what: str, w: float) -> Message:
    text = (
        f"The observations contradict what was assumed of the {what} (w = {w:.1f}): check its "
        "value and sigma in the project."
    )
    return Message("warning", "prior-strained", text)


def _strained_frames(adjustment: Adjustment, w: Floats, flagged: Bools) -> list[Message]:
    telemetry = adjustment.survey.telemetry
    assert telemetry is not None  # noqa: S101  (there is a telemetry block)
    messages = []
    for row in np.flatnonzero(flagged.any(axis=1)):
        axis = int(np.abs(w[row]).argmax())
        frame = adjustment.survey.frame_id[telemetry.frame_index[row]]
        text = (
            f"Frame {frame!r} does not stand where the log has it: {POSE_AXES[axis]}, w = "
            f"{w[row, axis]:.1f}. Look at its picks, its time and the gimbal."
        )
        messages.append(Message("warning", "telemetry-strained", text))
    return messages

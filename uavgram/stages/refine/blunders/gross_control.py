"""Control points whose coordinates are wrong beyond doubt: swapped, of a wrong sign, mistyped.

As with lengths (see `gross_lengths`), one that bends the whole adjustment does not take part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from uavgram.estimation.reliability.coordinate_faults import FAR_M, displaced, likely_fault
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.message import Message, Several
from uavgram.model.survey.survey import Survey
from uavgram.stages.refine.blunders.gross_lengths import BEYOND, DOUBT, FEW
from uavgram.stages.refine.seeded_lengths import seeded_points

SHARE = 0.1
"""Of the cameras' height: control points that are off by less are left to the residuals' tests."""


def doubtful_control(survey: Survey, keep: Bools) -> Bools:
    """(C,) control points with which the adjustment had better not start; the rest confirms it.

    Those that are far from where the seeds see them, less what all have in common: that may be the
    log's fault, up to distances at which none is wrong.
    """
    out = np.zeros(len(survey.control_label), dtype=bool)
    if survey.seeds is None or not len(out):
        return out
    found, covariance = seeded_points(survey, keep, survey.control_label)
    off = survey.control_world_m - found
    known = np.isfinite(off[:, 0])
    if known.sum() >= FEW:
        common = np.median(off[known], axis=0)
        if np.linalg.norm(common) > FAR_M:
            return np.asarray(known)
        off = off - common
    out[known] = _far(survey, off[known], covariance[known], np.flatnonzero(known), DOUBT)
    return out


def without_control(survey: Survey, out: Bools) -> Survey:
    """The survey without some control points; they stay points like any other."""
    if not out.any():
        return survey
    return replace(
        survey,
        control_label=survey.control_label[~out],
        control_world_m=survey.control_world_m[~out],
        control_sigma_m=survey.control_sigma_m[~out],
    )


def control_beyond_doubt(survey: Survey, refined: Refined, control: Ints) -> Bools:
    """(n,) which of some control points an adjustment without them rules out.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjusted without these control points.
    control
        (n,) rows of control points.
    """
    if not len(control):
        return np.zeros(0, dtype=bool)
    off, covariance = _off(survey, refined, control)
    return _far(survey, off, covariance, control, BEYOND)


def control_left_out(survey: Survey, refined: Refined, control: Ints) -> Iterator[Message]:
    """A message on each control point that was left out.

    Parameters
    ----------
    survey
        All observations.
    refined
        Adjusted without these control points.
    control
        (n,) rows of control points.
    """
    if not len(control):
        return
    off, covariance = _off(survey, refined, control)
    for k, i in enumerate(control.tolist()):
        sigma = np.sqrt(np.diag(covariance[k]) + survey.control_sigma_m[i] ** 2)
        label = survey.label[survey.control_label[i]]
        where, likely = displaced(off[k], sigma), likely_fault(off[k])
        text = (
            f"The control point {label!r} was left out: it is {where}, and with it nothing else "
            f"would fit. Look at its coordinates{likely}, its label and its picks."
        )
        several = Several(
            "{count} control points were left out, as nothing else would fit with them",
            f"{label!r} is {where}{likely}",
            ending="Look at their coordinates, their labels and their picks.",
        )
        yield Message("warning", "control-left-out", text, labels=(label,), several=several)


def _off(survey: Survey, refined: Refined, control: Ints) -> tuple[Floats, Floats]:
    """Stated less found (n, 3) of some control points, and the covariance (n, 3, 3) of the latter.

    NaN where an adjustment does not have the point.
    """
    label = [survey.label[k] for k in survey.control_label[control]]
    place = refined.adjustment.label_rows(label)
    found, covariance = refined.adjustment.points()
    there = (place >= 0)[:, None]
    off = np.where(there, survey.control_world_m[control] - found[place], np.nan)
    return off, covariance[place]


def _far(survey: Survey, off: Floats, covariance: Floats, control: Ints, sigmas: float) -> Bools:
    """(n,) which control points are off by more than so many sigmas and a share of the height."""
    assert survey.seeds is not None  # noqa: S101  (without seeds none is in doubt)
    stated = survey.control_sigma_m[control][:, :, None] ** 2 * np.eye(3)
    weighted = np.linalg.solve(covariance + stated, off[..., None])[..., 0]
    squared = np.einsum("ni,ni->n", off, weighted)
    height = float(np.median(survey.seeds.center_world_m[:, 2])) - survey.ground.height_m
    return np.asarray((squared > sigmas**2) & (np.linalg.norm(off, axis=1) > SHARE * height))

"""Reliability of a result: error budget, noise, effects of undetected errors, and the verdict.

NaN (or an empty name) means "there is none".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays
from uavgram.model.message import Remedy
from uavgram.model.naming import OPTIONAL, Column


@dataclass(frozen=True, kw_only=True, eq=False)
class ErrorBudget(FrozenArrays):
    """Shares of the variance of M measurements.

    Attributes
    ----------
    source
        (S,) names for people, such as ``picks``; sources that contribute nothing are left out.
    share
        (M, S) of the variance, rows add up to 1; NaN where there is no value.
    """

    source: Annotated[tuple[str, ...], "s"]
    share: Annotated[Floats, "m", "s", NAN_IS_NONE]


SurfaceShape = Literal["plane", "quadratic", "correlated"]

PICKED: dict[str, str] = {
    "hand": "picks made by hand",
    "target": "targets",
    "match": "matches",
    "tie": "tie points",
}
"""Origins of image points, each a group with a sigma of its own, and their displayed names."""


@dataclass(frozen=True, kw_only=True)
class PickNoise:
    """Noise of the picks of one source.

    Attributes
    ----------
    source
        Origin of the picks: one of `PICKED`.
    stated_px
        Their sigma as stated (root mean square) [px].
    factor, sigma
        Estimated factor of that sigma, and the standard deviation of that factor.
    """

    source: str
    stated_px: float
    factor: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class EstimatedSigma:
    """Estimate of a sigma in metres.

    Attributes
    ----------
    stated_m
        As stated (root mean square) [m].
    factor, sigma
        Estimated factor of that sigma, and the standard deviation of that factor.
    """

    stated_m: float
    factor: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class AreaNoise:
    """Departure of the ground of one area from its plane.

    Attributes
    ----------
    area
        Its name.
    stated_m, estimated_m, sigma_m
        Each point's own departure (roughness): as stated, as estimated, and the standard deviation
        of the estimate [m].
    shape
        Shape of the smooth departures: ``quadratic`` (a crown or a hollow) or ``correlated``
        (relief that changes smoothly); ``plane``: none.
    relief_m
        Size of these smooth departures (root mean square at the points) [m]; 0 for a plane.
    probability
        Of such an uneven ground by chance, if it is as stated.
    """

    area: str
    stated_m: float
    estimated_m: float
    sigma_m: float
    shape: SurfaceShape
    relief_m: float
    probability: float = 0.0

    @property
    def size_m(self) -> float:
        """Departure of a point from the plane: roughness and smooth departures together [m]."""
        return math.hypot(self.estimated_m, self.relief_m)


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Noise of picks and taped lengths, and unevenness of the ground, estimated from the survey.

    `identification` is the deviation of the picked from the intended point, the same in all photos.
    """

    picks: tuple[PickNoise, ...]
    roughness: tuple[AreaNoise, ...]
    lengths: EstimatedSigma | None = None
    identification: EstimatedSigma | None = None

    def describe_picks(self, picks: PickNoise) -> str:
        """Return the name of the picks of one source; just picks where people made all."""
        people_alone = [one.source for one in self.picks] == ["hand"]
        return "picks" if people_alone else PICKED[picks.source]


@dataclass(frozen=True, kw_only=True, eq=False)
class Effects(FrozenArrays):
    """External reliability of n observations: effect of an error that no test finds.

    The error is as large as the minimal detectable bias; the measurement that it moves by most of
    its own sigmas is named.

    Attributes
    ----------
    on
        (n,) name of that measurement; empty where there is none.
    change
        (n,) its change, signed, in the measurement's unit.
    sigmas
        (n,) the same in the measurement's sigmas, not signed.
    """

    on: Annotated[tuple[str, ...], "n", Column("external_on")]
    change: Annotated[Floats, "n", NAN_IS_NONE, Column("external")]
    sigmas: Annotated[Floats, "n", NAN_IS_NONE, Column("external_sigmas")]


@dataclass(frozen=True, kw_only=True, eq=False)
class WeakestLinks(FrozenArrays):
    """For each of M measurements, the undetected error that would move it most.

    Attributes
    ----------
    what
        (M,) the observation, in words.
    bias, unit
        (M,) its minimal detectable bias.
    change
        (M,) change of the measurement by it, in the measurement's unit.
    unchecked
        (M,) observations that move it without any redundancy, in words: no test would find an error
        there, however large.
    """

    what: Annotated[tuple[str, ...], "n"]
    bias: Annotated[Floats, "n", NAN_IS_NONE, Column("mdb")]
    unit: tuple[str, ...]
    change: Annotated[Floats, "n", NAN_IS_NONE]
    unchecked: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class PriorResults(FrozenArrays):
    """n priors (log, mount, clock, ground, calibration, control), and their fit.

    Attributes
    ----------
    kind, name
        (n,) group, and name in words.
    frame_id
        (n,) frame of a telemetry prior; else empty.
    unit
        (n,) of `bias`.
    residual
        (n,) adjusted minus stated, in stated sigmas.
    w, redundancy, bias
        (n,) Baarda's test statistic, redundancy number and minimal detectable bias.
    effects
        Of an error of that size.
    """

    kind: tuple[str, ...]
    name: Annotated[tuple[str, ...], "n"]
    frame_id: tuple[str, ...]
    unit: tuple[str, ...]
    residual: Annotated[Floats, "n", Column("residual_sigmas")]
    w: Annotated[Floats, "n"]
    redundancy: Annotated[Floats, "n"]
    bias: Annotated[Floats, "n", NAN_IS_NONE, Column("mdb")]
    effects: Effects


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """External reliability of L lengths, P picks, all priors; weakest links of M measurements."""

    lines: Effects
    picks: Effects
    priors: PriorResults
    weakest: WeakestLinks


@dataclass(frozen=True, kw_only=True, eq=False)
class SecondOrder(FrozenArrays):
    """Errors of first-order propagation, for M measurements.

    Attributes
    ----------
    bias
        (M,) mean minus value, in the measurement's unit.
    sigma
        (M,) with second-order terms; NaN where the adjustment of slightly different observations
        finds no solution.
    curvature
        (M,) largest change of slope over one sigma, in slopes.
    off
        (M,) whether first order is not accurate enough.
    """

    bias: Annotated[Floats, "n", NAN_IS_NONE, Column("second_order_bias")]
    sigma: Annotated[Floats, "n", NAN_IS_NONE, Column("second_order_sigma")]
    curvature: Annotated[Floats, "n", NAN_IS_NONE]
    off: Annotated[Bools, "n", Column("first_order_off")]


@dataclass(frozen=True, kw_only=True)
class RemovalRecord:
    """One observation that was removed as a gross error, or a correction that was made instead.

    Attributes
    ----------
    what, w
        The observation in words, and its test statistic before removal.
    group
        Other observations that no test can separate from it.
    rivals
        Observations that might have been the wrong one instead, with odds of more than 1 in 20.
    variance_factor_before, variance_factor_after
        Of the whole adjustment; NaN without redundancy.
    change
        (M,) after minus before, of each measured value.
    cause
        Code of the message on the correction; empty where an observation was removed.
    mended
        Text before and after a correction.
    """

    what: str
    w: float
    group: tuple[str, ...]
    rivals: tuple[str, ...]
    variance_factor_before: float
    variance_factor_after: float
    change: tuple[float, ...]
    cause: str = ""
    mended: tuple[str, str] = ("", "")


@dataclass(frozen=True, kw_only=True)
class ChecksOverall:
    """All withheld lengths and check points together, with their joint covariance.

    Attributes
    ----------
    count
        Numbers compared: one of a length, three of a point.
    chi2, probability
        Squared Mahalanobis distance of all errors; probability of one as large by chance.
    rms_error_m
        Of these numbers.
    mean_error_percent
        Mean absolute error of the lengths over the length; NaN without one.
    """

    count: int
    chi2: float
    probability: float
    rms_error_m: float
    mean_error_percent: float


VerdictLevel = Literal["green", "amber", "red"]
"""Level of a verdict.

Red: the observations contradict each other, do not use the numbers. Amber: something does not fit,
or nothing checks it. Green: everything fits, and an error in any single reading would have been
noticed before it moves a value by ten of its sigmas. No level at all (None): nothing was measured.
"""

MeasurementStatus = Literal["ok", "not-checked", "doubtful", "contradicted"]
"""Status of one measurement.

In order; no observation would show an error in it; an observation on which it depends does not fit;
an observation contradicts it.
"""


@dataclass(frozen=True, kw_only=True)
class Reason:
    """Reason why a result is not green.

    Attributes
    ----------
    cause
        Code of the message that explains it (`uavgram explain`).
    text
        One plain sentence, and the action.
    frames, labels, lengths, measurements
        Names of its subjects.
    plain
        Finding in one sentence without numbers of tests; may be empty.
    mend
        Proposed correction; None where only a person can.
    instead
        Alternatives, where the observations cannot decide.
    equals
        Other causes that are just as likely, as sentences.
    """

    cause: str
    text: str
    frames: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    lengths: tuple[str, ...] = ()
    measurements: tuple[str, ...] = ()
    plain: Annotated[str, OPTIONAL] = ""
    mend: Annotated[Remedy | None, OPTIONAL] = None
    instead: Annotated[tuple[Remedy, ...], OPTIONAL] = ()
    equals: Annotated[tuple[str, ...], OPTIONAL] = ()


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Level of a whole result, and its reasons, the likeliest cause first; none where green.

    The level is None where nothing was measured: there is no verdict without a measurement.
    """

    level: VerdictLevel | None
    reasons: tuple[Reason, ...] = ()

"""Repetitions of surveys and single photos with known truth, and studies made of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints
from uavgram.model.result.reliability import VerdictLevel

COVERAGE_SIGMAS = (1.0, 1.959963984540054, 3.0)
"""Bounds within which errors are counted [sigma]: 68.3, 95 and 99.7 % of normal errors."""

COVERAGE = (0.6826894921370859, 0.95, 0.9973002039367398)
"""Shares of normal errors within each of `COVERAGE_SIGMAS`."""


@dataclass(frozen=True, kw_only=True)
class Repetition:
    """Result of one repetition.

    Attributes
    ----------
    number
        Number of the draw: the same number of the same scenario gives the same survey.
    true, value, sigma
        One entry for each measurement; NaN where it has no value.
    level
        Level of the verdict; None where there is no result.
    failure
        Why there is no result; empty where there is one.
    converged
        Whether the adjustment converged.
    codes
        Codes of its warnings and errors.
    """

    number: int
    true: tuple[float, ...] = ()
    value: tuple[float, ...] = ()
    sigma: tuple[float, ...] = ()
    level: VerdictLevel | None = None
    failure: str = ""
    converged: bool = False
    codes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class Repetitions(FrozenArrays):
    """N repetitions of a survey with M measured values.

    Attributes
    ----------
    name, unit
        (M,) of the values, metres and degrees.
    predicted
        (M,) predicted standard deviations of the survey without noise; NaN where there is none.
    number
        (N,) of the draws.
    true, value, sigma
        (N, M); NaN where a repetition has no such value.
    level, failure, codes
        (N,) as in `Repetition`.
    converged
        (N,).
    """

    name: Annotated[tuple[str, ...], "m"]
    unit: tuple[str, ...]
    predicted: Annotated[Floats, "m", NAN_IS_NONE]
    number: Annotated[Ints, "n"]
    true: Annotated[Floats, "n", "m", NAN_IS_NONE]
    value: Annotated[Floats, "n", "m", NAN_IS_NONE]
    sigma: Annotated[Floats, "n", "m", NAN_IS_NONE]
    level: tuple[VerdictLevel | None, ...]
    failure: tuple[str, ...]
    converged: Annotated[Bools, "n"]
    codes: tuple[tuple[str, ...], ...]

    @property
    def failed(self) -> int:
        """Number of repetitions without a result."""
        return sum(map(bool, self.failure))

    @property
    def unsettled(self) -> int:
        """Number of repetitions with a result whose adjustment did not converge."""
        return int((~self.converged).sum()) - self.failed

    @property
    def counted(self) -> Bools:
        """(N, M) mask of the values that are counted: those of converged adjustments."""
        known = np.isfinite(self.value) & np.isfinite(self.sigma)
        return np.asarray(known & self.converged[:, None])


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy(FrozenArrays):
    """Accuracy of M measured values; ranges hold the true value in 95 % of such simulations.

    Attributes
    ----------
    count
        (M,) repetitions that have the value.
    bias, bias_range
        (M,), (M, 2) mean error.
    spread, spread_range
        (M,), (M, 2) standard deviation of the errors.
    stated
        (M,) root mean square of the stated sigmas.
    coverage, coverage_range
        (M, 3), (M, 3, 2) shares of the errors within `COVERAGE_SIGMAS`.
    z, z_range
        (M,), (M, 2) root mean square of error over stated sigma: 1 if the sigmas are correct.
    """

    count: Annotated[Ints, "m"]
    bias: Annotated[Floats, "m", NAN_IS_NONE]
    bias_range: Annotated[Floats, "m", 2, NAN_IS_NONE]
    spread: Annotated[Floats, "m", NAN_IS_NONE]
    spread_range: Annotated[Floats, "m", 2, NAN_IS_NONE]
    stated: Annotated[Floats, "m", NAN_IS_NONE]
    coverage: Annotated[Floats, "m", 3, NAN_IS_NONE]
    coverage_range: Annotated[Floats, "m", 3, 2, NAN_IS_NONE]
    z: Annotated[Floats, "m", NAN_IS_NONE]
    z_range: Annotated[Floats, "m", 2, NAN_IS_NONE]


@dataclass(frozen=True, kw_only=True, eq=False)
class Variant:
    """The same repetitions with another deviation from the stated project; `name` describes it."""

    name: str
    repetitions: Repetitions
    accuracy: Accuracy


@dataclass(frozen=True)
class SigmaMismatch:
    """Quantity drawn with another sigma than stated: key, and both sigmas per coordinate."""

    key: str
    drawn: tuple[float, ...]
    stated: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulation:
    """Many repetitions of a simulated survey.

    Attributes
    ----------
    name, seed
        Name and seed of the scenario.
    source
        Scenario file, without its folder.
    repetitions, accuracy
        Values and their accuracy.
    variants
        The survey without any deviation from its project, and with each deviation alone; empty
        where that was not requested.
    unlike
        Quantities that the scenario draws otherwise than its project states.
    deviations
        Keys of the scenario's deviations that are unknown to its project.
    """

    name: str
    seed: int
    source: str
    repetitions: Repetitions
    accuracy: Accuracy
    variants: tuple[Variant, ...] = ()
    unlike: tuple[SigmaMismatch, ...] = ()
    deviations: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class MethodRow:
    """One method in one setting.

    Attributes
    ----------
    setting, method
        Names.
    scenes
        Number of scenes.
    rms_m, ninth_m
        Median and 90th percentile of the scenes' root mean square errors.
    fewest_m, most_m
        Medians over the scenes with least and with most features.
    failed
        Share of scenes in which the distances are useless.
    ambiguous, told, failed_silently
        Shares of scenes in which the method reports that another pose fits as well; in which it
        reports that, or predicts errors beyond 5 %; and in which it failed without any report.
    coverage, z
        Share of the errors within 1.96 predicted sigmas, and their root mean square in sigmas.
    """

    setting: str
    method: str
    scenes: int
    rms_m: float
    ninth_m: float
    fewest_m: float
    most_m: float
    failed: float
    ambiguous: float
    told: float
    failed_silently: float
    coverage: float
    z: float


SOURCES = ("lengths", "picks", "log", "camera", "tape", "ground")
"""Sources of errors.

Readings of lengths, picks, flight log, camera file, scale of the tape, and ground plane.
"""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One point of a study's grid.

    Attributes
    ----------
    curve
        Curve of the figure to which the point belongs.
    at, label
        Position on the axis, as number and as text.
    predicted_m
        Root mean square, over the withheld distances, of the expected errors: sigmas and mean
        errors without noise, to second order.
    simulated_m
        The same of the errors in the repetitions.
    ratio, ratio_range
        Root mean square of errors over predicted errors; its 95 % range.
    bias_m
        Root mean square of the mean errors.
    shares
        Share of each of `SOURCES` in the predicted variance, to first order.
    repetitions, lost
        Number of draws, and of those without a result.
    """

    curve: str
    at: float
    label: str
    predicted_m: float
    simulated_m: float
    ratio: float
    ratio_range: tuple[float, float]
    bias_m: float
    shares: tuple[float, ...]
    repetitions: int
    lost: int

    def share(self, source: str) -> float:
        """Return the share of a source of errors in the predicted variance."""
        return self.shares[SOURCES.index(source)]


@dataclass(frozen=True, kw_only=True)
class Study:
    """Study: its question, its grid, and its duration.

    Attributes
    ----------
    name, title, question
        Texts that identify the study.
    axis, is_log
        Quantity that varies along the figure, and whether its axis is logarithmic.
    cells
        Curve after curve.
    seconds
        Elapsed time.
    methods
        Rows of the comparison of methods, which has these instead of cells.
    """

    name: str
    title: str
    question: str
    axis: str
    is_log: bool
    cells: tuple[Cell, ...]
    seconds: float
    methods: tuple[MethodRow, ...] = ()

    @property
    def settings(self) -> dict[str, tuple[MethodRow, ...]]:
        """Methods by setting, in their order; the usual one first."""
        names = dict.fromkeys(row.setting for row in self.methods)
        return {name: tuple(r for r in self.methods if r.setting == name) for name in names}

    @property
    def curves(self) -> dict[str, tuple[Cell, ...]]:
        """Cells by curve, in their order."""
        names = dict.fromkeys(cell.curve for cell in self.cells)
        return {name: tuple(c for c in self.cells if c.curve == name) for name in names}

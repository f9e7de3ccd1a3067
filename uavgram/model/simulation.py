"""Repetitions with known truth, of surveys and of single photos, and studies of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.result.verdict import VerdictLevel


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoDesign(FrozenArrays):
    """What all draws have in common.

    Attributes
    ----------
    calibration
        The camera; its covariance is not read.
    height_m
        (E,) of the ends above the ground.
    line
        (L, 2) ends of the lengths.
    pixel_sigma_px, length_sigma_m
        (E,) of each coordinate, (L,).
    information
        (6, 6) inverse covariance of the pose beforehand: (δcentre world, δθ camera); 0 where
        nothing is known. Where it leaves the pose's place or heading free altogether, any small
        number there holds the pose without moving a length.
    camera_root
        (P, K) what K unknowns, each normal with sigma 1, do to the camera's parameters: a root of
        their covariance. None: the camera is exact.
    ground_root
        (3, G) what G unknowns, each normal with sigma 1, do to the ground's plane. None: it is
        exact.
    tape_scale_sigma
        Of the tape, a share of all lengths; 0: it is exact.
    """

    calibration: Calibration
    height_m: Annotated[Floats, "e"]
    line: Annotated[Ints, "l", 2]
    pixel_sigma_px: Annotated[Floats, "e"]
    length_sigma_m: Annotated[Floats, "l"]
    information: Annotated[Floats, 6, 6]
    camera_root: Floats | None = None
    ground_root: Floats | None = None
    tape_scale_sigma: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoDraws(FrozenArrays):
    """B draws.

    Attributes
    ----------
    pixel_px, length_m
        (B, E, 2) of the ends, (B, L) readings.
    center_world_m, world_from_camera
        (B, 3), (B, 3, 3) the pose beforehand.
    ground
        (B, 3) the ground's plane beforehand: height at the origin [m], slopes to east and north.
    """

    pixel_px: Annotated[Floats, "b", "e", 2]
    length_m: Annotated[Floats, "b", "l"]
    center_world_m: Annotated[Floats, "b", 3]
    world_from_camera: Annotated[Floats, "b", 3, 3]
    ground: Annotated[Floats, "b", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoPosesFound(FrozenArrays):
    """B adjusted poses.

    Attributes
    ----------
    center_world_m, world_from_camera, covariance
        (B, 3), (B, 3, 3), (B, 6, 6) as of `Poses`; without a covariance where one did not come
        to rest.
    place_m
        (B, E, 3) of the ends.
    common
        (B, K) the unknowns of camera, ground and tape, in that order; K = 0 where all are exact.
    cost
        (B,) weighted sum of squares.
    converged, steps
        (B,) whether it came to rest, and after how many steps.
    """

    center_world_m: Annotated[Floats, "b", 3]
    world_from_camera: Annotated[Floats, "b", 3, 3]
    covariance: Annotated[Floats, "b", 6, 6, NAN_IS_NONE]
    place_m: Annotated[Floats, "b", "e", 3, NAN_IS_NONE]
    common: Annotated[Floats, "b", "k", NAN_IS_NONE]
    cost: Annotated[Floats, "b", NAN_IS_NONE]
    converged: Annotated[Bools, "b"]
    steps: Annotated[Ints, "b"]


SIGMAS = (1.0, 1.959963984540054, 3.0)
"""Within which errors are counted: 68.3, 95 and 99.7 % of normal ones lie there."""

COVERAGE = (0.6826894921370859, 0.95, 0.9973002039367398)
"""Of normal errors, in the order of `SIGMAS`."""


@dataclass(frozen=True, kw_only=True)
class Repetition:
    """One repetition.

    Attributes
    ----------
    number
        Of the draw: the same number of the same scenario gives the same survey.
    true, value, sigma
        Of each measurement; NaN where it has no value.
    level
        Of the verdict; None where there is no result.
    failure
        Why there is none; empty where there is.
    converged
        Whether the adjustment came to rest.
    codes
        Of its warnings and errors.
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
        (M,) sigmas without any noise; NaN where there is none.
    number
        (N,) of the draws.
    true, value, sigma
        (N, M); NaN where a repetition has no such value.
    level, failure, codes
        (N,) as of `Repetition`.
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
        """Repetitions without a result."""
        return sum(map(bool, self.failure))

    @property
    def unsettled(self) -> int:
        """Repetitions with a result whose adjustment did not come to rest."""
        return int((~self.converged).sum()) - self.failed

    @property
    def counted(self) -> Bools:
        """(N, M) which values are counted: those of adjustments that came to rest."""
        known = np.isfinite(self.value) & np.isfinite(self.sigma)
        return np.asarray(known & self.converged[:, None])


@dataclass(frozen=True, kw_only=True, eq=False)
class Accuracy(FrozenArrays):
    """How good M measured values were; ranges hold the true value in 95 % of such simulations.

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
        (M, 3), (M, 3, 2) shares of the errors within `SIGMAS`.
    z, z_range
        (M,), (M, 2) root mean square of error over stated sigma: 1 is honest.
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
    """The same repetitions of a survey with something else amiss; `name` says what."""

    name: str
    repetitions: Repetitions
    accuracy: Accuracy


@dataclass(frozen=True)
class Unlike:
    """A thing that is drawn otherwise than stated: its key, and both sigmas, of each coordinate."""

    key: str
    drawn: tuple[float, ...]
    stated: tuple[float, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulation:
    """A simulated survey, many times.

    Attributes
    ----------
    name, seed
        Of the scenario.
    source
        The file that it comes from, without its folder.
    repetitions, accuracy
        What came out.
    variants
        The same without anything amiss, and with each such thing alone; nothing where that was not
        asked for.
    running
        Pairs of a number of repetitions, and the mean spread over the predicted one by then.
    unlike
        What the scenario draws otherwise than its project states it.
    amiss
        Keys of the scenario that say what is amiss in it, of which its project knows nothing.
    """

    name: str
    seed: int
    source: str
    repetitions: Repetitions
    accuracy: Accuracy
    variants: tuple[Variant, ...] = ()
    running: tuple[tuple[int, float], ...] = ()
    unlike: tuple[Unlike, ...] = ()
    amiss: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class MethodRow:
    """One method in one setting.

    Attributes
    ----------
    setting, method
        Names.
    scenes
        How many.
    rms_m, ninth_m
        Median and 90th percentile of the scenes' root mean square errors.
    fewest_m, most_m
        Medians over the scenes with least and with most features.
    failed
        Share of scenes in which the distances are useless.
    ambiguous, told, failed_silently
        Shares of scenes in which the method says that another pose fits as well; in which it says
        so, or predicts errors beyond 5 %; and that failed without a word.
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
"""Of errors: readings of lengths, picks, what the log says, the camera file, the tape's scale, and
the plane of the ground."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One point of a grid.

    Attributes
    ----------
    curve
        Which curve of the figure it belongs to.
    at, label
        Where on the axis, and in words.
    predicted_m
        Root mean square, over the withheld distances, of the errors to expect: sigmas and mean
        errors without any noise, to second order.
    simulated_m
        Of the errors that the repetitions made.
    ratio, ratio_range
        Of the errors over the predicted ones, root mean square; it lies in the range with 95 %.
    bias_m
        Root mean square of the mean errors.
    shares
        What each of `SOURCES` has of the predicted variance, to first order.
    repetitions, lost
        How many were drawn, and how many gave no result.
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
        """What a source of errors has of the predicted variance."""
        return self.shares[SOURCES.index(source)]


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study: its question, its grid, and how long it took.

    Attributes
    ----------
    name, title, question
        Of the study.
    axis, is_log
        What varies along the figure, and whether on a logarithmic axis.
    cells
        Curve after curve.
    seconds
        Of the clock.
    methods
        Of the comparison of methods, which has these instead of cells.
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

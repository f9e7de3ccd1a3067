"""A method of finding the pose of one photo, judged on many scenes: a row of the comparison."""

from __future__ import annotations

from dataclasses import dataclass


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

"""Repetitions of a survey with known truth, and what they say of its accuracy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints
from uavgram.model.result.verdict import VerdictLevel

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

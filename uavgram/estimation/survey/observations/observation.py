"""Protocol of observations: the interface of every kind, and suspicions of single observations.

The likelihood, tests for blunders, error budget and report loop over kinds. A kind is a subclass of
`Observation` in a file of its own, registered in `observations/kinds.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, TypedDict

import numpy as np

from uavgram.estimation.solver.levenberg_marquardt import Minimum
from uavgram.estimation.solver.normal_equations import Block
from uavgram.estimation.survey.observed import Observations, SimulatedTruth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Remedy
from uavgram.model.naming import format_misfit


@dataclass(frozen=True)
class Member:
    """One observation: group of the likelihood, row in it, and its most significant axis."""

    kind: str
    row: int
    axis: int


@dataclass(frozen=True)
class Suspicion:
    """Observation that does not fit, with the alternatives that could be wrong instead.

    Attributes
    ----------
    suspect
        Observation with the largest test statistic `w`.
    w
        Test statistic, signed, given earlier suspicions.
    group
        Observations that no test can separate from it.
    rivals
        Others whose odds against it are more than 1 in 20.
    """

    suspect: Member
    w: float
    group: tuple[Member, ...]
    rivals: tuple[Member, ...]


if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

Role = Literal["reading", "prior", "untested", "construction"]
"""Role of a kind of observation.

``reading``: taken by people, who can misread it. ``prior``: known beforehand. ``untested``:
observed, but single ones are not tested. ``construction``: not observed; it constrains unknowns.
"""


UNIT_FACTORS = {"deg": float(np.rad2deg(1.0)), "ppm": 1e6, "%": 100.0}
"""Number of each unit in the unit of the unknowns; 1 for all others."""


class Subjects(TypedDict, total=False):
    """Names of the frames, labels and lengths of a message, by its fields."""

    frames: tuple[str, ...]
    labels: tuple[str, ...]
    lengths: tuple[str, ...]


class Misfit(NamedTuple):
    """One axis of an observation that does not fit.

    Attributes
    ----------
    member
        The observation and the axis.
    w
        Test statistic of the axis.
    redundancy
        Redundancy number of the axis.
    off
        (r,) adjusted minus read, of all numbers of the observation, in its unit.
    """

    member: Member
    w: float
    redundancy: float
    off: Floats


class ErrorSource(NamedTuple):
    """Source in the error budget: its name, its description, and how to reduce its error."""

    name: str
    words: str
    advice: str


@dataclass(frozen=True)
class Kind:
    """Properties of a kind of observation that are the same in every survey.

    Attributes
    ----------
    name
        Name of its group in the likelihood; for the planes of further areas, the beginning of it.
    source
        Source in the error budget, which kinds may share.
    words
        Name in the table of all groups.
    role
        See `Role`.
    rank
        Rank among readings: the one of the lowest rank represents a group of inseparable readings.
    axes, units
        Name and unit of each of its numbers.
    plural, check
        Name of several in a sentence, and the thing to check if the group does not fit; empty: no
        message is about it alone.
    advice
        Advice if several single ones do not fit.
    misfit_code
        Code of the message on one that does not fit.
    is_judged
        Whether its variance factor is reported, although it was not observed.
    is_core
        Whether its fit shows if the model of picks and ground holds.
    is_whole
        Whether a wrong one is wrong in all of its numbers.
    is_joint
        Whether the numbers of a wrong one together may explain the error of another observation.
    by_size
        Whether its sigmas are learnt in metres that the known lengths give, and scale with them.
    has_table
        Whether the results have a table of its own.
    """

    name: str
    source: ErrorSource
    words: str
    role: Role = "prior"
    rank: int = 0
    axes: tuple[str, ...] = ()
    units: tuple[str, ...] = ("m",)
    plural: str = ""
    check: str = ""
    advice: str = "Check their values and stated errors in the project."
    misfit_code: str = "prior-strained"
    is_judged: bool = False
    is_core: bool = False
    is_whole: bool = False
    is_joint: bool = False
    by_size: bool = False
    has_table: bool = False


class Observation:
    """One kind of observation of a survey.

    Parameters
    ----------
    problem
        Likelihood that it is part of: survey, layout of the unknowns and ground exist already.
    kind
        One of `kinds`, for classes with several kinds that differ in their words only.
    """

    kind: Kind
    kinds: ClassVar[tuple[Kind, ...]] = ()

    def __init__(self, problem: SurveyProblem, kind: Kind) -> None:
        self.problem, self.kind = problem, kind

    @classmethod
    def of(cls, problem: SurveyProblem) -> Iterator[Observation]:
        """Yield the groups of these kinds in a survey."""
        every = (cls(problem, kind) for kind in cls.kinds or (cls.kind,))
        return (one for one in every if one.is_part())

    def is_part(self) -> bool:
        """Return whether the survey has any such observation."""
        return True

    @classmethod
    def draw(cls, stated: Observations, truth: SimulatedTruth) -> Observations:
        """Draw these kinds again, about the truth and with their stated errors.

        Parameters
        ----------
        stated
            Observations; kinds before this one are drawn already.
        truth
            True survey, with random numbers of this kind alone.

        Returns
        -------
        The observations, with those of these kinds replaced by the drawn ones that took part.
        """
        del truth
        return stated

    @property
    def name(self) -> str:
        """Name of the group."""
        return self.kind.name

    def rows(self, state: State) -> Block | None:
        """Compute whitened residuals and derivatives; None if the state is impossible.

        For states with a leading axis, the residuals have it too, and so do derivatives that differ
        from state to state.
        """
        raise NotImplementedError

    def sigma(self, found: Minimum[State]) -> Floats:
        """Return the (n, r) standard deviations of independent numbers.

        The whitened residual of a prior changes by the inverse of its sigma.
        """
        return np.asarray(1.0 / found.blocks[self.name].jacobian[:, :, 0])

    def whitening(self) -> Floats | None:
        """Return (n, r, a) matrices that whiten errors of correlated numbers; None: independent."""
        return None

    def arrange_for_tests(self, block: Block) -> Block:
        """Arrange the rows for the tests."""
        return block

    def residuals(self, found: Minimum[State]) -> Floats:
        """Return (n, r) adjusted minus stated values of independent numbers, in their unit."""
        return np.asarray(found.blocks[self.name].residual * self.sigma(found))

    def things(self) -> Ints | None:
        """Return (n,) numbers: rows of one observation share one. None: each row is one."""
        return None

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield labels (n,) and derivatives (n, r) of the whitened residuals by their heights.

        The derivatives are for a point that is higher than its surface, with unchanged
        observations.
        """
        del found
        yield from ()

    def title(self, member: Member) -> str:
        """Return the name of an observation in a sentence, without an article."""
        return self.axis(member)

    def axis(self, member: Member) -> str:
        """Return the name of one of its numbers, in a table."""
        return self.kind.axes[member.axis]

    def suspect(self, member: Member) -> str:
        """Return the possible cause of a misfit, without an article."""
        return self.title(member)

    def unit(self, member: Member) -> tuple[str, float]:
        """Return the unit of its errors, and how many of it make the unit of the unknowns."""
        return get_unit(self.kind.units[member.axis])

    def subjects(self, row: int) -> Subjects:
        """Return frames, labels and lengths that an observation is about."""
        del row
        return {}

    def witness(self) -> Iterator[str]:
        """Yield the sources of evidence for the scale of the survey."""
        yield from ()

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe a misfit: as a sentence with the values to check, and in a few words."""
        what = f"{self.title(found.member)} ({format_misfit(found.w)})"
        return (
            f"This value in the project does not fit the picks, lengths and log: {what}. What is "
            "measured may be wrong with it. Check the value and its stated error.",
            what,
        )

    def several(self) -> str:
        """Return the opening of a message on several misfits; ``{count}`` is their number."""
        what = self.kind.plural
        if not what:
            return "{count} values in the project do not fit the picks, lengths and log"
        return f"{{count}} {what} do not fit"

    def advice(self) -> str:
        """Return the advice on misfits, as a sentence."""
        return self.kind.advice

    def check(self) -> str:
        """Return what to look at where the whole kind does not fit; empty without advice."""
        return self.kind.check

    def remedy(self, row: int) -> Remedy | None:
        """Return the remedy; None if only a person can find it."""
        del row
        return None


def get_unit(unit: str) -> tuple[str, float]:
    """Return a unit, and how many of it make the unit of the unknowns."""
    return unit, UNIT_FACTORS.get(unit, 1.0)

"""Protocol of observations: what every kind provides, and suspicions of single ones.

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
from uavgram.estimation.survey.observed import Observations, Truth
from uavgram.estimation.survey.unknowns import State
from uavgram.model.arrays import Floats, Ints
from uavgram.model.message import Remedy


@dataclass(frozen=True)
class Member:
    """One observation: group of the likelihood, row in it, and the axis that tells most."""

    kind: str
    row: int
    axis: int


@dataclass(frozen=True)
class Suspicion:
    """An observation that does not fit, and what else could be wrong instead.

    Attributes
    ----------
    accused
        With the largest test statistic `w`.
    w
        Signed, given earlier suspicions.
    group
        Observations that no test can part from it.
    rivals
        Others whose odds against it are more than 1 in 20.
    """

    accused: Member
    w: float
    group: tuple[Member, ...]
    rivals: tuple[Member, ...]


if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

Role = Literal["reading", "prior", "untested", "construction"]
"""``reading``: people read it, and misread it. ``prior``: known beforehand. ``untested``: observed,
but no single one is tested. ``construction``: nobody observed it, it holds unknowns together."""


FACTORS = {"deg": float(np.rad2deg(1.0)), "ppm": 1e6, "%": 100.0}
"""How many of a unit make the unit of the unknowns; else 1."""


class Subjects(TypedDict, total=False):
    """Names of what a message is about, by the fields of a message."""

    frames: tuple[str, ...]
    labels: tuple[str, ...]
    lengths: tuple[str, ...]


class Misfit(NamedTuple):
    """One axis of an observation that does not fit.

    Attributes
    ----------
    member
        Which.
    w
        Its test statistic.
    redundancy
        Of the axis.
    off
        (r,) adjusted minus read, of all numbers of the observation, in its unit.
    """

    member: Member
    w: float
    redundancy: float
    off: Floats


@dataclass(frozen=True)
class Kind:
    """What is the same for a kind of observation in every survey.

    Attributes
    ----------
    name
        Of its group in the likelihood; of the planes of further areas, its beginning.
    source
        In the error budget.
    words
        In the table of all groups.
    role
        See `Role`.
    rank
        Of readings. Of inseparable ones that of the lowest rank represents all.
    axes, units
        What each of its numbers is called, and the unit of each.
    plural, check
        What several are called in a sentence, and what to check where the group does not fit;
        empty: no message is about it alone.
    look
        What to look at where several single ones do not fit.
    misfit_code
        Of the message on one that does not fit.
    is_judged
        Whether its variance factor is reported, though nobody observed it.
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
    source: str
    words: str
    role: Role = "prior"
    rank: int = 0
    axes: tuple[str, ...] = ()
    units: tuple[str, ...] = ("m",)
    plural: str = ""
    check: str = ""
    look: str = "Check their values and sigmas in the project."
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
        The likelihood that it is part of: survey, layout of the unknowns and ground exist already.
    kind
        One of `kinds`, where a class has several that differ in their words only.
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
        """Whether the survey has any such observation."""
        return True

    @classmethod
    def draw(cls, stated: Observations, truth: Truth) -> Observations:
        """Draw these kinds anew, about the truth and with their stated errors.

        Parameters
        ----------
        stated
            What was observed; kinds before this one are drawn already.
        truth
            Of the survey, with random numbers of this kind alone.

        Returns
        -------
        The observations, those of these kinds replaced by what took part.
        """
        del truth
        return stated

    @property
    def name(self) -> str:
        """Name of the group."""
        return self.kind.name

    def rows(self, state: State) -> Block | None:
        """Compute whitened residuals and derivatives; None where the state is impossible.

        Of states with a leading axis, the residuals have it too, and so do derivatives that differ
        from state to state.
        """
        raise NotImplementedError

    def sigma(self, found: Minimum[State]) -> Floats:
        """(n, r) standard deviations of independent numbers.

        The whitened residual of a prior changes by the inverse of its sigma.
        """
        return np.asarray(1.0 / found.blocks[self.name].jacobian[:, :, 0])

    def whitening(self) -> Floats | None:
        """(n, r, a) from errors of correlated numbers to whitened residuals; None: independent."""
        return None

    def tested(self, block: Block) -> Block:
        """Arrange the rows as they are tested."""
        return block

    def residuals(self, found: Minimum[State]) -> Floats:
        """(n, r) adjusted minus stated, of independent numbers, in their unit."""
        return np.asarray(found.blocks[self.name].residual * self.sigma(found))

    def things(self) -> Ints | None:
        """(n,) rows with the same number are one observation; None: each row is one."""
        return None

    def heights(self, found: Minimum[State]) -> Iterator[tuple[Ints, Floats]]:
        """Yield labels (n,) and derivatives (n, r) of the whitened residuals by their heights.

        For a point that is higher than its surface, while the observations stay as they are.
        """
        del found
        yield from ()

    def title(self, member: Member) -> str:
        """Name of an observation in a sentence, without an article."""
        return self.axis(member)

    def axis(self, member: Member) -> str:
        """Name of one of its numbers, in a table."""
        return self.kind.axes[member.axis]

    def suspect(self, member: Member) -> str:
        """What may be wrong where an observation does not fit, without an article."""
        return self.title(member)

    def unit(self, member: Member) -> tuple[str, float]:
        """Unit in which an error is stated, and how many of it make the unit of the unknowns."""
        return in_unit(self.kind.units[member.axis])

    def subjects(self, row: int) -> Subjects:
        """Frames, labels and lengths that an observation is about."""
        del row
        return {}

    def witness(self) -> Iterator[str]:
        """Yield what of it bears on the scale of the survey."""
        yield from ()

    def misfit(self, found: Misfit) -> tuple[str, str]:
        """Describe one that does not fit: as a sentence with what to check, and in a few words."""
        what = self.axis(found.member)
        return (
            f"What was assumed of the {what} does not fit the picks, lengths and log: check its "
            f"value and sigma in the project (w = {found.w:.1f}).",
            f"{what} (w = {found.w:.1f})",
        )

    def several(self) -> str:
        """Opening of a message on several that do not fit; ``{count}`` is their number."""
        what = self.kind.plural
        if not what:
            return "{count} things that were assumed do not fit the picks, lengths and log"
        return f"{{count}} {what} do not fit"

    def remedy(self, row: int) -> Remedy | None:
        """What would put it right; None where only a person can."""
        del row
        return None


def in_unit(unit: str) -> tuple[str, float]:
    """A unit, and how many of it make the unit of the unknowns."""
    return unit, FACTORS.get(unit, 1.0)

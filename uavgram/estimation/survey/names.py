"""Names of observations and priors in texts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from uavgram.estimation.survey.adjustment import Adjustment
from uavgram.estimation.survey.observations.observation import (
    Member,
    Observation,
    Subjects,
    Suspicion,
)
from uavgram.estimation.survey.observations.pixels import Pixels
from uavgram.model.naming import join_names

COUNT_WORDS = ("none", "one", "both", "all three", "all four", "all five", "all six")

MAX_RIVALS, MAX_CAUSES = 4, 8
"""Largest numbers of less likely blunders, and of all possible ones, that are named."""


@dataclass(frozen=True, eq=False)
class ObservationNames:
    """Names of the observations of an adjusted survey.

    Attributes
    ----------
    adjustment
        Adjusted survey.
    """

    adjustment: Adjustment

    def find_kind(self, member: Member) -> Observation:
        """Return the kind of observation of a member."""
        return self.adjustment.problem.observations[member.kind]

    def observation(self, member: Member) -> str:
        """Return ``pick of 'P' in 'img1.jpg'`` and the like, without an article."""
        return self.find_kind(member).title(member)

    def cause(self, member: Member) -> str:
        """Return the possible cause of a misfit, without an article."""
        return self.find_kind(member).suspect(member)

    def axis(self, member: Member) -> str:
        """Return ``boresight x``, ``fx`` and the like, for a table."""
        return self.find_kind(member).axis(member)

    def unit(self, member: Member) -> tuple[str, float]:
        """Return the unit of an error, and how many of it make the unit of the unknowns."""
        return self.find_kind(member).unit(member)

    def group(self, suspicion: Suspicion) -> str:
        """List the causes that no test separates."""
        return self.causes((suspicion.suspect, *suspicion.group))

    def causes(self, members: Sequence[Member]) -> str:
        """List possible causes: ``length 'a' or the picks of 'P' and 'Q' in 'img1.jpg'``."""
        others: list[str] = []
        by_frame: dict[str, list[str]] = {}
        for member in members:
            observation = self.find_kind(member)
            if isinstance(observation, Pixels):
                frame, label = observation.place(member.row)
                by_frame.setdefault(frame, []).append(repr(label))
            else:
                others.append(self.cause(member))
        parts = list(dict.fromkeys(others))
        for frame, labels in by_frame.items():
            picks = "pick" if len(labels) == 1 else "picks"
            parts.append(f"{picks} of {join_names(labels, None)} in {frame!r}")
        named = parts[:MAX_CAUSES]
        if more := len(parts) - len(named):
            named[-1] += " or another one" if more == 1 else f" or one of {more} others"
        return " or the ".join(named)

    def advice(self, suspicion: Suspicion) -> str:
        """Return a sentence on observations that no test separates; empty for a single one."""
        count = 1 + len(suspicion.group)
        if count == 1:
            return ""
        words = COUNT_WORDS[count] if count < len(COUNT_WORDS) else f"all {count}"
        return (
            f"The fault may be in the {self.group(suspicion)}; the numbers cannot show in which. "
            f"Check {words}."
        )

    def rivals(self, suspicion: Suspicion) -> str:
        """List the other possible causes as a sentence; empty if the outlier is located."""
        if not suspicion.rivals:
            return ""
        named = [self.cause(m) for m in suspicion.rivals[:MAX_RIVALS]]
        more = len(suspicion.rivals) - len(named)
        others = f" or one of {more} others" if more else ""
        return (
            f"Too few other readings check it to be sure: it could also be the "
            f"{' or the '.join(named)}{others}."
        )

    def subjects(self, *members: Member) -> Subjects:
        """Return frames, labels and lengths of observations, as a message carries them."""
        each = [self.find_kind(member).subjects(member.row) for member in members]
        together: Subjects = {
            "frames": tuple(dict.fromkeys(f for one in each for f in one.get("frames", ()))),
            "labels": tuple(dict.fromkeys(a for one in each for a in one.get("labels", ()))),
            "lengths": tuple(dict.fromkeys(i for one in each for i in one.get("lengths", ()))),
        }
        return together

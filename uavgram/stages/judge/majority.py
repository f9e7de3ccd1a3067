"""Test whether the known things that fit are a clear majority."""

from __future__ import annotations

from collections.abc import Sequence

from uavgram.estimation.reliability.redundancy import most_gross
from uavgram.estimation.reliability.stated_values import mistake
from uavgram.estimation.survey.adjustment import Refined
from uavgram.model.arrays import Ints
from uavgram.model.message import Message
from uavgram.model.naming import listed
from uavgram.model.result.known import KnownResults
from uavgram.model.result.tables import LineResults


def judge_majority(
    refined: Refined, line_index: Ints, lines: LineResults, known: KnownResults
) -> tuple[Message, ...]:
    """Report lengths and known things where those that fit may be the wrong ones.

    Parameters
    ----------
    refined
        The adjusted survey, its removals, and the causes of its misfits.
    line_index
        (L,) row of each length in the survey given to refine; -1 where it is not in it.
    lines, known
        Tables with their statuses.
    """
    out = {(one.kind, one.index) for one in refined.removals}
    line_out = [("line", int(k)) in out for k in line_index]
    known_out = [("known", i) in out for i in range(len(known.name))]
    faults = _faults(refined, lines, line_out)
    for i, name in enumerate(known.name):
        if known_out[i] or known.status[i] == "suspect":
            faults[name] = ("known", i)
    used = (*lines.status, *known.status).count("used")
    count = len(faults) + used
    if len(set(faults.values())) <= most_gross(count):
        return ()
    text = (
        f"{len(faults)} of {count} known lengths and things do not fit the others. These are too "
        "many to be the exception: those that do fit may be the wrong ones, so do not use these "
        "numbers. Look for what they have in common, such as a tape, a unit or a label: "
        f"{listed(map(repr, faults))}."
    )
    return (Message("warning", "many-suspects", text),)


def _faults(refined: Refined, lines: LineResults, out: Sequence[bool]) -> dict[str, object]:
    """Return the fault of each length that does not fit: a cause, a likely mistake, or itself.

    Several lengths in another unit have one fault.
    """
    causes = {name: ("cause", k) for k, one in enumerate(refined.causes) for name in one.settles}
    sigma = lines.adjusted_sigma_m
    return {
        name: causes.get(name)
        or mistake(lines.length_m[i], lines.sigma_m[i], lines.adjusted_m[i], sigma[i])
        or ("length", i)
        for i, name in enumerate(lines.name)
        if out[i] or lines.status[i] == "suspect"
    }

"""Known lengths that could be wrong: by what slip, and which."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from uavgram.estimation.reliability.hypotheses import Explained
from uavgram.estimation.reliability.test_statistics import falls_without
from uavgram.estimation.reliability.wrong_units import CONVERSIONS, DECIMALS, UNITS
from uavgram.model.message import Message
from uavgram.model.survey.mend import Mend
from uavgram.stages.refine.causes.doubted_lengths import FARTHEST, Doubted, Told, doubted
from uavgram.stages.refine.causes.hypothesis import PRICE, Hypothesis, Standing

MOST_WRONG = 4
"""Single wrong lengths that are proposed."""

ALL = 3
"""Lengths from which on what is wrong with every one of them is told of them all."""

STEPS = ((10.0, "ten metres"), (1.0, "one metre"), (0.1, "one decimetre"))
"""By which readings are off that were miscounted or misheard."""


class Slip(NamedTuple):
    """What a reading should be [m], and what was then mistaken."""

    right_m: float
    words: str


def wrong_lengths(standing: Standing) -> Iterator[Hypothesis]:
    """The lengths that take part and fit worst: each reading is wrong by any amount."""
    adjustment = standing.adjustment
    block = adjustment.minimum.blocks.get("lengths")
    if block is None:
        return
    lines = standing.refined.line_index[adjustment.problem.line_index]
    fall = falls_without(block, adjustment.covariance)
    for row in np.argsort(-fall, kind="stable")[:MOST_WRONG].tolist():
        yield Hypothesis(
            tell=None,
            mend=Mend(without_lines=frozenset([int(lines[row])])),
            promise=float(fall[row]),
            unknowns=1,
            price=PRICE + float(np.log(len(lines))),
        )


def wrong_readings(standing: Standing) -> Iterator[Hypothesis]:
    """Lengths that do not fit: in another unit, by a digit, or exchanged with one another."""
    found = doubted(standing)
    yield from _wrong_units(found)
    yield from _wrong_digits(found)
    yield from _exchanged(found)


def _wrong_units(found: Doubted) -> Iterator[Hypothesis]:
    known = [(size, f"in {unit}") for size, unit in UNITS] + list(CONVERSIONS)
    for size, words in known:
        error = found.reading_m * (1.0 - 1.0 / size)
        every = range(len(error))
        rows = [k for k in every if found.off([k], error[[k]]) < FARTHEST**2]
        for some in {(k,) for k in rows} | ({tuple(rows)} if len(rows) > 1 else set()):
            at = list(some)
            yield Hypothesis(
                tell=partial(_in_another_unit, found, at, size, words),
                mend=_with_readings(found, at, found.reading_m[at] / size),
                promise=found.fall(at, error[at]),
                price=found.price(at, len(known)),
                settles=found.settled(at),
            )


def _wrong_digits(found: Doubted) -> Iterator[Hypothesis]:
    for k in range(len(found.line)):
        slips = slips_of(float(found.reading_m[k]))
        for slip in slips:
            error = found.reading_m[[k]] - slip.right_m
            if found.off([k], error) > FARTHEST**2:
                continue
            yield Hypothesis(
                tell=partial(_by_a_digit, found, k, slip),
                mend=_with_readings(found, [k], [slip.right_m]),
                promise=found.fall([k], error),
                price=found.price([k], len(slips)),
                settles=found.settled([k]),
            )


def _exchanged(found: Doubted) -> Iterator[Hypothesis]:
    pairs = max(1, len(found.standing.survey.line_start) - 1)
    for i, j in combinations(range(len(found.line)), 2):
        reading = found.reading_m[[j, i]]
        error = found.reading_m[[i, j]] - reading
        if found.off([i, j], error) > 2.0 * FARTHEST**2:
            continue
        yield Hypothesis(
            tell=partial(_readings_exchanged, found, (i, j)),
            mend=_with_readings(found, [i, j], reading),
            promise=found.fall([i, j], error),
            price=found.price([i, j], pairs),
            settles=found.settled([i, j]),
        )


def slips_of(reading_m: float) -> tuple[Slip, ...]:
    """What a reading should be if a digit was missed, the point misplaced, or two transposed."""
    slips = [Slip(reading_m / size, words) for size, words in DECIMALS]
    for step, words in STEPS:
        slips.append(Slip(reading_m - step, f"it is {words} too long"))
        slips.append(Slip(reading_m + step, f"it is {words} too short"))
    text = max(f"{reading_m:.10g}", f"{reading_m:.2f}", key=len)
    digits = [k for k, each in enumerate(text) if each.isdigit()]
    for first, second in zip(digits, digits[1:], strict=False):
        if text[first] != text[second]:
            other = list(text)
            other[first], other[second] = text[second], text[first]
            written = "".join(other)
            slips.append(Slip(float(written), f"two digits are transposed, {text} for {written}"))
    return tuple(slip for slip in slips if slip.right_m > 0)


def _with_readings(found: Doubted, rows: Sequence[int], right_m: Sequence[float]) -> Mend:
    lines = [int(found.line[k]) for k in rows]
    return Mend(length_m=dict(zip(lines, map(float, right_m), strict=True)))


def _in_another_unit(
    found: Doubted, rows: Sequence[int], size: float, words: str, _: Explained | None
) -> Message:
    """The message on lengths that are in another unit."""
    right = [f"{found.reading_m[k] / size:.2f} m" for k in rows]
    if len(rows) >= ALL and len(rows) == len(found.standing.survey.line_start):
        text = (
            f"All lengths seem to be {words}, not in metres: write them in metres. The first, "
            f"{found.what(rows[0])}, would be {right[0]}; it {found.compared(rows[0])}."
        )
        return found.told("lengths-wrong-unit", rows, Told(text, ("", "", "")))
    each = [f"{found.what(k)} would be {m}" for k, m in zip(rows, right, strict=True)]
    if len(rows) > 1:
        text = (
            f"{len(rows)} lengths seem to be {words}, not in metres: write them in metres: "
            f"{'; '.join(each)}."
        )
        return found.told("line-wrong-unit", rows, Told(text, ("", "", "")))
    text = (
        f"The length {found.what(rows[0])} seems to be {words}, not in metres: write "
        f"{right[0]}. It {found.compared(rows[0])}."
    )
    ending = "Write them in metres."
    opening = f"{{count}} lengths seem to be {words}, not in metres"
    return found.told("line-wrong-unit", rows, Told(text, (opening, each[0], ending)))


def _by_a_digit(found: Doubted, k: int, slip: Slip, _: Explained | None) -> Message:
    """The message on a length with a wrong digit."""
    text = (
        f"The length {found.what(k)} seems to be misread or miswritten: {slip.words}. Look at the "
        f"notes, and write {slip.right_m:.10g} m if they bear it out; else look at the picks of its "
        f"ends. It {found.compared(k)}."
    )
    item = f"{found.what(k)} reads {found.reading_m[k]:.10g} m instead of {slip.right_m:.10g} m"
    opening = "{count} lengths seem to be misread or miswritten"
    ending = "Look at the notes, and at the picks of their ends."
    return found.told("line-wrong-digit", [k], Told(text, (opening, item, ending)))


def _readings_exchanged(found: Doubted, rows: tuple[int, int], _: Explained | None) -> Message:
    """The message on two lengths, each of which has the reading of the other."""
    first, second = (found.what(k) for k in rows)
    text = (
        f"The readings of the lengths {first} and {second} seem to be exchanged: look at the notes, "
        f"and swap them. The first {found.compared(rows[0])}; the second {found.compared(rows[1])}."
    )
    opening, ending = "{count} pairs of lengths seem to have each other's readings", "Swap them."
    several = (opening, f"{first} and {second}", ending)
    return found.told("lines-exchanged", rows, Told(text, several))

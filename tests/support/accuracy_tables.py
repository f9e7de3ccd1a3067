"""Tables of docs/accuracy.md: made of errors, and put between marks in the page.

The words of the page are written by hand, its tables by `tests/benchmarks/make_accuracy.py`: what
stands between ``<!-- made: NAME -->`` and ``<!-- end: NAME -->`` is replaced, nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Floats

ONE_PERCENT = 0.01
"""What the thesis that the program follows reaches of a length."""


@dataclass(frozen=True, eq=False)
class Compared:
    """Values of one kind beside their truth: (n,) errors, sigmas and true values, in one unit."""

    what: str
    error: Floats
    sigma: Floats
    true: Floats


def joined(what: str, several: Sequence[Compared]) -> Compared:
    """All values of several together."""
    error, sigma, true = (
        np.concatenate([getattr(one, name) for one in several])
        for name in ("error", "sigma", "true")
    )
    return Compared(what, error, sigma, true)


LENGTH_HEADS = ("measured", "values", "error", "sigma", "within 1 %", "z", "beyond 3 sigma")


def length_row(one: Compared) -> tuple[str, ...]:
    """Of lengths: errors and sigmas as shares of them."""
    share = np.abs(one.error) / one.true
    within = 100 * np.mean(share <= ONE_PERCENT)
    return (
        one.what,
        f"{len(share):,}",
        f"{100 * share.mean():.2f} %",
        f"{100 * np.mean(one.sigma / one.true):.2f} %",
        f"{within:.0f} %",
        *_honest(one),
    )


HEIGHT_HEADS = ("measured", "values", "error", "sigma", "z", "beyond 3 sigma")


def height_row(one: Compared) -> tuple[str, ...]:
    """Of heights, or of lengths from them: errors and sigmas in centimetres."""
    return (
        one.what,
        f"{len(one.error):,}",
        f"{100 * np.abs(one.error).mean():.1f} cm",
        f"{100 * one.sigma.mean():.1f} cm",
        *_honest(one),
    )


def _honest(one: Compared) -> tuple[str, str]:
    """z, and the share of errors beyond three sigmas."""
    z = one.error / one.sigma
    return f"{np.sqrt(np.mean(z**2)):.2f}", f"{100 * np.mean(np.abs(z) > 3):.1f} %"


def markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table as Markdown."""
    shown = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in shown)


def replaced(page: str, name: str, made: str) -> str:
    """The page with what was made of a name between its marks.

    Raises
    ------
    ValueError
        The page has not just one place for it.
    """
    marks = f"<!-- made: {name} -->", f"<!-- end: {name} -->"
    place = re.compile(f"{re.escape(marks[0])}.*?{re.escape(marks[1])}", re.DOTALL)
    found = place.findall(page)
    if len(found) != 1:
        raise ValueError(f"the page has {len(found)} places for {name!r}, marked as {marks[0]}")
    return place.sub(lambda _: f"{marks[0]}\n{made}\n{marks[1]}", page)

"""Picked state: the content of picks.csv, lines.csv and measure.csv, frozen."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from uavgram.io.json_codec import Table
from uavgram.model.observations import (
    SAME_PLACE_PX,
    Along,
    KnownLines,
    MeasurementRequest,
    Picks,
    Source,
)

PICKS = Table(Picks, elsewhere=("line",))
LINES = Table(KnownLines, elsewhere=("along",))
"""Rows of picks and lengths, by the fields of `Pick` and `Line`."""


@dataclass(frozen=True, kw_only=True)
class PickedPixel:
    """Label at a pixel of the original, unrotated photo `image` (a file name).

    `sigma_px` is None where none is stated. `source` and the fields after it give the origin of the
    pick, as in `Picks`: None and empty for a person's pick.
    """

    image: str
    label: str
    u_px: float
    v_px: float
    sigma_px: float | None = None
    source: Source = "hand"
    score: float | None = None
    from_image: str = ""
    from_u_px: float | None = None
    from_v_px: float | None = None


@dataclass(frozen=True, kw_only=True)
class Pick(PickedPixel):
    """Pick, with what is stated of its label.

    `height_m` and `height_sigma_m` are None, and `area` is empty, where the file has no value;
    `is_free` marks a height that is to be estimated. `again` is 0 for the first click of a label in
    a photo, and counts its independent repetitions.
    """

    height_m: float | None = None
    height_sigma_m: float | None = None
    is_free: bool = False
    area: str = ""
    again: int = 0

    @property
    def key(self) -> tuple[str, str]:
        """Identifier of a click and its repetitions: photo and label."""
        return self.image, self.label

    @property
    def height(self) -> dict[str, Any]:
        """Stated height of the label, by field."""
        return {name: getattr(self, name) for name in ("height_m", "height_sigma_m", "is_free")}

    def is_match_of(self, other: Pick) -> bool:
        """Return whether the program found this pick from `other` at its present position."""
        if self.from_u_px is None or self.from_v_px is None:
            return False
        aside = math.hypot(self.from_u_px - other.u_px, self.from_v_px - other.v_px)
        own = self.source == "match" and self.label == other.label
        return own and self.from_image == other.image and aside <= SAME_PLACE_PX


@dataclass(frozen=True, kw_only=True)
class Line:
    """Known length; `adjust` is False for a withheld length that only serves as a check.

    `tape` and `along` are as in lines.csv; the page leaves them unchanged.
    """

    name: str
    start: str
    end: str
    length_m: float
    sigma_m: float
    adjust: bool = True
    tape: str = ""
    along: Along = "slope"


@dataclass(frozen=True, kw_only=True)
class State:
    """Picks, known lengths and measurements in the order of their files."""

    picks: tuple[Pick, ...] = ()
    lines: tuple[Line, ...] = ()
    requests: tuple[MeasurementRequest, ...] = ()

    @property
    def labels(self) -> tuple[str, ...]:
        """Picked labels, in the order in which they first occur."""
        return tuple(dict.fromkeys(pick.label for pick in self.picks))

    def pick(self, image: str, label: str) -> Pick | None:
        """Return the first pick of a label in a photo; None if there is none."""
        return next((pick for pick in self.picks if pick.key == (image, label)), None)


def make_state(picks: Picks, lines: KnownLines, requests: Iterable[MeasurementRequest]) -> State:
    """Build the state from the content of the files.

    Parameters
    ----------
    picks, lines, requests
        Content of picks.csv, lines.csv and measure.csv.
    """
    earlier: Counter[tuple[str, str]] = Counter()
    again = []
    for pair in zip(picks.image, picks.label, strict=True):
        again.append(earlier[pair])
        earlier[pair] += 1
    rows = zip(PICKS.dump(picks), again, strict=True)
    return State(
        picks=tuple(Pick(**row, again=count) for row, count in rows),
        lines=tuple(
            Line(**row, along=lines.along_of(i)) for i, row in enumerate(LINES.dump(lines))
        ),
        requests=tuple(requests),
    )


def make_observations(state: State) -> tuple[Picks, KnownLines]:
    """Return picks and lengths in the form of the adjustment."""
    along = tuple(line.along for line in state.lines)
    return (
        PICKS.load([vars(pick) for pick in state.picks]),
        LINES.load([vars(line) for line in state.lines], along=along),
    )


def remove_matches(state: State, there: Pick) -> State:
    """Remove the matches found from a pick that is moved or removed."""
    kept = tuple(pick for pick in state.picks if not pick.is_match_of(there))
    return replace(state, picks=kept)

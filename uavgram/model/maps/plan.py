"""A plan on paper: its scale, and the sheets that it is printed on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats

Paper = Literal["a4", "letter"]
"""What is printed on."""

PAPER_MM: dict[Paper, tuple[float, float]] = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
"""Width and height, upright."""


@dataclass(frozen=True, kw_only=True)
class PlanSheet:
    """One sheet: the ground that it shows, in local metres.

    Attributes
    ----------
    number
        From 1, row by row from the north-west.
    column, row
        Its place among the sheets; row 0 is the northernmost.
    west_m, south_m, east_m, north_m
        Edges of what it shows.
    """

    number: int
    column: int
    row: int
    west_m: float
    south_m: float
    east_m: float
    north_m: float


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How a plan lies on paper. Paper is measured in millimetres from its lower left corner.

    Attributes
    ----------
    scale
        Metres on the ground for each metre on paper.
    paper_mm
        Width and height of the paper as it is turned.
    frame_mm
        Left, bottom, width and height of the frame that shows the ground.
    overlap_mm
        That neighbouring sheets have in common.
    columns, rows
        Of sheets.
    sheets
        All of them.
    """

    scale: int
    paper_mm: tuple[float, float]
    frame_mm: tuple[float, float, float, float]
    overlap_mm: float
    columns: int
    rows: int
    sheets: tuple[PlanSheet, ...]

    def on_paper(self, sheet: PlanSheet, world_m: Floats) -> Floats:
        """(..., 2) millimetres on a sheet of (..., 2 or 3) places in the world."""
        corner = np.array([sheet.west_m, sheet.south_m])
        return np.asarray(
            np.array(self.frame_mm[:2]) + (world_m[..., :2] - corner) * 1000.0 / self.scale
        )


@dataclass(frozen=True)
class PlanWish:
    """A plan that is asked for: its paper, and its scale (None: the largest that one sheet has)."""

    paper: Paper
    scale: int | None = None


PLAN_PDF = "plan.pdf"

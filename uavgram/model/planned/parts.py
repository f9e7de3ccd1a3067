"""Parts of a plan: photos, reference lines, points, measurements, the map of the accuracy."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedFrames(FrozenArrays):
    """F photos to be taken, in the order of the flight.

    Attributes
    ----------
    name
        (F,) such as ``P1``.
    center_world_m, world_from_camera
        (F, 3), (F, 3, 3) poses.
    heading_deg, gimbal_pitch_deg
        (F,) where the drone's nose points, from north, clockwise; -90 looks straight down.
    height_above_ground_m
        (F,) at the place of the photo.
    footprint_world_m
        (F, V, 3) what each photo shows of the ground, counterclockwise from above, not closed.
    safe_footprint_world_m
        (F, V, 3) what it shows even where the drone departs from the plan.
    """

    name: Annotated[tuple[str, ...], "n"]
    center_world_m: Annotated[Floats, "n", 3]
    world_from_camera: Annotated[Floats, "n", 3, 3]
    heading_deg: Annotated[Floats, "n"]
    gimbal_pitch_deg: Annotated[Floats, "n"]
    height_above_ground_m: Annotated[Floats, "n"]
    footprint_world_m: Annotated[Floats, "n", "v", 3]
    safe_footprint_world_m: Annotated[Floats, "n", "v", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedLines(FrozenArrays):
    """L reference lines to be laid out, marked at both ends, and taped.

    Attributes
    ----------
    name
        (L,) such as ``L1``; the ends' labels are ``L1a`` and ``L1b``.
    start_world_m, end_world_m
        (L, 3) ends on the ground.
    length_m, sigma_m
        (L,) and the standard deviation of the tape reading.
    frames_seen
        (L,) in how many photos both ends are.
    redundancy
        (L,) 0 (nothing checks its reading) to 1.
    mdb_m
        (L,) the smallest mistake of its reading that the survey will notice; NaN where none is.
    mean_sigma_without
        (L,) `FlightPlanned.mean_sigma` if this line is lost; NaN where nothing holds it then.
    """

    name: Annotated[tuple[str, ...], "n"]
    start_world_m: Annotated[Floats, "n", 3]
    end_world_m: Annotated[Floats, "n", 3]
    length_m: Annotated[Floats, "n"]
    sigma_m: Annotated[Floats, "n"]
    frames_seen: Annotated[Floats, "n"]
    redundancy: Annotated[Floats, "n"]
    mdb_m: Annotated[Floats, "n", NAN_IS_NONE]
    mean_sigma_without: Annotated[Floats, "n", NAN_IS_NONE]

    @property
    def start_label(self) -> tuple[str, ...]:
        """(L,) label of the first end of each."""
        return tuple(f"{name}a" for name in self.name)

    @property
    def end_label(self) -> tuple[str, ...]:
        """(L,) label of the other end of each."""
        return tuple(f"{name}b" for name in self.name)


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPlates(FrozenArrays):
    """L coded plates to be laid flat; none where lines are taped.

    Attributes
    ----------
    name
        (L,) as the program calls them, ``T0``: what is printed on it has that number.
    corner_world_m
        (L, 4, 3) corners of the black square, counterclockwise from above.
    side_m
        Of each.
    frames_seen
        (L,) in how many photos all of it is.
    mean_sigma_without
        (L,) `FlightPlanned.mean_sigma` if it is lost; NaN where nothing holds it then.
    """

    name: Annotated[tuple[str, ...], "n"] = ()
    corner_world_m: Annotated[Floats, "n", 4, 3] = field(
        default_factory=lambda: np.zeros((0, 4, 3))
    )
    side_m: float = 0.0
    frames_seen: Annotated[Floats, "n"] = field(default_factory=_none)
    mean_sigma_without: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)

    @property
    def center_world_m(self) -> Floats:
        """(L, 3) their middles."""
        return np.asarray(self.corner_world_m.mean(axis=1))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedPoints(FrozenArrays):
    """K points that what is wanted is measured between: (K,) labels, (K, 3) places."""

    label: Annotated[tuple[str, ...], "n"]
    world_m: Annotated[Floats, "n", 3]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedMeasurements(FrozenArrays):
    """M values that will be measured; none where only the map was asked for.

    Attributes
    ----------
    name, kind, unit
        (M,) as in results.json.
    points
        (M,) labels of `PlannedPoints`, in order.
    value, sigma
        (M,) what it will be by the plan's points, and the standard deviation to expect.
    wanted_sigma
        (M,) what is good enough; NaN where nobody said.
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: Annotated[tuple[str, ...], "n"]
    unit: Annotated[tuple[str, ...], "n"]
    points: Annotated[tuple[tuple[str, ...], ...], "n"]
    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]
    wanted_sigma: Annotated[Floats, "n", NAN_IS_NONE]


@dataclass(frozen=True, kw_only=True, eq=False)
class AccuracyGrid(FrozenArrays):
    """How well lengths will be known over the area.

    Attributes
    ----------
    center_world_m
        (K, 3) middles of square cells, on the ground.
    cell_m
        Their side.
    length_m
        Of the length about each middle whose standard deviation is told.
    sigma_m
        (K,) root mean square over lengths to the east and to the north; NaN where no photo shows
        them.
    """

    center_world_m: Annotated[Floats, "n", 3]
    cell_m: float
    length_m: float
    sigma_m: Annotated[Floats, "n", NAN_IS_NONE]

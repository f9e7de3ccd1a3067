"""What was observed of a survey, as people and logs state it, and a truth to draw it anew from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera.calibration import Calibration
from uavgram.model.flight.frames import Frames
from uavgram.model.flight.pose import Telemetry
from uavgram.model.options import GroundOptions, TapeOptions
from uavgram.model.survey.known import NO_KNOWN, KnownThings
from uavgram.model.survey.observations import KnownLines, KnownWorldPoints, Picks
from uavgram.model.survey.ties import NO_TIES, TiePicks

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

NO_CONTROL = KnownWorldPoints(label=(), world_m=np.empty((0, 3)), sigma_m=np.empty((0, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """Everything that was observed, and what is known beforehand, by name.

    Attributes
    ----------
    calibration
        Of the camera.
    picks, lines
        Picked pixels, and known lengths; those that are withheld stay out.
    known
        What else is known of points; what is withheld stays out.
    control
        Points with known coordinates in the world [m].
    ties
        Sightings of tie points.
    telemetry
        Where each frame was, by the log or the photos; None without either.
    ground
        What is known of the ground's planes.
    picks_sigma_px
        Standard deviation of picks that state none [px].
    picks_identification_sigma_m
        How far people pick beside what was meant, alike in all photos; 0: not at all.
    tape, own_scale_sigma
        How good the tapes are; names and priors of the scale of those that are other than that.
    photos
        Names of all photos in order: that of the frames where there is no telemetry.
    exposures
        When each photo was taken; None where nobody says.
    copies
        Photos of an exposure that is counted already -> the photo that is.
    """

    calibration: Calibration
    picks: Picks
    lines: KnownLines
    known: KnownThings = NO_KNOWN
    control: KnownWorldPoints = NO_CONTROL
    ties: TiePicks = NO_TIES
    telemetry: Telemetry | None = None
    ground: GroundOptions
    picks_sigma_px: float
    picks_identification_sigma_m: float = 0.0
    tape: TapeOptions = field(default_factory=TapeOptions)
    own_scale_sigma: tuple[tuple[str, float], ...] = ()
    photos: Sequence[str] = ()
    exposures: Frames | None = None
    copies: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Truth:
    """An adjusted survey that is taken for the truth, and random numbers for errors about it."""

    problem: SurveyProblem
    state: State
    rng: np.random.Generator

    @cached_property
    def row(self) -> dict[str, int]:
        """Index of each label."""
        return {name: k for k, name in enumerate(self.problem.survey.label)}

    @cached_property
    def place_m(self) -> Floats:
        """(K, 3) of the labels."""
        return self._points[0]

    @cached_property
    def slope(self) -> Floats:
        """(K, 2) of the ground at the labels."""
        return self._points[1][:, 2, :2]

    @property
    def _points(self) -> tuple[Floats, Floats, Floats]:
        return self.problem.world_points(self.state, np.arange(len(self.row)))

    @cached_property
    def height_m(self) -> Floats:
        """(K,) of the labels above the ground."""
        ground, _, _ = self.problem.ground_points(self.state, np.arange(len(self.row)))
        return np.asarray(self.place_m[:, 2] - ground[:, 2])

    @cached_property
    def intrinsics(self) -> Floats:
        """(P,) of the camera."""
        return self.problem.intrinsics(self.state)

    def seen(self, frame: Ints, place_m: Floats) -> Floats:
        """(n, 2) pixels of places (n, 3) in frames (n,)."""
        center, rotation = self.state.center[frame], self.state.rotation[frame]
        poses = RowPoses(center, rotation, np.zeros((len(frame), 6)))
        return project_rows(self.problem.survey.calibration, self.intrinsics, poses, place_m)

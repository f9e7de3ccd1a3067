"""Observations as people and logs state them, and the cameras' motion during the readout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from uavgram.estimation.survey.unknowns import State
from uavgram.geometry.ground.row_projection import RowPoses, project_rows
from uavgram.geometry.motion.camera_motion import camera_motion
from uavgram.model.arrays import Floats, Ints
from uavgram.model.camera import UNKNOWN_READOUT, Calibration, Readout
from uavgram.model.flight_log import Track
from uavgram.model.frames import Frames, Telemetry
from uavgram.model.observations import NO_KNOWN, KnownLines, KnownThings, KnownWorldPoints, Picks
from uavgram.model.options import GroundOptions, TapeOptions
from uavgram.model.survey import NO_TIES, RollingShutter, Survey, TiePicks

if TYPE_CHECKING:
    from uavgram.estimation.survey.likelihood import SurveyProblem

NO_CONTROL = KnownWorldPoints(label=(), world_m=np.empty((0, 3)), sigma_m=np.empty((0, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """All observations and prior values, by name.

    Attributes
    ----------
    calibration
        Calibration of the camera.
    picks, lines
        Picked pixels, and known lengths, without those that are withheld.
    known
        Other known things about points, without those that are withheld.
    control
        Points with known coordinates in the world [m].
    ties
        Sightings of tie points.
    telemetry
        Pose of each frame, by the log or the photos; None without either.
    ground
        Priors of the ground's planes.
    picks_sigma_px
        Standard deviation of picks that state none [px].
    picks_identification_sigma_m
        Standard deviation of the offset between picked and meant points, equal in all photos [m];
        0: none.
    tape, own_scale_sigma
        Accuracy of the tapes; names and prior scale sigmas of the tapes with a different one.
    photos
        Names of all photos in order: that of the frames where there is no telemetry.
    exposures
        Exposure time of each photo; None if unknown.
    copies
        Photos of an exposure that is counted already -> the photo that is.
    contradicting
        Photos whose picks are not used -> the copy of the same file that they contradict.
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
    contradicting: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class SimulatedTruth:
    """Adjusted survey that is taken for the truth, with random numbers for errors about it."""

    problem: SurveyProblem
    state: State
    rng: np.random.Generator

    @cached_property
    def row(self) -> dict[str, int]:
        """Index of each label."""
        return {name: k for k, name in enumerate(self.problem.survey.label)}

    @cached_property
    def place_m(self) -> Floats:
        """(K, 3) positions of the labels."""
        return self._points[0]

    @cached_property
    def slope(self) -> Floats:
        """(K, 2) slopes of the ground at the labels."""
        return self._points[1][:, 2, :2]

    @property
    def _points(self) -> tuple[Floats, Floats, Floats]:
        return self.problem.world_points(self.state, np.arange(len(self.row)))

    @cached_property
    def height_m(self) -> Floats:
        """(K,) heights of the labels above the ground."""
        ground, _, _ = self.problem.ground_points(self.state, np.arange(len(self.row)))
        return np.asarray(self.place_m[:, 2] - ground[:, 2])

    @cached_property
    def intrinsics(self) -> Floats:
        """(P,) interior orientation of the camera."""
        return self.problem.intrinsics(self.state)

    def project_places(self, frame: Ints, place_m: Floats) -> Floats:
        """Compute the (n, 2) pixels of places (n, 3) in frames (n,)."""
        center, rotation = self.state.center[frame], self.state.rotation[frame]
        poses = RowPoses(center, rotation, np.zeros((len(frame), 6)))
        return project_rows(self.problem.survey.calibration, self.intrinsics, poses, place_m)


MIN_SHIFT_PX = 0.05
"""Smallest shift of rows at the edge of any photo for which the readout time is kept [px]: a tenth
of a good pick's noise."""

GLOBAL_SHUTTER = Readout(value_s=0.0, sigma_s=0.0)
"""Readout of all rows at once."""

MIN_SIGMA_S = 1e-6
"""Smallest sigma of a readout time that is stated as exact [s]: an unknown needs a sigma, and no
camera is as steady."""


def add_readout(survey: Survey, shared: Floats) -> Survey:
    """Return the survey with the data for the readout time, or without them where it has no effect.

    The readout time is left out if the photos come without a track, if the camera is known to take
    all rows at once, or if it moved so little that no pick would be affected.

    Parameters
    ----------
    survey
        Survey, whose calibration holds the prior of the readout.
    shared
        (12,) unknowns of the telemetry at which the camera's motion is evaluated.
    """
    readout = survey.calibration.readout or UNKNOWN_READOUT
    telemetry, track = survey.telemetry, survey.track
    if telemetry is None or not isinstance(track, Track) or readout == GLOBAL_SHUTTER:
        return replace(survey, rolling=None)
    motion = np.zeros((len(survey.frame_id), 6))
    names = [survey.frame_id[k] for k in telemetry.frame_index]
    motion[telemetry.frame_index] = camera_motion(track, telemetry, names, shared)
    longest_s = abs(readout.value_s) + readout.sigma_s
    if estimate_edge_shift_px(survey, longest_s * motion) < MIN_SHIFT_PX:
        return replace(survey, rolling=None)
    known = replace(readout, sigma_s=max(readout.sigma_s, MIN_SIGMA_S))
    return replace(survey, rolling=RollingShutter(readout=known, motion=motion))


def estimate_edge_shift_px(survey: Survey, sweep: Floats) -> float:
    """Estimate the largest shift of pixels at the upper and lower edge by sweeps (F, 6) [px]."""
    if survey.seeds is None or not len(sweep):
        return 0.0
    away = np.abs(survey.seeds.center_world_m[:, 2] - survey.ground.height_m)
    turn = np.linalg.norm(sweep[:, 3:], axis=1)
    # A shift of the camera moves the image like a turn by shift / distance.
    turn += np.linalg.norm(sweep[:, :3], axis=1) / np.maximum(away, 1.0)
    return float(survey.calibration.parameters[0] * turn.max() / 2)

"""Result of a run: the content of results.json as frozen, batched data, and pictures of a report.

NaN means "there is none" (null in the file).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays
from uavgram.model.camera import Calibration
from uavgram.model.message import Message
from uavgram.model.naming import Column
from uavgram.model.provenance import Provenance
from uavgram.model.result import reliability, tables
from uavgram.model.survey import World

POSE_NAMES = ("east", "north", "up", "turn about right", "turn about down", "turn about forward")
"""Unknowns of a pose: centre in the world, and small rotations about the camera's axes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OrientationCorrelation(FrozenArrays):
    """Correlations of the adjusted poses with the shared unknowns, to four decimals.

    Those within one pose follow from its covariance. NaN where something is known exactly.

    Attributes
    ----------
    parameters
        (P,) names of the shared unknowns: the lens model's parameters, height and slopes of the
        ground plane, and the readout time where that is an unknown.
    shared
        (P, P) among these.
    frame_id
        (F,) adjusted photos.
    with_pose
        (F, 6, P) of each pose with them.
    """

    parameters: tuple[str, ...]
    shared: Annotated[Floats, "p", "p", NAN_IS_NONE]
    frame_id: Annotated[tuple[str, ...], "n"]
    with_pose: Annotated[Floats, "n", 6, "p", NAN_IS_NONE]


MAX_SIGMA_RATIO = 0.9
"""Largest ratio of posterior to prior sigma of a parameter that the survey determines."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraUpdate(FrozenArrays):
    """The camera before and after the survey, parameter by parameter.

    Attributes
    ----------
    names
        (P,) of the parameters.
    prior_value, prior_sigma
        (P,) the calibration.
    value, sigma
        (P,) with the survey's own observations.
    ratio
        (P,) sigma over prior sigma: 1 where nothing was learnt; NaN where the calibration holds the
        parameter fixed.
    shift
        (P,) of the value, in prior sigmas; NaN likewise.
    learnt
        (P,) whether the survey determines the parameter: its ratio is below `MAX_SIGMA_RATIO`.
    """

    names: Annotated[tuple[str, ...], "n"]
    prior_value: Annotated[Floats, "n"]
    prior_sigma: Annotated[Floats, "n"]
    value: Annotated[Floats, "n"]
    sigma: Annotated[Floats, "n"]
    ratio: Annotated[Floats, "n", NAN_IS_NONE]
    shift: Annotated[Floats, "n", NAN_IS_NONE]
    learnt: Annotated[Bools, "n"]


def compare_cameras(prior: Calibration, refined: Estimate) -> CameraUpdate:
    """Compare a calibration with its estimate from the survey.

    Parameters
    ----------
    prior
        The calibration before the survey.
    refined
        Its parameters in the adjustment, (P,).
    """
    sigma = np.sqrt(np.maximum(prior.covariance.diagonal(), 0.0))  # not negative by rounding
    free = np.where(sigma > 0, sigma, np.nan)
    ratio = refined.sigma / free
    return CameraUpdate(
        names=prior.parameter_names,
        prior_value=prior.parameters,
        prior_sigma=sigma,
        value=refined.value,
        sigma=refined.sigma,
        ratio=ratio,
        shift=(refined.value - prior.parameters) / free,
        learnt=ratio < MAX_SIGMA_RATIO,  # False for NaN
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate(FrozenArrays):
    """A shared unknown: value and standard deviation, both (n,)."""

    value: Annotated[Floats, "n", Column(is_single=True)]
    sigma: Annotated[Floats, "n", Column(is_single=True)]


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedResult:
    """Unknowns shared by all frames, after the adjustment.

    Attributes
    ----------
    boresight_deg, lever_arm_m, position_bias_m, heading_bias_deg, clock_offset_s
        Of the telemetry; None without a log. Biases are log minus truth; the position bias is
        (east, north, up); the boresight a rotation vector in the camera frame.
    clock_drift_ppm
        Of the camera's clock against the flight's, about the middle of the exposures; None without
        a log.
    readout_s
        Time in which a photo is read from its first row to the last; None where it is no unknown.
    tape_scale
        By the name of each tape that was used, which may be empty: +0.01 where it is 1 % too long,
        and so reads short. Empty where tapes are exact, or none was used.
    intrinsics
        In the order of the lens model's parameters.
    """

    boresight_deg: Estimate | None
    lever_arm_m: Estimate | None
    position_bias_m: Estimate | None
    heading_bias_deg: Estimate | None
    clock_offset_s: Estimate | None
    clock_drift_ppm: Estimate | None = None
    readout_s: Estimate | None = None
    intrinsics: Estimate
    tape_scale: Mapping[str, Estimate] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class AreaPlane(FrozenArrays):
    """Plane of one area of the ground, after the adjustment.

    Attributes
    ----------
    name
        Of the area.
    height_m, slope_deg
        At the pivot; [d up / d east, d up / d north] as angles.
    pivot_m
        (2,) east and north of the point about which the slopes turn.
    """

    name: str
    height_m: Estimate
    slope_deg: Annotated[Estimate, Column(axes=("east", "north"))]
    pivot_m: Annotated[Floats, 2]

    @property
    def surface(self) -> Floats:
        """(3,) height at the pivot [m] and slopes to the east and to the north [m/m]."""
        return np.concatenate([self.height_m.value, np.tan(np.deg2rad(self.slope_deg.value))])

    def height_at(self, east_north_m: Floats) -> Floats:
        """Return the (...) heights [m] of the plane at (..., 2) world positions [m]."""
        surface = self.surface
        return np.asarray(surface[0] + (east_north_m - self.pivot_m) @ surface[1:])


@dataclass(frozen=True, kw_only=True)
class GroupFactor:
    """Variance factor of one group of observations (``pixels``, ``lengths``, ``telemetry``...).

    `redundancy` is the group's share of the degrees of freedom; `probability` that of a variance
    factor at least as large by chance (upper tail).
    """

    name: str
    observations: int
    redundancy: float
    variance_factor: float
    probability: float


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """Another pose that fits the lengths (nearly) as well: the lengths alone are ambiguous.

    `cost` is its weighted sum of squared residuals; `values` are the measured values under it, in
    the order of the measurements.
    """

    frame_id: str
    cost: float
    height_m: float
    tilt_deg: float
    values: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class SolutionSummary:
    """Statistics of the adjustment."""

    degrees_of_freedom: int
    variance_factor: float
    chi2_probability: float
    iterations: int
    converged: bool
    alternatives: tuple[Alternative, ...]
    groups: tuple[GroupFactor, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Result:
    """The content of results.json (schema 1)."""

    name: str
    provenance: Provenance
    world: World
    camera: Calibration
    """As given, before the adjustment."""
    shared: SharedResult
    areas: tuple[AreaPlane, ...]
    """Planes of the ground, one for each area; the default area's, where it has points, first."""
    frames: tables.FrameResults
    points: tables.PointResults
    lines: tables.LineResults
    known: tables.KnownResults = tables.NOTHING_KNOWN
    control_lines: tables.ControlLineResults = tables.NO_LINES_OF_POSITION
    """Lines of known position; each has a row in `known` too."""
    picks: tables.PickResults
    measurements: tables.MeasurementResults
    profiles: tables.ProfileResults = tables.NO_PROFILES
    """Points of the measured profiles."""
    monte_carlo: tables.MonteCarloResults | None = None
    """Sampled distribution, where sampling was requested."""
    second_order: reliability.SecondOrder | None = None
    """Errors of first-order propagation in the measurements."""
    evidence: reliability.Evidence | None = None
    """External reliability: effects of errors that no test finds."""
    removals: tuple[reliability.RemovalRecord, ...] = ()
    """Observations removed as gross errors, in order."""
    error_budget: reliability.ErrorBudget | None = None
    """Sources of the variance of each measurement."""
    checks_overall: reliability.ChecksOverall | None = None
    """All checks together; None where nothing was withheld."""
    point_checks: tables.PointChecks
    line_checks: tables.LineChecks
    solution: SolutionSummary
    noise: reliability.Noise | None = None
    """Sizes of errors, estimated from the survey; None where the stated sigmas were kept."""
    orientation: OrientationCorrelation | None = None
    """Correlations of the poses with camera and plane; None where nothing was adjusted."""
    ties: tables.TieSummary | None = None
    """All tie points together; None where none were used."""
    messages: tuple[Message, ...]
    verdict: reliability.Verdict

    @property
    def plane(self) -> AreaPlane:
        """Plane of the first area: all of the ground where no pick names another."""
        return self.areas[0]

    @property
    def has_seed(self) -> Bools:
        """(F,) whether a frame has a pose from the telemetry."""
        return np.isfinite(self.frames.seed.center_world_m[:, 0])

    @property
    def has_refined(self) -> Bools:
        """(F,) whether a frame has an adjusted pose."""
        return np.isfinite(self.frames.refined.center_world_m[:, 0])


Subject = Literal["overview", "point", "measurement"]


@dataclass(frozen=True, kw_only=True)
class Region:
    """Part of a photo to be shown.

    Attributes
    ----------
    subject, row
        Kind of subject, and its row among the points or the measurements; 0 for an overview.
    frame
        Row of the photo among the frames.
    left_px, top_px, width_px, height_px
        Whole pixels of the photo: the first column and row, and their numbers.
    """

    subject: Subject
    row: int
    frame: int
    left_px: int
    top_px: int
    width_px: int
    height_px: int


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Picture of a region.

    Attributes
    ----------
    region
        Region of the photo.
    jpeg
        Image of that part, perhaps reduced.
    shown_px
        Its width in its own pixels: less than the region's where it is reduced.
    stretch
        Values of the photo that are shown as black and as white, and gamma; None where it is shown
        unchanged.
    """

    region: Region
    jpeg: bytes = field(repr=False)
    shown_px: int
    stretch: tuple[float, float, float] | None


@dataclass(frozen=True, kw_only=True)
class GroundPicture:
    """Top view of the ground, composed from photos.

    Attributes
    ----------
    jpeg
        White where no photo shows the ground.
    west_m, north_m
        World coordinates of the north-western corner.
    width_m, height_m
        On the ground.
    brightened
        Whether it is shown brighter than the photos are.
    """

    jpeg: bytes = field(repr=False)
    west_m: float
    north_m: float
    width_m: float
    height_m: float
    brightened: bool


@dataclass(frozen=True, kw_only=True)
class Pictures:
    """All pictures in a report.

    Attributes
    ----------
    shown
        The overview first, then points and measurements by their rows.
    left_out
        Names of points and measurements without a picture.
    ground
        Top view below the plan; None where photos show none of it.
    """

    shown: tuple[Picture, ...] = ()
    left_out: tuple[str, ...] = ()
    ground: GroundPicture | None = None


NO_PICTURES = Pictures()
"""Pictures of a report without photos."""

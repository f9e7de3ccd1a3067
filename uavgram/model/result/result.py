"""Result of a run: the content of results.json as frozen, batched data.

NaN means "there is none" (null in the file).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavgram.model.arrays import Bools
from uavgram.model.camera.calibration import Calibration
from uavgram.model.message import Message
from uavgram.model.provenance import Provenance
from uavgram.model.result.known import (
    NO_LINES_OF_POSITION,
    NOTHING_KNOWN,
    ControlLineResults,
    KnownResults,
)
from uavgram.model.result.reliability import (
    ChecksOverall,
    ErrorBudget,
    Evidence,
    Noise,
    RemovalRecord,
    SecondOrder,
)
from uavgram.model.result.shared import AreaPlane, OrientationCorrelation, SharedResult
from uavgram.model.result.tables import (
    NO_PROFILES,
    FrameResults,
    LineChecks,
    LineResults,
    MeasurementResults,
    MonteCarloResults,
    PickResults,
    PointChecks,
    PointResults,
    ProfileResults,
    TieSummary,
)
from uavgram.model.result.verdict import Verdict
from uavgram.model.survey.survey import World


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
    frames: FrameResults
    points: PointResults
    lines: LineResults
    known: KnownResults = NOTHING_KNOWN
    control_lines: ControlLineResults = NO_LINES_OF_POSITION
    """Lines of known position; each has a row in `known` too."""
    picks: PickResults
    measurements: MeasurementResults
    profiles: ProfileResults = NO_PROFILES
    """Points of the measured profiles."""
    monte_carlo: MonteCarloResults | None = None
    """Sampled distribution, where sampling was requested."""
    second_order: SecondOrder | None = None
    """Errors of first-order propagation in the measurements."""
    evidence: Evidence | None = None
    """External reliability: effects of errors that no test finds."""
    removals: tuple[RemovalRecord, ...] = ()
    """Observations removed as gross errors, in order."""
    error_budget: ErrorBudget | None = None
    """Sources of the variance of each measurement."""
    checks_overall: ChecksOverall | None = None
    """All checks together; None where nothing was withheld."""
    point_checks: PointChecks
    line_checks: LineChecks
    solution: SolutionSummary
    noise: Noise | None = None
    """Sizes of errors, estimated from the survey; None where the stated sigmas were kept."""
    orientation: OrientationCorrelation | None = None
    """Correlations of the poses with camera and plane; None where nothing was adjusted."""
    ties: TieSummary | None = None
    """All tie points together; None where none were used."""
    messages: tuple[Message, ...]
    verdict: Verdict

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

"""Batch of several surveys: result of each, and statistics of all together.

NaN and empty texts mean "there is none".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.result.reliability import VerdictLevel

SurveyStatus = Literal["done", "unchanged", "failed", "waiting"]
"""State of one survey in the batch.

Measured now; measured before with the same inputs, options and version; failed, with the reason in
its message; or not begun, since the batch was interrupted.
"""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Fit of one kind of observations in one survey, relative to the stated sigmas.

    Attributes
    ----------
    kind
        ``checks``: the withheld observations, else a group of observations.
    squares
        Sum of squared errors, weighted by their (joint) inverse covariance.
    freedom
        Expected value of that sum: count of the compared numbers, or redundancy of the group.
    """

    kind: str
    squares: float
    freedom: float


@dataclass(frozen=True, kw_only=True)
class ParameterUpdate:
    """Camera parameter as stated in the camera file and as adjusted in one survey."""

    name: str
    stated: float
    stated_sigma: float
    value: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class SurveyRow:
    """Row of one survey in the table of the batch.

    Attributes
    ----------
    project
        The project file.
    message
        Why it failed; empty otherwise.
    level, sentence
        The verdict; None and empty where there is none.
    taken_utc
        Time of its photos, ISO 8601; empty where unknown.
    latitude_deg, longitude_deg
        Position of its origin; NaN where it is not georeferenced.
    camera, drone
        Name in the camera file; make, model and serial number in the photos.
    mean_sigma_m
        Mean standard deviation of its measurements in metres.
    worst_w
        Largest standardised residual of a pick, a length or a withheld length, with its sign.
    warnings
        Codes of its warnings, each once.
    output
        Folder of its results.
    seconds
        Computing time.
    tries
        Number of worker processes used: more than one where one died.
    """

    name: str
    project: str
    status: SurveyStatus
    message: str = ""
    level: VerdictLevel | None = None
    sentence: str = ""
    taken_utc: str = ""
    latitude_deg: float = float("nan")
    longitude_deg: float = float("nan")
    camera: str = ""
    drone: str = ""
    photos: int = 0
    measurements: int = 0
    mean_sigma_m: float = float("nan")
    worst_w: float = float("nan")
    warnings: tuple[str, ...] = ()
    output: str = ""
    seconds: float = float("nan")
    tries: int = 0
    fits: tuple[Fit, ...] = ()
    seen: tuple[ParameterUpdate, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FileState:
    """State of a file when a survey was measured: path, size, modification time, SHA-256."""

    path: str
    size_bytes: int
    changed_ns: int
    sha256: str


@dataclass(frozen=True, kw_only=True)
class SurveyRecord:
    """Record of a measured survey, kept so that it need not be measured again.

    Attributes
    ----------
    row
        Its row in the table.
    version
        Version of the program that measured it.
    asked
        Options of the batch.
    inputs, results
        Every input file that was read, and its results.json.
    """

    row: SurveyRow
    version: str
    asked: str
    inputs: tuple[FileState, ...]
    results: FileState


@dataclass(frozen=True, kw_only=True)
class PooledRatio:
    """Ratio of errors to stated sigmas, pooled over several surveys.

    Attributes
    ----------
    of, name
        ``all``, ``camera`` or ``drone``, and its name.
    kind
        Kind of the observations.
    surveys, freedom
        Number of surveys, and number of independent values compared.
    ratio
        Root mean square of errors over sigmas: 1 where the sigmas are correct.
    low, high
        Its 95 % range.
    """

    of: str
    name: str
    kind: str
    surveys: int
    freedom: float
    ratio: float
    low: float
    high: float

    @property
    def is_small(self) -> bool:
        """Return whether the sigmas are too small: the errors exceed them."""
        return self.low > 1.0

    @property
    def is_large(self) -> bool:
        """Return whether the sigmas are too large."""
        return self.high < 1.0


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Offset and drift of a camera parameter from its file, from all surveys of one camera.

    Attributes
    ----------
    offset, offset_sigma
        Mean of the surveys minus the file; the sigma includes the file's own.
    per_year, per_year_sigma
        Change with time; NaN where the surveys span no time.
    is_off, drifts
        Whether offset or drift exceeds the limit that chance exceeds once in a hundred tests of
        this batch.
    """

    camera: str
    parameter: str
    surveys: int
    offset: float
    offset_sigma: float
    per_year: float
    per_year_sigma: float
    is_off: bool
    drifts: bool


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Content of the batch's table and page."""

    rows: tuple[SurveyRow, ...]
    pooled: tuple[PooledRatio, ...]
    drifts: tuple[Drift, ...]
    version: str
    created_utc: str
    seconds: float

    def count(self, status: SurveyStatus) -> int:
        """Return the number of surveys with a status."""
        return sum(row.status == status for row in self.rows)

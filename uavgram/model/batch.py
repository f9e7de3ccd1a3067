"""Many surveys run as one batch: what each gave, and what all of them say together.

NaN and empty texts stand for "there is none".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uavgram.model.result.verdict import VerdictLevel

SurveyStatus = Literal["done", "unchanged", "failed", "waiting"]
"""Of one survey: measured now; measured before, with the same inputs, options and version; its
message says why it gave nothing; not begun, as the batch was interrupted."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """How one survey fits observations of a kind, in the sigmas that were stated.

    Attributes
    ----------
    kind
        ``checks``: what was withheld, else a group of observations.
    squares
        Sum of squared errors over their (joint) covariance.
    freedom
        What that sum is expected to be: numbers compared, or the group's redundancy.
    """

    kind: str
    squares: float
    freedom: float


@dataclass(frozen=True, kw_only=True)
class SeenParameter:
    """A camera's parameter as its file states it, and as one survey adjusted it."""

    name: str
    stated: float
    stated_sigma: float
    value: float
    sigma: float


@dataclass(frozen=True, kw_only=True)
class SurveyRow:
    """One survey in the batch's table.

    Attributes
    ----------
    project
        The project file.
    message
        Why it failed; empty otherwise.
    level, sentence
        The verdict; None and empty where there is none.
    taken_utc
        ISO 8601, of its photos; empty where nothing tells.
    latitude_deg, longitude_deg
        Of its origin; NaN where it has no place on the earth.
    camera, drone
        The name in the camera file; make, model and serial number in the photos.
    mean_sigma_m
        Of its measurements in metres.
    worst_w
        The largest standardised residual of a pick, a length or a withheld length, with its sign.
    warnings
        Codes of its warnings, each once.
    output
        Folder of its results.
    seconds
        Of computing time.
    tries
        How many workers it took: more than one where one died.
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
    seen: tuple[SeenParameter, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FileState:
    """A file as it was when a survey was measured: path, size, time of its last change, SHA-256."""

    path: str
    size_bytes: int
    changed_ns: int
    sha256: str


@dataclass(frozen=True, kw_only=True)
class SurveyRecord:
    """What is kept of a measured survey, so that it need not be measured again.

    Attributes
    ----------
    row
        Its row in the table.
    version
        Of the program that measured it.
    asked
        The options of the batch.
    inputs, results
        Every file that was read, and its results.json.
    """

    row: SurveyRow
    version: str
    asked: str
    inputs: tuple[FileState, ...]
    results: FileState


@dataclass(frozen=True, kw_only=True)
class Pooled:
    """Errors over stated sigmas of several surveys together.

    Attributes
    ----------
    of, name
        ``all``, ``camera`` or ``drone``, and which.
    kind
        Of the observations.
    surveys, freedom
        How many there are, and how many independent numbers they compare.
    ratio
        Root mean square of errors over sigmas: 1 where the sigmas are honest.
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
        """Whether sigmas are too small: errors are larger than they say."""
        return self.low > 1.0

    @property
    def is_large(self) -> bool:
        """Whether sigmas are too large."""
        return self.high < 1.0


@dataclass(frozen=True, kw_only=True)
class Drift:
    """What the surveys of one camera say of a parameter of it, apart from its file.

    Attributes
    ----------
    offset, offset_sigma
        Mean of the surveys minus the file; the sigma contains the file's own.
    per_year, per_year_sigma
        Its change with time; NaN where the surveys span no time.
    is_off, drifts
        Whether either is beyond what chance does once in a hundred tests of this batch.
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
    """The content of the batch's table and page."""

    rows: tuple[SurveyRow, ...]
    pooled: tuple[Pooled, ...]
    drifts: tuple[Drift, ...]
    version: str
    created_utc: str
    seconds: float

    def count(self, status: SurveyStatus) -> int:
        """How many surveys have a status."""
        return sum(row.status == status for row in self.rows)

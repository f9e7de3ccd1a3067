"""Tables of a result: a row for each frame, point, line, known quantity, pick, measurement and tie.

NaN means "there is none" (null in the file).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal, get_args

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, freeze
from uavgram.model.naming import POSE_AXES, Column
from uavgram.model.observations import Source
from uavgram.model.result.reliability import MeasurementStatus

SOURCES: tuple[Source, ...] = get_args(Source)


def count_picks_by_source(picks: PickResults) -> dict[str, dict[Source, int]]:
    """Count the used picks of each label by their source."""
    found: dict[str, dict[Source, int]] = {}
    for label, source, status in zip(picks.label, picks.source, picks.status, strict=True):
        if status in ("used", "suspect"):
            counts = found.setdefault(label, {})
            counts[source] = counts.get(source, 0) + 1
    return {label: {s: n[s] for s in SOURCES if s in n} for label, n in found.items()}


def find_sources(
    picks: PickResults, points: Sequence[Sequence[str]]
) -> tuple[tuple[Source, ...], ...]:
    """Return the sources of the picks on which each group of labels is based.

    Parameters
    ----------
    picks
        All of the project.
    points
        (M,) groups of labels, such as those of measurements.
    """
    by_label = count_picks_by_source(picks)
    made = [{source for label in labels for source in by_label.get(label, {})} for labels in points]
    return tuple(tuple(source for source in SOURCES if source in one) for one in made)


def is_only_by_program(picks: PickResults, points: Sequence[Sequence[str]]) -> Bools:
    """Return a (M,) mask of groups of labels that have picks, but none made by a person.

    Parameters
    ----------
    picks, points
        As for `find_sources`.
    """
    behind = find_sources(picks, points)
    return np.array([bool(one) and "hand" not in one for one in behind], dtype=np.bool_)


COLUMNS = ("station", "offset", "height", "ground")
"""Values of each point of a profile."""
PLACE_KEYS = tuple(f"{name}_m" for name in COLUMNS)
SIGMA_KEYS = tuple(f"{name}_sigma_m" for name in COLUMNS)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProfileResults(FrozenArrays):
    """N points of profiles, one profile after the other.

    A profile runs from its first point to its last, seen from above.

    Attributes
    ----------
    profile
        (N,) name of the profile.
    label
        (N,) name of the point.
    place_m
        (N, 4) station from the first point; offset, to the right of the line positive; height above
        the first point; height of the ground at the point above the first point.
    sigma_m
        (N, 4) their standard deviations; 0 where that holds by definition.
    """

    profile: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    place_m: Annotated[Floats, "n", 4, Column(keys=PLACE_KEYS, axes=COLUMNS, stem="")]
    sigma_m: Annotated[Floats, "n", 4, Column(keys=SIGMA_KEYS, axes=COLUMNS)]

    def each(self) -> Iterator[tuple[str, Ints]]:
        """Iterate over the profiles: name, and rows of its points."""
        for name in dict.fromkeys(self.profile):
            yield name, np.array([i for i, one in enumerate(self.profile) if one == name])


NO_PROFILES = ProfileResults(
    profile=(), label=(), place_m=np.zeros((0, 4)), sigma_m=np.zeros((0, 4))
)


@dataclass(frozen=True, kw_only=True)
class TieSummary:
    """All tie points together; the number of sightings of each photo is in `FrameResults`.

    Attributes
    ----------
    points, sightings
        Number of tie points used, and of their sightings in photos.
    rms_px
        Root mean square of the residuals of each coordinate [px].
    """

    points: int
    sightings: int
    rms_px: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TieCloud(FrozenArrays):
    """Tie points for display; they are too many for results.json.

    Attributes
    ----------
    position_world_m
        (T, 3) east, north, up, as adjusted.
    frame, pixel_px
        (N,), (N, 2) photos that show them (among all frames of the project), and the pixels.
    """

    position_world_m: Annotated[Floats, "t", 3]
    frame: Annotated[Ints, "n"]
    pixel_px: Annotated[Floats, "n", 2]


FrameStatus = Literal["refined", "seeded", "unmatched", "rejected"]
LineStatus = Literal["used", "suspect", "removed", "checked", "unseen"]
PickStatus = Literal["used", "suspect", "removed", "unused"]
HeightSource = Literal["ground", "stated", "free", "found"]
"""Source of a point's height above the ground."""

IN_SPACE = Column(stem="space_covariance", unit="m2")
INTERVAL = Column(axes=("lower", "upper"), stem="bound_95")


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseTable(FrozenArrays):
    """F poses, NaN in all of a row where a frame has none; conventions as in `Poses`."""

    center_world_m: Annotated[Floats, "n", 3, NAN_IS_NONE]
    world_from_camera: Annotated[Floats, "n", 3, 3, NAN_IS_NONE, Column(axes=("x", "y", "z"))]
    covariance: Annotated[Floats, "n", 6, 6, NAN_IS_NONE, Column(axes=POSE_AXES)]


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameResults(FrozenArrays):
    """F frames, as many as there are photos.

    Attributes
    ----------
    frame_id, path
        (F,) file name; path of the photo, relative to the project's folder where it is inside.
    time_utc_s
        (F,) of the exposure, after the adjustment; NaN where unknown.
    status, reason
        (F,) ``refined`` (in the adjustment, with a pick, a match or a tie point), ``seeded``,
        ``unmatched``, ``rejected``; and why.
    seed, refined
        Poses from the telemetry, and after the adjustment: of the middle row.
    sweep
        (F, 6) movement of the camera while the photo was read, from first row to last: δcentre in
        world [m], δθ in camera [rad]; 0 where unknown.
    ties, ties_rms_px
        (F,) number of tie points seen in it and used, and the root mean square of their residuals
        in each coordinate; 0 and NaN where there are none, and if omitted.
    folder
        Folder of the project, the start of relative paths; not in files, which may be moved.
    """

    frame_id: Annotated[tuple[str, ...], "n"]
    path: tuple[str, ...]
    time_utc_s: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[FrameStatus, ...]
    reason: tuple[str, ...]
    seed: PoseTable
    refined: PoseTable
    sweep: Annotated[Floats, "n", 6, Column("moved_while_read", axes=POSE_AXES)] = field(
        default_factory=lambda: np.zeros((0, 6))
    )
    ties: Annotated[Ints, "n"] = field(default_factory=lambda: np.zeros(0, np.int64))
    ties_rms_px: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))
    folder: str = field(default="", repr=False)

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        for name, none in (
            ("sweep", np.zeros((n, 6))),
            ("ties", np.zeros(n, np.int64)),
            ("ties_rms_px", np.full(n, np.nan)),
        ):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, none)
        super().__post_init__()


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarUncertainty(FrozenArrays):
    """Uncertainty of K points in plan, and in space of those off the ground.

    Attributes
    ----------
    covariance_m2
        (K, 2, 2) of east and north.
    ellipse_95_m
        (K, 2) semi-major and semi-minor axis of the 95 % ellipse (2.4477 sigma).
    ellipse_azimuth_rad
        (K,) of the major axis, clockwise from north, in [0, pi).
    covariance_m3
        (K, 3, 3) of east, north and up, where the rotation in space is removed too; NaN of points
        on the ground.
    """

    covariance_m2: Annotated[Floats, "n", 2, 2]
    ellipse_95_m: Annotated[Floats, "n", 2, Column(axes=("major", "minor"))]
    ellipse_azimuth_rad: Annotated[Floats, "n"]
    covariance_m3: Annotated[Floats, "n", 3, 3, NAN_IS_NONE, IN_SPACE] = field(
        default_factory=lambda: np.zeros((0, 3, 3))
    )

    def __post_init__(self) -> None:
        if not len(self.covariance_m3):
            nothing = np.full((len(self.covariance_m2), 3, 3), np.nan)
            object.__setattr__(self, "covariance_m3", nothing)
        super().__post_init__()


@dataclass(frozen=True, kw_only=True, eq=False)
class PointResults(FrozenArrays):
    """K ground points.

    Attributes
    ----------
    label
        (K,) names.
    position_world_m
        (K, 3) east, north, up.
    covariance_m2
        (K, 2, 2) of east and north.
    ellipse_95_m
        (K, 2) semi-major and semi-minor axis of the 95 % ellipse (2.4477 sigma).
    ellipse_azimuth_rad
        (K,) of the major axis, clockwise from north, in [0, pi).
    relative
        The same within the survey: a shift and a rotation common to all points are removed. It is
        the accuracy of the scene's shape, independent of the receiver's bias.
    departure_m, departure_sigma_m
        (K,) height of the ground at the point above the plane of its area; both 0 where the ground
        is a plane.
    height_above_ground_m, height_sigma_m
        (K,) above the smooth adjusted ground below; both 0 for a point on the ground. The sigma of
        a point off it includes the roughness of the ground.
    covariance_m3
        (K, 3, 3) of east, north and up [m2].
    height_source
        (K,) source of the height: the ``ground``, ``stated``, ``free`` as declared by the user, or
        ``found`` by the adjustment without a declaration.
    latitude_deg, longitude_deg
        (K,) NaN with gauge ``plane``.
    frames
        (K,) the names of the frames in which it was picked and used.
    neighbour_sigma_m
        (K,) accuracy relative to the neighbouring points: the median of the standard deviations of
        the distances to them. NaN for a single point.
    neighbours
        (K,) their names, the nearest first.
    """

    label: Annotated[tuple[str, ...], "n"]
    position_world_m: Annotated[Floats, "n", 3, Column(stem="")]
    covariance_m2: Annotated[Floats, "n", 2, 2]
    ellipse_95_m: Annotated[Floats, "n", 2, Column(axes=("major", "minor"))]
    ellipse_azimuth_rad: Annotated[Floats, "n"]
    relative: PlanarUncertainty
    departure_m: Annotated[Floats, "n"]
    departure_sigma_m: Annotated[Floats, "n"]
    height_above_ground_m: Annotated[Floats, "n"]
    height_sigma_m: Annotated[Floats, "n"]
    covariance_m3: Annotated[Floats, "n", 3, 3, IN_SPACE]
    latitude_deg: Annotated[Floats, "n", NAN_IS_NONE]
    longitude_deg: Annotated[Floats, "n", NAN_IS_NONE]
    frames: tuple[tuple[str, ...], ...]
    height_source: Annotated[tuple[HeightSource, ...], "n"]
    neighbour_sigma_m: Annotated[Floats, "n", NAN_IS_NONE] = field(
        default_factory=lambda: np.zeros(0)
    )
    neighbours: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        if not self.neighbours:
            object.__setattr__(self, "neighbour_sigma_m", np.full(len(self.label), np.nan))
            object.__setattr__(self, "neighbours", ((),) * len(self.label))
        super().__post_init__()

    @property
    def is_off_ground(self) -> Bools:
        """(K,) mask of points off the ground."""
        return np.asarray((self.height_above_ground_m != 0) | (self.height_sigma_m > 0))

    @property
    def departs(self) -> Bools:
        """(K,) mask of points at which the ground is not a plane."""
        return np.asarray(self.departure_sigma_m > 0, dtype=np.bool_)


@dataclass(frozen=True, kw_only=True, eq=False)
class LineResults(FrozenArrays):
    """L known lengths, as given and as adjusted.

    Attributes
    ----------
    length_m, sigma_m
        (L,) as given.
    adjusted_m, adjusted_sigma_m
        (L,) expected tape reading between the adjusted points (with its scale, and horizontal or
        not, as the length was taken), and its sigma; NaN where an end was never picked.
    residual_m
        (L,) adjusted minus given.
    w, redundancy, mdb_m
        (L,) Baarda's standardised residual, redundancy number in [0, 1] and minimal detectable
        bias; for a withheld line w is its error over the joint sigma, the others NaN.
    status
        (L,) ``used``, ``suspect``, ``removed``, ``checked`` (withheld), ``unseen``.
    """

    name: Annotated[tuple[str, ...], "n"]
    start: Annotated[tuple[str, ...], "n", Column("from")]
    end: Annotated[tuple[str, ...], "n", Column("to")]
    length_m: Annotated[Floats, "n"]
    sigma_m: Annotated[Floats, "n"]
    adjusted_m: Annotated[Floats, "n", NAN_IS_NONE]
    adjusted_sigma_m: Annotated[Floats, "n", NAN_IS_NONE]
    residual_m: Annotated[Floats, "n", NAN_IS_NONE]
    w: Annotated[Floats, "n", NAN_IS_NONE]
    redundancy: Annotated[Floats, "n", NAN_IS_NONE]
    mdb_m: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[LineStatus, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class PickResults(FrozenArrays):
    """P picks, as given, with their fit.

    Attributes
    ----------
    image, label, pixel_px, sigma_px
        As given, defaults filled in.
    residual_px
        (P, 2) adjusted projection minus pick; NaN where unused.
    w
        (P,) the larger (in magnitude) standardised residual of the two coordinates.
    redundancy
        (P,) mean of the two coordinates' redundancy numbers.
    status
        (P,) ``used``, ``suspect``, ``removed`` (it contradicts the rest), ``unused`` (it determines
        nothing, or its frame is not in the adjustment).
    source
        (P,) origin: ``hand``, ``match`` or ``target``; if omitted, a person made all.
    score
        (P,) agreement of a match or target with its template, 0 to 1; NaN for others.
    """

    image: Annotated[tuple[str, ...], "n"]
    label: tuple[str, ...]
    pixel_px: Annotated[Floats, "n", 2, Column(keys=("u_px", "v_px"), axes=("u", "v"), stem="")]
    sigma_px: Annotated[Floats, "n"]
    residual_px: Annotated[Floats, "n", 2, NAN_IS_NONE, Column(axes=("u", "v"))]
    w: Annotated[Floats, "n", NAN_IS_NONE]
    redundancy: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[PickStatus, ...]
    source: Annotated[tuple[Source, ...], "n"] = ()
    score: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not self.source:
            object.__setattr__(self, "source", ("hand",) * len(self.image))
        if not len(self.score):
            object.__setattr__(self, "score", np.full(len(self.image), np.nan))
        super().__post_init__()

    @property
    def by_hand(self) -> Bools:
        """(P,) mask of the picks made by a person."""
        return np.array([source == "hand" for source in self.source], dtype=np.bool_)


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasurementResults:
    """M measured values with their joint covariance.

    Attributes
    ----------
    name, kind, points
        (M,) as requested. A ``coordinate`` gives two rows, named ``NAME east`` and ``NAME north``.
    value, sigma
        (M,) in `unit`; NaN where it cannot be computed.
    unit
        (M,) m, m2, m3, deg or m/s.
    interval_95
        (M, 2) lower and upper bound.
    correlation
        (M, M), same order; NaN in rows that cannot be computed.
    alternative_values
        (M,) values of other solutions that fit the observations as well, where they are outside
        `interval_95`: empty where they all agree. If omitted, there are none.
    sigma_stated
        (M,) the sigma if all errors were as large as stated, where the survey gave another size;
        else, and if omitted, `sigma`.
    shift_relief_10cm
        (M,) largest shift of the value if the ground at its points is 10 cm higher or lower than
        assumed; NaN where there is no value, or (if omitted) it was not computed.
    shift_tape_1pct
        (M,) its shift if the tapes read 1 % more; NaN likewise, and without lengths.
    parameters
        (M,) as in measure.csv, such as ``mu=0.7;mu_sigma=0.05``; if omitted, there are none.
    status
        (M,) trustworthiness of each; if omitted, nothing checked them.
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: tuple[str, ...]
    points: tuple[tuple[str, ...], ...]
    value: Annotated[Floats, "n", NAN_IS_NONE]
    sigma: Annotated[Floats, "n", NAN_IS_NONE]
    unit: tuple[str, ...]
    interval_95: Annotated[Floats, "n", 2, NAN_IS_NONE, INTERVAL]
    correlation: Annotated[Floats, "n", "n", NAN_IS_NONE]
    alternative_values: Annotated[tuple[tuple[float, ...], ...], "n"] = ()
    sigma_stated: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    shift_relief_10cm: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    shift_tape_1pct: Annotated[Floats, "n", NAN_IS_NONE] = field(default_factory=_none)
    parameters: Annotated[tuple[str, ...], "n"] = ()
    status: Annotated[tuple[MeasurementStatus, ...], "n"] = ()

    def __post_init__(self) -> None:
        if not len(self.sigma_stated):
            object.__setattr__(self, "sigma_stated", self.sigma)
        if not self.parameters:
            object.__setattr__(self, "parameters", ("",) * len(self.name))
        if not self.status:
            object.__setattr__(self, "status", ("not-checked",) * len(self.name))
        if not self.alternative_values:
            object.__setattr__(self, "alternative_values", ((),) * len(self.name))
        for name in ("shift_relief_10cm", "shift_tape_1pct"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(len(self.name), np.nan))
        freeze(self)

    @cached_property
    def outlines(self) -> tuple[tuple[str, ...], ...]:
        """(M,) labels that are drawn: for a volume those around it, without its top and plane."""
        beside = [("top=" in text) + 3 * ("plane=" in text) for text in self.parameters]
        return tuple(
            labels[: len(labels) - more] if kind == "volume" else labels
            for labels, kind, more in zip(self.points, self.kind, beside, strict=True)
        )

    @cached_property
    def is_ambiguous(self) -> Bools:
        """(M,) mask of values for which another solution is outside the interval."""
        ambiguous = np.array([len(values) > 0 for values in self.alternative_values], dtype=bool)
        ambiguous.flags.writeable = False
        return ambiguous


@dataclass(frozen=True, kw_only=True, eq=False)
class MonteCarloResults(FrozenArrays):
    """Sampled distribution of the M measured values, to compare with their first-order sigmas.

    Attributes
    ----------
    mean, sigma
        (M,) in the measurement's unit; NaN where a value cannot be computed.
    interval_95
        (M, 2) probabilistically symmetric: the 2.5 % and 97.5 % quantiles.
    samples, failed
        Number of repetitions that converged, and of those that did not and were left out.
    seed
        Of the draws.
    """

    mean: Annotated[Floats, "n", NAN_IS_NONE]
    sigma: Annotated[Floats, "n", NAN_IS_NONE]
    interval_95: Annotated[Floats, "n", 2, NAN_IS_NONE, INTERVAL]
    samples: int
    failed: int
    seed: int


@dataclass(frozen=True, kw_only=True, eq=False)
class PointChecks(FrozenArrays):
    """C check points: result minus known coordinates.

    Attributes
    ----------
    error_m, sigma_m
        (C, 3) east, north, up; sigma joint of result and known coordinates.
    mahalanobis
        (C,) square root of the error's squared Mahalanobis distance.
    """

    label: Annotated[tuple[str, ...], "n"]
    error_m: Annotated[Floats, "n", 3]
    sigma_m: Annotated[Floats, "n", 3]
    mahalanobis: Annotated[Floats, "n"]


@dataclass(frozen=True, kw_only=True, eq=False)
class LineChecks(FrozenArrays):
    """C withheld lengths: adjusted minus taped, its sigma, and their ratio."""

    name: Annotated[tuple[str, ...], "n"]
    error_m: Annotated[Floats, "n"]
    sigma_m: Annotated[Floats, "n"]
    z: Annotated[Floats, "n"]


LineOfPositionStatus = Literal["used", "suspect", "removed", "checked", "unseen"]
"""Status as of a known quantity; never ``idle``, as a line always constrains a placed world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ControlLineResults(FrozenArrays):
    """L lines of position in a georeferenced world; NaN means "there is none".

    Attributes
    ----------
    name, points
        (L,) as given.
    start_world_m, end_world_m
        (L, 3) as given; without known heights, up is that of the adjusted ground.
    has_height
        (L,) whether the heights are known.
    sigma_m
        (L,) of the line's position, perpendicular to it, in its middle.
    offset_m
        (L,) of the adjusted points from the line, in plan: the largest, positive to the left.
    w, redundancy, mdb_m
        (L,) as in `KnownResults`, where each line has its row too.
    status
        (L,) as there.
    """

    name: Annotated[tuple[str, ...], "n"]
    points: tuple[tuple[str, ...], ...]
    start_world_m: Annotated[Floats, "n", 3]
    end_world_m: Annotated[Floats, "n", 3]
    has_height: Annotated[Bools, "n"]
    sigma_m: Annotated[Floats, "n"]
    offset_m: Annotated[Floats, "n", NAN_IS_NONE]
    w: Annotated[Floats, "n", NAN_IS_NONE]
    redundancy: Annotated[Floats, "n", NAN_IS_NONE]
    mdb_m: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[LineOfPositionStatus, ...]


NO_LINES_OF_POSITION = ControlLineResults(
    name=(),
    points=(),
    start_world_m=np.empty((0, 3)),
    end_world_m=np.empty((0, 3)),
    has_height=np.empty(0, dtype=np.bool_),
    sigma_m=np.empty(0),
    offset_m=np.empty(0),
    w=np.empty(0),
    redundancy=np.empty(0),
    mdb_m=np.empty(0),
    status=(),
)


KnownStatus = Literal["used", "suspect", "removed", "checked", "unseen", "idle"]


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownResults(FrozenArrays):
    """N known quantities; NaN means "there is none".

    Attributes
    ----------
    name, kind, points
        (N,) as given.
    value, sigma
        (N,) as given, in `unit`; a condition (a right angle, points in line) has no value.
    unit
        (N,) m, m2 or deg.
    adjusted, adjusted_sigma
        (N,) the value between the adjusted points, and its sigma. For a condition, its misclosure:
        for several numbers (offsets of points from a line) the root of the sum of squares, without
        a sigma.
    residual
        (N,) adjusted less given; for a condition the same as `adjusted`.
    w, redundancy, mdb
        (N,) Baarda's standardised residual, redundancy number and minimal detectable bias; for
        several numbers the largest w (in magnitude), the mean redundancy, and the largest bias. For
        withheld ones w is the error over the joint sigma (for several numbers, a normal deviate as
        unlikely as their chi-square), the others NaN.
    status
        (N,) ``used``, ``suspect``, ``removed``, ``checked`` (withheld), ``unseen``, ``idle`` (all
        of its points are on the ground, which it does not constrain).
    """

    name: Annotated[tuple[str, ...], "n"]
    kind: tuple[str, ...]
    points: tuple[tuple[str, ...], ...]
    value: Annotated[Floats, "n", NAN_IS_NONE]
    sigma: Annotated[Floats, "n"]
    unit: tuple[str, ...]
    adjusted: Annotated[Floats, "n", NAN_IS_NONE]
    adjusted_sigma: Annotated[Floats, "n", NAN_IS_NONE]
    residual: Annotated[Floats, "n", NAN_IS_NONE]
    w: Annotated[Floats, "n", NAN_IS_NONE]
    redundancy: Annotated[Floats, "n", NAN_IS_NONE]
    mdb: Annotated[Floats, "n", NAN_IS_NONE]
    status: tuple[KnownStatus, ...]


NOTHING_KNOWN = KnownResults(
    name=(),
    kind=(),
    points=(),
    value=np.empty(0),
    sigma=np.empty(0),
    unit=(),
    adjusted=np.empty(0),
    adjusted_sigma=np.empty(0),
    residual=np.empty(0),
    w=np.empty(0),
    redundancy=np.empty(0),
    mdb=np.empty(0),
    status=(),
)

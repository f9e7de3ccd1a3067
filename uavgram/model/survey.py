"""Survey: everything that enters the adjustment, by index instead of by name; corrections of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, freeze, rows_of
from uavgram.model.camera import Calibration, Readout
from uavgram.model.flight_log import HeightDatum
from uavgram.model.frames import CandidatePoses, Flight, Poses, TelemetryPrior
from uavgram.model.message import Message
from uavgram.model.observations import Along, KnownThing


@dataclass(frozen=True, kw_only=True, eq=False)
class TiePicks(FrozenArrays):
    """N sightings of tie points in photos, by name.

    Attributes
    ----------
    image
        (N,) file name of the photo.
    tie
        (N,) name of the tie point; a name occurs in two photos or more.
    pixel_px, sigma_px
        (N, 2), (N,) position, in the convention of picks, and the standard deviation of each
        coordinate.
    line
        (N,) line of the file; empty where they come from no file.
    """

    image: Annotated[tuple[str, ...], "n"]
    tie: Annotated[tuple[str, ...], "n"]
    pixel_px: Annotated[Floats, "n", 2]
    sigma_px: Annotated[Floats, "n"]
    line: tuple[int, ...] = ()


NO_TIES = TiePicks(image=(), tie=(), pixel_px=np.empty((0, 2)), sigma_px=np.empty(0))


MIN_WEIGHT_SHARE = 0.5
"""Smallest remaining share of the weights of a label's ties at which they are still used."""


def _no_index() -> Ints:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundConstraints(FrozenArrays):
    """Constraints on the ground height at B labels, each from m tie points around it.

    Attributes
    ----------
    label
        (B,) by index.
    tie, weight
        (B, m) tie points, and the weights of their heights above the area's plane in that of the
        label.
    sigma_m
        (B,) of the weighted height, apart from the prior that the ground is even; NaN where they do
        not determine the height.
    uneven
        (B,) unevenness of the ground there as a multiple of that of the area.
    """

    label: Annotated[Ints, "b"] = field(default_factory=_no_index)
    tie: Annotated[Ints, "b", "m"] = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    weight: Annotated[Floats, "b", "m"] = field(default_factory=lambda: np.zeros((0, 0)))
    sigma_m: Annotated[Floats, "b", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))
    uneven: Annotated[Floats, "b"] = field(default_factory=lambda: np.zeros(0))

    def reindex_labels(self, new_label: Ints) -> GroundConstraints:
        """Return the rows of labels with new indices (K,); without those of dropped labels (-1)."""
        kept = rows_of(self, np.flatnonzero(new_label[self.label] >= 0), "b")
        return replace(self, **kept | {"label": new_label[kept["label"]]})

    def reindex_ties(self, new_point: Ints) -> GroundConstraints:
        """Return it with the new indices of the tie points (T,), -1 for dropped ones.

        The other points replace them: their weights are rescaled and their sigma grows. A label
        that has lost most of its weights gets no height (NaN).
        """
        if not len(self.label):
            return self
        tie = np.append(new_point, -1)[self.tie]
        weight = np.where(tie >= 0, self.weight, 0.0)
        left = np.abs(weight).sum(axis=1) / np.abs(self.weight).sum(axis=1)
        says = left > MIN_WEIGHT_SHARE
        left = np.where(says, left, 1.0)
        first = np.take_along_axis(tie, np.argmax(np.abs(weight), axis=1)[:, None], axis=1)
        return replace(
            self,
            tie=np.where(tie >= 0, tie, first),
            weight=np.where(says[:, None], weight / left[:, None], self.weight),
            sigma_m=np.where(says, self.sigma_m / left, np.nan),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings(FrozenArrays):
    """N sightings of T tie points, by index.

    Attributes
    ----------
    frame, point
        (N,) frame and point of each sighting.
    pixel_px, sigma_px
        (N, 2), (N,) position, and the standard deviation of each coordinate.
    row
        (N,) row of each in the table from which it comes; -1: none.
    pick
        (T,) pick that shows the same point: the first of a chain of matches; -1 for points without
        a pick.
    constraints
        Constraints from ties on the ground at labels near them.
    """

    frame: Annotated[Ints, "n"] = field(default_factory=_no_index)
    point: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pixel_px: Annotated[Floats, "n", 2] = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_px: Annotated[Floats, "n"] = field(default_factory=lambda: np.zeros(0))
    row: Annotated[Ints, "n"] = field(default_factory=_no_index)
    pick: Annotated[Ints, "t"] = field(default_factory=_no_index)
    constraints: GroundConstraints = field(default_factory=GroundConstraints)

    @property
    def points(self) -> int:
        """Number T of tie points."""
        return len(self.pick)

    def remove(self, out: Bools) -> tuple[Sightings, Ints]:
        """Return the sightings outside the mask `out` (N,), and the points (T',) that are left.

        A point that is then seen once or never is left out too.
        """
        rows = np.flatnonzero(~out)
        count = np.bincount(self.point[rows], minlength=self.points)
        rows = rows[count[self.point[rows]] > 1]
        points, point = np.unique(self.point[rows], return_inverse=True)
        some = rows_of(self, rows, "n") | rows_of(self, points, "t")
        new_point = np.full(self.points, -1)
        new_point[points] = np.arange(len(points))
        beside = self.constraints.reindex_ties(new_point)
        return replace(self, **some | {"point": point}, constraints=beside), points


NO_SIGHTINGS = Sightings()


LOGGED_RATE_RAD_S = 0.03
"""Standard deviation of a camera's angular rate from a log, 1.7 degrees a second.

Reason: attitudes accurate to 0.1 degree, ten times a second, and a mount that shakes in between.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class RollingShutter(FrozenArrays):
    """Input of an adjustment that estimates the readout time.

    Attributes
    ----------
    readout
        Its prior.
    motion
        (F, 6) of each frame at its exposure: velocity [m/s], in the world or, where the survey's
        gauge is free, in camera axes; angular rate in camera axes [rad/s].
    rate_sigma_rad_s
        Standard deviation of the angular rates in `motion`.
    by_photos
        Whether no log gives the motion of the camera: `motion` is then the path from photo to
        photo, divided by the time between them or at a usual speed, and the unknown is a readout
        time at that speed.
    """

    readout: Readout
    motion: Annotated[Floats, "f", 6]
    rate_sigma_rad_s: float = LOGGED_RATE_RAD_S
    by_photos: bool = False

    @property
    def first_value(self) -> Floats:
        """(1,) prior readout time [s]."""
        return np.array([self.readout.value_s])


class Geodetic(NamedTuple):
    """Position on the earth: WGS 84, and height above the datum stated with it."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True, kw_only=True)
class World:
    """Origin of the local east-north-up world.

    Attributes
    ----------
    origin
        Its position; None where the world is not georeferenced.
    height_datum
        ``msl`` or ``ellipsoid``.
    gauge
        ``world``: positions and headings are meaningful; ``plane``: only the shape is (no
        telemetry, no control): z = 0 is the plane, the first frame is above x = y = 0 and its image
        up is north.
    crs
        Projected coordinate system of maps and drawings, such as ``EPSG:32756``; None where the
        world is not georeferenced.
    undulation_m
        Height of mean sea level above the ellipsoid there, from the flight log; None where unknown.
    """

    origin: Geodetic | None
    height_datum: HeightDatum
    gauge: Literal["world", "plane"]
    crs: str | None = None
    undulation_m: float | None = None

    @property
    def ellipsoid_shift_m(self) -> float | None:
        """Difference from a height above the datum to one above the WGS 84 ellipsoid [m].

        None where it is unknown: sea level is up to a hundred metres off the ellipsoid.
        """
        return 0.0 if self.height_datum == "ellipsoid" else self.undulation_m


DEFAULT_AREA = "default"
"""Area of labels that name none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief(FrozenArrays):
    """Smooth departure of an area's ground from its plane: a sum of basis functions.

    Attributes
    ----------
    kind
        ``quadratic`` (three functions) or ``correlated`` (one for each knot): see
        geometry/ground/plane.py.
    sigma_m
        Prior of each function's coefficient, a height, about 0.
    scale_m
        Distance from the middle at which the squares are one; range of the correlation.
    knots_m
        (B, 2) east and north of the knots; for a quadratic surface, its middle alone.
    """

    kind: Literal["quadratic", "correlated"]
    sigma_m: float
    scale_m: float
    knots_m: Annotated[Floats, "b", 2]

    @property
    def size(self) -> int:
        """Number of functions."""
        return 3 if self.kind == "quadratic" else len(self.knots_m)


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Prior of the plane of one area: z = height + slopes . ((e, n) - pivot).

    Attributes
    ----------
    name
        Name of the area.
    height_m, height_sigma_m
        At the pivot.
    slope_sigma_rad
        Prior of each slope about level.
    roughness_sigma_m
        Each point's own departure from the plane; 0: none.
    relief
        Smooth departures from the plane; None: there are none.
    """

    name: str = DEFAULT_AREA
    height_m: float
    height_sigma_m: float
    slope_sigma_rad: float
    roughness_sigma_m: float
    relief: Relief | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey:
    """Observations of one adjustment.

    Attributes
    ----------
    frame_id
        (F,) names.
    time_s, time_sigma_s
        (F,) time of each photo, all by one clock [s], and its own standard deviation; NaN where
        unknown. Empty: unknown for all.
    seeds
        First poses and their marginal covariances, in the order of `frame_id`; None without
        telemetry.
    telemetry, track
        Their prior without the shared unknowns, and the flight to interpolate (or the photos' own
        poses); None without either. The prior's `frame_index` runs over 0..F-1.
    calibration
        Prior of the interior orientation.
    label, height_above_m
        (K,) names of the points, and stated heights above the ground of their area; 0: on it.
    height_sigma_m
        (K,) standard deviations of these heights; 0: exact. Empty: all are.
    is_free
        (K,) whether the height is an unknown without a prior. Empty: for none.
    identification_sigma_m
        (K,) standard deviation, east and north, between the picked point, the same in all photos,
        and the intended point (taped, controlled, measured); 0: they coincide. Empty: for all.
    pick_frame, pick_label, pixel_px, pick_sigma_px
        (P,), (P,), (P, 2), (P,): frame, label, position and sigma of each pick.
    target_pick
        (n,) picks made by the program, which found a target there.
    matches
        Chains of sightings: a pick and its matches in other photos. A chain's point is the ground
        below the picked pixel, which is not exactly the intended point.
    ties
        Sightings of tie points, which have no other observations.
    line_start, line_end, length_m, length_sigma_m
        (L,) labels of the ends of each known length, and the length.
    line_name
        (L,) name of each known length in the project; empty where they have no names.
    line_tape, line_along
        (L,) name of the tape of each known length, and measured quantity; empty: one tape (the tape
        without a name), and the straight 3-D distance, for all.
    tape_scale_sigma
        Prior of the scale of each tape (see estimation/survey/observations/lengths.py); 0: exact.
    own_scale_sigma
        Pairs of a tape's name and the prior of its scale, for tapes with another one.
    known
        Other known quantities of the points.
    control_label, control_world_m, control_sigma_m
        (C,), (C, 3), (C, 3): points with known coordinates.
    grounds
        (A,) priors of the planes, one for each area; at least one.
    area
        (K,) index of each label's area.
    candidate_poses
        Poses of frames that observations other than lengths and telemetry could determine: first
        values only.
    rolling
        Readout time and motion where rows are read one after the other with a noticeable effect,
        else None.
    gauge
        ``world``, or ``plane`` where position and heading are undetermined: then the first area's
        plane is z = 0.
    """

    frame_id: tuple[str, ...]
    time_s: Annotated[Floats, "f", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))
    time_sigma_s: Annotated[Floats, "f", NAN_IS_NONE] = field(default_factory=lambda: np.zeros(0))
    seeds: Poses | None
    telemetry: TelemetryPrior | None
    track: Flight | None
    calibration: Calibration
    label: Annotated[tuple[str, ...], "k"]
    height_above_m: Annotated[Floats, "k"]
    height_sigma_m: Annotated[Floats, "k"] = field(default_factory=lambda: np.zeros(0))
    is_free: Annotated[Bools, "k"] = field(default_factory=lambda: np.zeros(0, np.bool_))
    identification_sigma_m: Annotated[Floats, "k"] = field(default_factory=lambda: np.zeros(0))
    pick_frame: Annotated[Ints, "p"]
    pick_label: Annotated[Ints, "p"]
    pixel_px: Annotated[Floats, "p", 2]
    pick_sigma_px: Annotated[Floats, "p"]
    target_pick: Annotated[Ints, "n"] = field(default_factory=lambda: np.zeros(0, np.int64))
    matches: Sightings = NO_SIGHTINGS
    ties: Sightings = NO_SIGHTINGS
    line_start: Annotated[Ints, "l"]
    line_end: Annotated[Ints, "l"]
    length_m: Annotated[Floats, "l"]
    length_sigma_m: Annotated[Floats, "l"]
    line_name: tuple[str, ...] = ()
    line_tape: tuple[str, ...] = ()
    line_along: tuple[Along, ...] = ()
    tape_scale_sigma: float = 0.0
    own_scale_sigma: tuple[tuple[str, float], ...] = ()
    known: tuple[KnownThing, ...] = ()
    control_label: Annotated[Ints, "c"]
    control_world_m: Annotated[Floats, "c", 3]
    control_sigma_m: Annotated[Floats, "c", 3]
    grounds: tuple[Ground, ...]
    area: Annotated[Ints, "k"]
    candidate_poses: tuple[CandidatePoses, ...] = ()
    rolling: RollingShutter | None = None
    gauge: Literal["world", "plane"]

    def __post_init__(self) -> None:
        for name in ("height_sigma_m", "is_free", "identification_sigma_m"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.zeros(len(self.label)))
        for name in ("time_s", "time_sigma_s"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(len(self.frame_id), np.nan))
        freeze(self)
        for texts in (self.line_name, self.line_tape, self.line_along):
            if len(texts) not in (0, len(self.line_start)):
                raise ValueError(f"{len(texts)} names of {len(self.line_start)} known lengths")

    def scale_sigma_of(self, tape: str) -> float:
        """Return the prior sigma of the scale of one tape."""
        return dict(self.own_scale_sigma).get(tape, self.tape_scale_sigma)

    @cached_property
    def row_of_label(self) -> dict[str, int]:
        """Index of each label."""
        return {label: k for k, label in enumerate(self.label)}

    @property
    def pick_is_target(self) -> Bools:
        """(P,) mask of the picks of targets, made by the program."""
        found = np.zeros(len(self.pick_frame), dtype=np.bool_)
        found[self.target_pick] = True
        return found

    @cached_property
    def identified(self) -> Ints:
        """(Q,) labels picked by a person whose picked point may differ from the intended one."""
        by_hand = np.bincount(self.pick_label[~self.pick_is_target], minlength=len(self.label))
        return np.flatnonzero((by_hand > 0) & (self.identification_sigma_m > 0))

    @property
    def off_ground(self) -> Bools:
        """(K,) mask of points whose height is free, uncertain or other than 0."""
        stated = (self.height_above_m != 0.0) | (self.height_sigma_m > 0.0)
        return np.asarray(stated | self.is_free)

    @property
    def ground(self) -> Ground:
        """Plane of the first area; with a free gauge it is z = 0."""
        return self.grounds[0]


class Ends(NamedTuple):
    """Labels of the ends of a length, by index."""

    start: int
    end: int


@dataclass(frozen=True, kw_only=True)
class SurveyCorrection:
    """Changes of the user's input, by index into the given survey.

    Attributes
    ----------
    label_of_pick
        Pick to its correct label.
    without_picks
        Picks to remove.
    pixel_of_pick
        Pick to its correct column and row [px], for a photo that was mirrored or turned.
    enlarged
        Pick to the factor of its sigma, for a photo that was picked at another scale.
    length_m
        Known length to its correct value [m].
    ends
        Known length to its correct end labels.
    without_lines
        Known lengths to remove.
    level
        Known lengths that were taped horizontally.
    free
        Label to whether its height is an unknown (True) or it is on the ground (False).
    label_of_control
        Control point to its correct label.
    apart
        Picks that show their points elsewhere than the other picks do, as after a car was moved.
    """

    label_of_pick: Mapping[int, int] = field(default_factory=dict)
    without_picks: frozenset[int] = frozenset()
    pixel_of_pick: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    enlarged: Mapping[int, float] = field(default_factory=dict)
    length_m: Mapping[int, float] = field(default_factory=dict)
    ends: Mapping[int, Ends] = field(default_factory=dict)
    without_lines: frozenset[int] = frozenset()
    level: frozenset[int] = frozenset()
    free: Mapping[int, bool] = field(default_factory=dict)
    label_of_control: Mapping[int, int] = field(default_factory=dict)
    apart: frozenset[int] = frozenset()

    @property
    def picks(self) -> frozenset[int]:
        """Picks that it keeps but changes."""
        return frozenset(self.label_of_pick) | frozenset(self.pixel_of_pick) | self.apart

    @property
    def lines(self) -> frozenset[int]:
        """Known lengths that it keeps but changes."""
        return frozenset(self.length_m) | frozenset(self.ends) | self.level


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Possible cause of misfits in a survey.

    Attributes
    ----------
    message
        Finding and action, for people.
    mend
        Changes that correct it; None where only a person can.
    gain
        Decrease of the weighted sum of squares, plus that of observations left out for it.
    settles
        Names of lengths and frames whose misfit it explains.
    is_accounted
        Whether the results take it into account: the prior that it contradicts was given up.
    """

    message: Message
    mend: SurveyCorrection | None
    gain: float
    settles: frozenset[str] = frozenset()
    is_accounted: bool = False

"""Everything that enters the adjustment, by index instead of by name."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Literal, NamedTuple

import numpy as np

from uavgram.model.arrays import NAN_IS_NONE, Bools, Floats, FrozenArrays, Ints, freeze
from uavgram.model.camera.calibration import Calibration
from uavgram.model.camera.tags import Readout
from uavgram.model.flight.log import HeightDatum
from uavgram.model.flight.pose import CandidatePoses, Flight, Poses, TelemetryPrior
from uavgram.model.survey.known import KnownThing
from uavgram.model.survey.observations import Along
from uavgram.model.survey.ties import NO_SIGHTINGS, Sightings

LOGGED_RATE_RAD_S = 0.03
"""How well a log says how fast a camera turns, 1.7 degrees a second: attitudes good to 0.1 degree,
ten times a second, and a mount that shakes in between."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RollingShutter(FrozenArrays):
    """What an adjustment needs to find the readout time.

    Attributes
    ----------
    readout
        What is known of it beforehand.
    motion
        (F, 6) of each frame at its exposure: velocity [m/s], in the world or, where the survey's
        gauge is free, in camera axes; angular rate in camera axes [rad/s].
    rate_sigma_rad_s
        How well `motion` says how fast a camera turns.
    by_photos
        Whether no log says how the camera moved: `motion` is then the way from photo to photo, in
        the time between them or at a usual speed, and the unknown is a readout time at that speed.
    """

    readout: Readout
    motion: Annotated[Floats, "f", 6]
    rate_sigma_rad_s: float = LOGGED_RATE_RAD_S
    by_photos: bool = False

    @property
    def first_value(self) -> Floats:
        """(1,) the readout time beforehand [s]."""
        return np.array([self.readout.value_s])


class Geodetic(NamedTuple):
    """A place on the earth: WGS 84, and its height above the datum that is said beside it."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True, kw_only=True)
class World:
    """Origin of the local east-north-up world.

    Attributes
    ----------
    origin
        Its place; None where nothing ties the world to the earth.
    height_datum
        ``msl`` or ``ellipsoid``.
    gauge
        ``world``: positions and headings mean something; ``plane``: only shape does (no
        telemetry, no control): z = 0 is the plane, the first frame stands above x = y = 0 and its
        image up is north.
    crs
        Projected coordinate system of maps and drawings, such as ``EPSG:32756``; None where
        nothing ties the world to the earth.
    undulation_m
        How high mean sea level lies above the ellipsoid there, as the flight log says; None where
        nothing says it.
    """

    origin: Geodetic | None
    height_datum: HeightDatum
    gauge: Literal["world", "plane"]
    crs: str | None = None
    undulation_m: float | None = None

    @property
    def ellipsoid_shift_m(self) -> float | None:
        """What to add to a height above the datum to have it above the WGS 84 ellipsoid [m].

        None where nobody knows: sea level is up to a hundred metres off the ellipsoid.
        """
        return 0.0 if self.height_datum == "ellipsoid" else self.undulation_m


DEFAULT_AREA = "default"
"""Of labels that name no area."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relief(FrozenArrays):
    """How an area's ground departs from its plane, smoothly: a sum of functions of the place.

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
        (B, 2) east and north of the knots; of a quadratic surface, its middle alone.
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
    """The plane of one area beforehand: z = height + slopes . ((e, n) - pivot).

    Attributes
    ----------
    name
        Of the area.
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
    """The observations of one adjustment.

    Attributes
    ----------
    frame_id
        (F,) names.
    time_s, time_sigma_s
        (F,) when each photo was taken, all by one clock [s], and each one's own standard
        deviation; NaN where nobody says. Empty: of none.
    seeds
        First poses and their marginal covariances, in the order of `frame_id`; None without
        telemetry.
    telemetry, track
        Their prior without what is a shared unknown, and the flight to interpolate (or the photos'
        own poses); None without either. The prior's `frame_index` runs over 0..F-1.
    calibration
        Interior orientation beforehand.
    label, height_above_m
        (K,) names of the points, and stated heights above the ground of their area; 0: on it.
    height_sigma_m
        (K,) standard deviations of these heights; 0: exact. Empty: all are.
    is_free
        (K,) whether the height is an unknown of which nothing is known. Empty: of none.
    identification_sigma_m
        (K,) standard deviation, east and north, between the point that people picked, alike in all
        photos, and the point that was meant (taped, controlled, measured); 0: they are the same.
        Empty: of all.
    pick_frame, pick_label, pixel_px, pick_sigma_px
        (P,), (P,), (P, 2), (P,): frame, label, place and sigma of each pick.
    target_pick
        (n,) which picks the program made: it found a target there.
    matches
        Chains of sightings: a pick, and where the program found what it shows in other photos. A
        chain's point is what lies under the picked pixel, which is not quite what was meant.
    ties
        Sightings of tie points, of which nothing else is known.
    line_start, line_end, length_m, length_sigma_m
        (L,) labels of the ends of each known length, and the length.
    line_name
        (L,) what the project calls each known length; empty where they have no names.
    line_tape, line_along
        (L,) name of the tape of each known length, and what was measured; empty: one tape (as is
        the tape without a name), and the straight 3-D distance, for all.
    tape_scale_sigma
        Prior of the scale of each tape (see estimation/survey/observations/lengths.py); 0: exact.
    own_scale_sigma
        Pairs of a tape's name and the prior of its scale, of tapes with another one.
    known
        What else is known of the points.
    control_label, control_world_m, control_sigma_m
        (C,), (C, 3), (C, 3): points with known coordinates.
    grounds
        (A,) the planes beforehand, one for each area; at least one.
    area
        (K,) index of each label's area.
    candidate_poses
        Of frames that something else than lengths and telemetry could place: first values only.
    rolling
        Readout time and motion where rows are read one after the other and that is felt, else None.
    gauge
        ``world``, or ``plane`` where nothing fixes position and heading: then the first area's
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
        """Prior of the scale of one tape."""
        return dict(self.own_scale_sigma).get(tape, self.tape_scale_sigma)

    @cached_property
    def row_of_label(self) -> dict[str, int]:
        """Index of each label."""
        return {label: k for k, label in enumerate(self.label)}

    @property
    def pick_is_target(self) -> Bools:
        """(P,) whether the program made a pick: it found a target there."""
        found = np.zeros(len(self.pick_frame), dtype=np.bool_)
        found[self.target_pick] = True
        return found

    @cached_property
    def identified(self) -> Ints:
        """(Q,) labels of which people picked a point that may not be the one that was meant."""
        by_hand = np.bincount(self.pick_label[~self.pick_is_target], minlength=len(self.label))
        return np.flatnonzero((by_hand > 0) & (self.identification_sigma_m > 0))

    @property
    def off_ground(self) -> Bools:
        """(K,) whether a point is not simply where the ground is."""
        stated = (self.height_above_m != 0.0) | (self.height_sigma_m > 0.0)
        return np.asarray(stated | self.is_free)

    @property
    def ground(self) -> Ground:
        """The first area's plane: with a free gauge it is z = 0."""
        return self.grounds[0]

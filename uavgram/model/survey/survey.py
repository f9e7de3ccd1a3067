"""Everything that enters the adjustment, by index instead of by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats, Ints, freeze, freeze_as
from uavgram.model.camera.calibration import Calibration
from uavgram.model.flight.photo_poses import Flight
from uavgram.model.flight.pose import CandidatePoses, Poses, TelemetryPrior

DEFAULT_AREA = "default"
"""Of labels that name no area."""


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
    """

    name: str = DEFAULT_AREA
    height_m: float
    height_sigma_m: float
    slope_sigma_rad: float
    roughness_sigma_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Survey:
    """The observations of one adjustment.

    Attributes
    ----------
    frame_id
        (F,) names.
    seeds
        First poses and their marginal covariances, in the order of `frame_id`; None without
        telemetry.
    telemetry, track
        Their prior without what is a shared unknown, and the flight to interpolate (or the photos'
        own poses); None without either. The prior's `frame_index` runs over 0..F-1.
    calibration
        Interior orientation beforehand.
    label, height_above_m
        (K,) names of the points, and known heights above their area's plane.
    pick_frame, pick_label, pixel_px, pick_sigma_px
        (P,), (P,), (P, 2), (P,): frame, label, place and sigma of each pick.
    line_start, line_end, length_m, length_sigma_m
        (L,) labels of the ends of each known length, and the length.
    line_name
        (L,) what the project calls each known length; empty where they have no names.
    control_label, control_world_m, control_sigma_m
        (C,), (C, 3), (C, 3): points with known coordinates.
    ground, other_grounds
        The planes beforehand: of the first area, and of the others.
    label_area
        (K,) each label's area, 0 the first; None: all lie in the first.
    candidate_poses
        Of frames that something else than lengths and telemetry could place: first values only.
    gauge
        ``world``, or ``plane`` where nothing fixes position and heading: then the first area's
        plane is z = 0.
    """

    frame_id: tuple[str, ...]
    seeds: Poses | None
    telemetry: TelemetryPrior | None
    track: Flight | None
    calibration: Calibration
    label: tuple[str, ...]
    height_above_m: Floats
    pick_frame: Ints
    pick_label: Ints
    pixel_px: Floats
    pick_sigma_px: Floats
    line_start: Ints
    line_end: Ints
    length_m: Floats
    length_sigma_m: Floats
    line_name: tuple[str, ...] = ()
    control_label: Ints
    control_world_m: Floats
    control_sigma_m: Floats
    ground: Ground
    other_grounds: tuple[Ground, ...] = ()
    label_area: Ints | None = None
    candidate_poses: tuple[CandidatePoses, ...] = ()
    gauge: Literal["world", "plane"]

    def __post_init__(self) -> None:
        p, n, c = len(self.pick_frame), len(self.line_start), len(self.control_label)
        freeze_as(self, np.int64, pick_frame=(p,), pick_label=(p,), control_label=(c,))
        freeze_as(self, np.int64, line_start=(n,), line_end=(n,))
        if len(self.line_name) not in (0, n):
            raise ValueError(f"{len(self.line_name)} names of {n} known lengths")
        freeze(self, height_above_m=(len(self.label),), pixel_px=(p, 2), pick_sigma_px=(p,))
        freeze(self, length_m=(n,), length_sigma_m=(n,))
        freeze(self, control_world_m=(c, 3), control_sigma_m=(c, 3))
        if self.label_area is not None:
            freeze_as(self, np.int64, label_area=(len(self.label),))

    @property
    def grounds(self) -> tuple[Ground, ...]:
        """(A,) planes beforehand, one for each area."""
        return (self.ground, *self.other_grounds)

    @property
    def area(self) -> Ints:
        """(K,) each label's area."""
        if self.label_area is None:
            return np.zeros(len(self.label), dtype=np.int64)
        return self.label_area

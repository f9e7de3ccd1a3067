"""The tables of a result: a row for each frame, point, line, pick, measurement and check.

NaN stands for "there is none" (null in the file).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Bools, Floats, freeze

FrameStatus = Literal["refined", "seeded", "unmatched", "rejected"]
LineStatus = Literal["used", "suspect", "removed", "checked", "unseen"]
PickStatus = Literal["used", "suspect", "removed", "unused"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseTable:
    """F poses, NaN in all of a row where a frame has none; conventions as in `Poses`."""

    center_world_m: Floats
    world_from_camera: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        n = len(self.center_world_m)
        names = ("center_world_m", "world_from_camera", "covariance")
        freeze(
            self,
            may_be_nan=names,
            center_world_m=(n, 3),
            world_from_camera=(n, 3, 3),
            covariance=(n, 6, 6),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameResults:
    """F frames, as many as there are photos.

    Attributes
    ----------
    frame_id, path
        (F,) file name; where the photo is.
    time_utc_s
        (F,) of the exposure, after the adjustment; NaN where unknown.
    status, reason
        (F,) ``refined`` (in the adjustment, with at least one pick), ``seeded``, ``unmatched``,
        ``rejected``; and why.
    seed, refined
        Poses from the telemetry, and after the adjustment.
    """

    frame_id: tuple[str, ...]
    path: tuple[str, ...]
    time_utc_s: Floats
    status: tuple[FrameStatus, ...]
    reason: tuple[str, ...]
    seed: PoseTable
    refined: PoseTable

    def __post_init__(self) -> None:
        freeze(self, may_be_nan=("time_utc_s",), time_utc_s=(len(self.frame_id),))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanarUncertainty:
    """Uncertainty of K points in the plane.

    Attributes
    ----------
    covariance_m2
        (K, 2, 2) of east and north.
    ellipse_95_m
        (K, 2) semi-major and semi-minor axis of the 95 % ellipse (2.4477 sigma).
    ellipse_azimuth_rad
        (K,) of the major axis, clockwise from north, in [0, pi).
    """

    covariance_m2: Floats
    ellipse_95_m: Floats
    ellipse_azimuth_rad: Floats

    def __post_init__(self) -> None:
        n = len(self.covariance_m2)
        freeze(self, covariance_m2=(n, 2, 2), ellipse_95_m=(n, 2), ellipse_azimuth_rad=(n,))


@dataclass(frozen=True, kw_only=True, eq=False)
class PointResults:
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
        The same within the survey: what all points have in common, a shift and a turn, is taken
        out. It tells how well the scene's shape is known, whatever the receiver's bias.
    latitude_deg, longitude_deg
        (K,) NaN with gauge ``plane``.
    frames
        (K,) the names of the frames in which it was picked and used.
    """

    label: tuple[str, ...]
    position_world_m: Floats
    covariance_m2: Floats
    ellipse_95_m: Floats
    ellipse_azimuth_rad: Floats
    relative: PlanarUncertainty
    latitude_deg: Floats
    longitude_deg: Floats
    frames: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        n = len(self.label)
        freeze(
            self,
            may_be_nan=("latitude_deg", "longitude_deg"),
            position_world_m=(n, 3),
            covariance_m2=(n, 2, 2),
            ellipse_95_m=(n, 2),
            ellipse_azimuth_rad=(n,),
            latitude_deg=(n,),
            longitude_deg=(n,),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LineResults:
    """L known lengths, as given and as adjusted.

    Attributes
    ----------
    length_m, sigma_m
        (L,) as given.
    adjusted_m, adjusted_sigma_m
        (L,) from the adjusted points; NaN where an end was never picked.
    residual_m
        (L,) adjusted minus given.
    w, redundancy, mdb_m
        (L,) Baarda's standardised residual, redundancy number in [0, 1] and minimal detectable
        bias; for a withheld line w is its error over the joint sigma, the others NaN.
    status
        (L,) ``used``, ``suspect``, ``removed``, ``checked`` (withheld), ``unseen``.
    """

    name: tuple[str, ...]
    start: tuple[str, ...]
    end: tuple[str, ...]
    length_m: Floats
    sigma_m: Floats
    adjusted_m: Floats
    adjusted_sigma_m: Floats
    residual_m: Floats
    w: Floats
    redundancy: Floats
    mdb_m: Floats
    status: tuple[LineStatus, ...]

    def __post_init__(self) -> None:
        n = len(self.name)
        computed = ("adjusted_m", "adjusted_sigma_m", "residual_m", "w", "redundancy", "mdb_m")
        freeze(self, length_m=(n,), sigma_m=(n,))
        freeze(self, may_be_nan=computed, **dict.fromkeys(computed, (n,)))


@dataclass(frozen=True, kw_only=True, eq=False)
class PickResults:
    """P picks, as given and how well they fit.

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
        (P,) ``used``, ``suspect``, ``removed``, ``unused`` (its frame is not in the adjustment).
    """

    image: tuple[str, ...]
    label: tuple[str, ...]
    pixel_px: Floats
    sigma_px: Floats
    residual_px: Floats
    w: Floats
    redundancy: Floats
    status: tuple[PickStatus, ...]

    def __post_init__(self) -> None:
        n = len(self.image)
        freeze(self, pixel_px=(n, 2), sigma_px=(n,))
        freeze(
            self,
            may_be_nan=("residual_px", "w", "redundancy"),
            residual_px=(n, 2),
            w=(n,),
            redundancy=(n,),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasurementResults:
    """M measured values with their joint covariance.

    Attributes
    ----------
    name, kind, points
        (M,) what was asked for. A ``coordinate`` gives two rows, named ``NAME east`` and
        ``NAME north``.
    value, sigma
        (M,) in `unit`; NaN where it cannot be computed.
    unit
        (M,) m, m2, deg or m/s.
    interval_95
        (M, 2) lower and upper bound.
    correlation
        (M, M), same order; NaN in rows that cannot be computed.
    alternative_values
        (M,) what other solutions that explain the observations as well would give, where that lies
        outside `interval_95`: empty where they all agree. Left out, there are none.
    """

    name: tuple[str, ...]
    kind: tuple[str, ...]
    points: tuple[tuple[str, ...], ...]
    value: Floats
    sigma: Floats
    unit: tuple[str, ...]
    interval_95: Floats
    correlation: Floats
    alternative_values: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        n = len(self.name)
        if not self.alternative_values:
            object.__setattr__(self, "alternative_values", ((),) * n)
        if len(self.alternative_values) != n:
            raise ValueError(f"{len(self.alternative_values)} alternative_values for {n} values")
        names = ("value", "sigma", "interval_95", "correlation")
        freeze(
            self,
            may_be_nan=names,
            value=(n,),
            sigma=(n,),
            interval_95=(n, 2),
            correlation=(n, n),
        )

    @property
    def is_ambiguous(self) -> Bools:
        """(M,) whether another solution puts the value outside its interval."""
        return np.array([len(values) > 0 for values in self.alternative_values], dtype=bool)


@dataclass(frozen=True, kw_only=True, eq=False)
class MonteCarloResults:
    """Sampled distribution of the M measured values, beside their first-order sigmas.

    Attributes
    ----------
    mean, sigma
        (M,) in the measurement's unit; NaN where a value cannot be computed.
    interval_95
        (M, 2) probabilistically symmetric: the 2.5 % and 97.5 % quantiles.
    samples, failed
        Number of repetitions that came to rest, and of those that did not and were left out.
    seed
        Of the draws.
    """

    mean: Floats
    sigma: Floats
    interval_95: Floats
    samples: int
    failed: int
    seed: int

    def __post_init__(self) -> None:
        n = len(self.mean)
        names = ("mean", "sigma", "interval_95")
        freeze(self, may_be_nan=names, mean=(n,), sigma=(n,), interval_95=(n, 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class PointChecks:
    """C check points: result minus known coordinates.

    Attributes
    ----------
    error_m, sigma_m
        (C, 3) east, north, up; sigma joint of result and known coordinates.
    mahalanobis
        (C,) square root of the error's squared Mahalanobis distance.
    """

    label: tuple[str, ...]
    error_m: Floats
    sigma_m: Floats
    mahalanobis: Floats

    def __post_init__(self) -> None:
        n = len(self.label)
        freeze(self, error_m=(n, 3), sigma_m=(n, 3), mahalanobis=(n,))


@dataclass(frozen=True, kw_only=True, eq=False)
class LineChecks:
    """C withheld lengths: adjusted minus taped, its sigma, and their ratio."""

    name: tuple[str, ...]
    error_m: Floats
    sigma_m: Floats
    z: Floats

    def __post_init__(self) -> None:
        n = len(self.name)
        freeze(self, error_m=(n,), sigma_m=(n,), z=(n,))

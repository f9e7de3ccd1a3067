"""Reconstruct ground points with their covariances, ellipses and geographic coordinates."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from uavgram.estimation.survey.adjustment import Adjustment, compute_departures, compute_heights
from uavgram.estimation.survey.neighbours import find_neighbours
from uavgram.geometry.geodesy import geodetic_from_enu
from uavgram.geometry.ground.figures import ELLIPSE_95, error_ellipse
from uavgram.model.arrays import Floats
from uavgram.model.result.tables import HeightSource, PlanarUncertainty, PointResults
from uavgram.model.survey import Survey, World


def reconstruct(adjustment: Adjustment, world: World, found: Collection[str] = ()) -> PointResults:
    """Reconstruct the ground points of an adjusted survey, in the order of their labels.

    Parameters
    ----------
    adjustment
        The adjusted survey.
    world
        Location of the local world; points get latitude and longitude where it is tied to the
        earth.
    found
        Names of labels whose heights are unknowns without a statement.
    """
    survey = adjustment.survey
    position, covariance = adjustment.points()
    absolute = _in_plane(covariance[:, :2, :2])
    latitude, longitude = _geographic(position, world)
    departure, departure_sigma = compute_departures(adjustment)
    height, height_sigma = compute_heights(adjustment)
    around = find_neighbours(adjustment)
    return PointResults(
        label=survey.label,
        position_world_m=position,
        covariance_m2=absolute.covariance_m2,
        ellipse_95_m=absolute.ellipse_95_m,
        ellipse_azimuth_rad=absolute.ellipse_azimuth_rad,
        relative=_within_survey(adjustment),
        departure_m=departure,
        departure_sigma_m=departure_sigma,
        height_above_ground_m=height,
        height_sigma_m=height_sigma,
        covariance_m3=covariance,
        latitude_deg=latitude,
        longitude_deg=longitude,
        frames=_frames_of_points(survey),
        height_source=_height_sources(survey, found),
        neighbour_sigma_m=around.sigma_m,
        neighbours=tuple(tuple(survey.label[k] for k in row) for row in around.row.tolist()),
    )


def _frames_of_points(survey: Survey) -> tuple[tuple[str, ...], ...]:
    """Return the frames (K,) in which each point was picked, then those in which it was matched."""
    matches = survey.matches
    matched = survey.pick_label[matches.pick][matches.point]
    frames: tuple[dict[int, None], ...] = tuple({} for _ in survey.label)
    for label, frame in (
        *zip(survey.pick_label.tolist(), survey.pick_frame.tolist(), strict=True),
        *zip(matched.tolist(), matches.frame.tolist(), strict=True),
    ):
        frames[label][frame] = None
    return tuple(tuple(survey.frame_id[f] for f in seen) for seen in frames)


def _height_sources(survey: Survey, found: Collection[str]) -> tuple[HeightSource, ...]:
    """Return the source (K,) of the height of each point."""
    named = np.isin(survey.label, list(found))
    sources: list[HeightSource] = ["ground", "stated", "free", "found"]
    cases = np.select([named, survey.is_free, survey.off_ground], [3, 2, 1])
    return tuple(sources[k] for k in cases.tolist())


def _in_plane(covariance_m2: Floats) -> PlanarUncertainty:
    major, minor, azimuth = error_ellipse(covariance_m2)
    return PlanarUncertainty(
        covariance_m2=covariance_m2,
        ellipse_95_m=ELLIPSE_95 * np.column_stack([major, minor]),
        ellipse_azimuth_rad=azimuth,
    )


def _within_survey(adjustment: Adjustment) -> PlanarUncertainty:
    planar = _in_plane(adjustment.relative_points())
    off_ground = np.flatnonzero(adjustment.survey.off_ground)
    if not len(off_ground):
        return planar
    in_space = np.full((len(planar.covariance_m2), 3, 3), np.nan)
    in_space[off_ground] = adjustment.relative_points_in_space(off_ground)
    return PlanarUncertainty(
        covariance_m2=planar.covariance_m2,
        ellipse_95_m=planar.ellipse_95_m,
        ellipse_azimuth_rad=planar.ellipse_azimuth_rad,
        covariance_m3=in_space,
    )


def _geographic(position: Floats, world: World) -> tuple[Floats, Floats]:
    if world.origin is None:
        nowhere = np.full(len(position), np.nan)
        return nowhere, nowhere
    latitude, longitude, _ = geodetic_from_enu(position, world.origin)
    return latitude, longitude

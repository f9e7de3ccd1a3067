"""Poses of the photos before any adjustment: by the log, by the photos, or unknown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from uavgram.config.project import make_key_error
from uavgram.config.project_text import AssumedOrigin
from uavgram.errors import GeometryError, InputError, UavgramError
from uavgram.estimation.survey.observed import NO_CONTROL
from uavgram.geometry.geodesy import (
    SAME_SITE_M,
    are_axes_exchanged,
    curvature_drop,
    enu_from_geodetic,
    exchange_axes,
    explain_unsuitable_crs,
    utm_crs,
)
from uavgram.io.photos.metadata import read_exif_place
from uavgram.io.photos.pose_sources import read_photo_poses
from uavgram.model.arrays import Floats, rows_of
from uavgram.model.flight_log import FlightLog, HeightDatum, LogFault
from uavgram.model.frames import (
    Flight,
    Frames,
    Pairing,
    PhotoExposures,
    PhotoPoses,
    Photos,
    Telemetry,
)
from uavgram.model.message import Message
from uavgram.model.naming import join_names
from uavgram.model.observations import KnownPoints, KnownWorldPoints
from uavgram.model.options import GeodeticOrigin, MountOptions
from uavgram.model.survey import Geodetic, World
from uavgram.pipeline.measure.inputs import Inputs, find_project_duplicates
from uavgram.stages.seed import seed
from uavgram.stages.seed.log_faults import find_faults, report_faults
from uavgram.stages.seed.photo_exposures import (
    DEFAULT_HEIGHT_M,
    compute_positions,
    find_photo_home,
    place_photos,
    refer_heights_to_control,
)
from uavgram.stages.seed.track import build_track, find_home, gather_evidence
from uavgram.stages.synchronise import Synchronised, synchronise
from uavgram.stages.synchronise.photo_times import poses_of

ABOVE_GROUND_SIGMA_M = 40.0
"""Sigma of `ABOVE_GROUND_M`."""


def assume_ground_below(source: str, photos: Photos) -> AssumedOrigin | None:
    """Assume the ground at a usual distance below the photos; None where no pose can be read.

    Parameters
    ----------
    source
        As `poses` in a project.
    photos
        The project's photos.
    """
    heights: HeightDatum = "msl"
    try:
        poses, _ = read_photo_poses(source, photos, heights)
    except InputError:
        return None
    stated = poses.height_m[np.isfinite(poses.height_m)]
    return AssumedOrigin(
        latitude_deg=float(poses.latitude_deg[0]),
        longitude_deg=float(poses.longitude_deg[0]),
        height_m=float(np.median(stated)) - DEFAULT_HEIGHT_M if stated.size else 0.0,
        height_sigma_m=ABOVE_GROUND_SIGMA_M,
        datum=poses.datum,
    )


def has_place(photos: Photos) -> bool:
    """Return whether any of the photos states a place in EXIF, even without a height."""
    try:
        places = [read_exif_place(path) for path in photos.path]
    except InputError:
        return False
    return any(math.isfinite(place.latitude_deg) for place in places)


Place = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class PosedFrames:
    """Frames on the log's clock, with seed poses in the local world.

    Without a log or photo poses `telemetry` is None; `pairing` assigns photos to camera events of
    the log, where events were used.
    """

    world: World
    frames: Frames
    telemetry: Telemetry | None
    messages: tuple[Message, ...]
    pairing: Pairing | None = None


def pose_frames(inputs: Inputs) -> PosedFrames:
    """Seed the poses from the log or from the photos; without either, only name the world.

    If several photos show one exposure, only one is matched and placed; the others get its time.

    Raises
    ------
    InputError
        The project's coordinate system does not fit that world.
    """
    names, duplicates = inputs.photos.frame_id, find_project_duplicates(inputs)
    if not duplicates.photos:
        return _pose(inputs)
    copies = duplicates.photos
    posed = _pose(_select_photos(inputs, [k for k, name in enumerate(names) if name not in copies]))
    at = {name: k for k, name in enumerate(posed.frames.frame_id)}
    rows = np.array([at[copies.get(name, name)] for name in names])
    frames = replace(posed.frames, **rows_of(posed.frames, rows) | {"frame_id": names})
    whys = zip(map(duplicates.reason, names), frames.reason, strict=True)
    is_copy = np.isin(names, list(copies))
    pairing = posed.pairing
    if pairing is not None:
        pairing = replace(pairing, **rows_of(pairing, rows) | {"frame_id": names})
    return replace(
        posed,
        frames=replace(
            frames, matched=frames.matched & ~is_copy, reason=tuple(a or b for a, b in whys)
        ),
        pairing=pairing,
    )


def _select_photos(inputs: Inputs, rows: Sequence[int]) -> Inputs:
    """Return the project with some of its photos only."""
    photos = replace(inputs.photos, **rows_of(inputs.photos, np.array(rows)))
    poses = inputs.poses
    placed = poses and poses.rows(np.flatnonzero(np.isin(poses.frame_id, photos.frame_id)))
    return replace(inputs, photos=photos, poses=placed)


def _pose(inputs: Inputs) -> PosedFrames:
    if inputs.log is not None:
        posed = _seed_from_log(inputs, inputs.log)
    elif inputs.poses is not None:
        posed = _seed_from_photos(inputs, inputs.poses)
    else:
        posed = list_unposed(inputs)
    place, crs = posed.world.origin, inputs.project.crs
    if place is not None and crs != "auto" and (why := explain_unsuitable_crs(crs, *place[:2])):
        raise make_key_error(inputs.project_path, ("crs",), why)
    return posed


def _seed_from_log(inputs: Inputs, log: FlightLog) -> PosedFrames:
    """Match the photos to the log and interpolate it."""
    project = inputs.project
    matched = _synchronise(inputs, log)
    frames = matched.frames
    _require_matched(frames, log.path)
    first = float(np.nanmin(np.where(frames.matched, frames.time_utc_s, np.nan)))
    home, datum, home_messages = find_home(matched.boot, matched.clock, first)
    place = _find_stated_origin(inputs, datum) or home
    if matched.boot.attitudes is None:
        exposures, more = place_photos(
            compute_positions(frames, matched.boot, matched.clock),
            place,
            project.mount,
            project.telemetry,
        )
        messages = (*matched.messages, *home_messages, *more)
        posed = _seed(inputs, frames, exposures, (place, datum), messages)
        return replace(posed, pairing=matched.pairing)
    track, track_messages = build_track(
        matched.boot, matched.clock, place, project.mount, project.telemetry
    )
    evidence = gather_evidence(matched.boot, matched.clock, place)
    faults = find_faults(track, evidence, frames.time_utc_s[frames.matched])
    log_messages = report_faults(faults, evidence, frames)
    messages = (*log_messages, *matched.messages, *home_messages, *track_messages)
    posed = _seed(inputs, frames, track, (place, datum), messages, faults)
    return replace(posed, pairing=matched.pairing)


def _seed_from_photos(inputs: Inputs, poses: PhotoPoses) -> PosedFrames:
    """Use the photos' own poses."""
    project = inputs.project
    stated = _find_stated_origin(inputs, poses.datum)
    source = ", ".join(project.pose_sources)
    messages: tuple[Message, ...] = ()
    try:
        if stated is None:
            height_m = _list_control_heights(inputs, poses.datum)
            poses, shifted = refer_heights_to_control(poses, height_m, project.ground.height_m)
            place, messages = find_photo_home(poses)
            messages = (*messages, *shifted)
        else:
            place = stated
        exposures, more = place_photos(poses, place, project.mount, project.telemetry)
    except UavgramError as fault:  # add the name of the file, and the altitudes that are missing
        unused = (one.text for one in inputs.messages if one.code == "odd-altitude")
        raise InputError(source, " ".join((*unused, f"{fault}"))) from fault
    frames = _photo_frames(inputs, poses, exposures.frame_id)
    _require_matched(frames, source)
    return _seed(inputs, frames, exposures, (place, poses.datum), (*messages, *more))


def _list_control_heights(inputs: Inputs, datum: HeightDatum) -> Floats:
    """Return the heights (n,) of picked geodetic control points, in the poses' datum [m]."""
    control, picked = inputs.control, np.isin(inputs.control.label, inputs.picks.label)
    if control.kind != "geodetic" or not picked.any():
        return np.zeros(0)
    return np.asarray(control.coordinates[picked, 2] + height_shift(inputs, datum))


def _remove_lever_arm(mount: MountOptions) -> tuple[MountOptions, tuple[Message, ...]]:
    """Remove the lever arm of the mount, as photos state the position of the camera itself."""
    if not any(mount.lever_arm_m):
        return mount, ()
    text = (
        "mount.lever_arm_m was not applied: the places that `poses` gives are those of the camera."
    )
    message = Message("info", "lever-arm-unused", text)
    return replace(mount, lever_arm_m=(0.0, 0.0, 0.0)), (message,)


def _seed(
    inputs: Inputs,
    frames: Frames,
    flight: Flight,
    origin: tuple[Place, HeightDatum],
    messages: tuple[Message, ...],
    faults: Sequence[LogFault] = (),
) -> PosedFrames:
    mount = inputs.project.mount
    more: tuple[Message, ...] = ()
    if isinstance(flight, PhotoExposures) and inputs.log is None:
        mount, more = _remove_lever_arm(mount)
    telemetry = seed(frames, flight, mount, inputs.project.telemetry, faults)
    far = _check_origin(inputs, telemetry.poses.center_world_m)
    place, datum = origin
    undulation = np.nan if inputs.log is None else inputs.log.undulation_m
    world = World(
        origin=Geodetic(*place),
        height_datum=datum,
        gauge="world",
        undulation_m=float(undulation) if np.isfinite(undulation) else None,
    )
    return PosedFrames(
        world=world, frames=frames, telemetry=telemetry, messages=(*messages, *more, *far)
    )


def _check_origin(inputs: Inputs, center_world_m: Floats) -> tuple[Message, ...]:
    """Refuse an origin far from this flight; report the effect of the earth's curvature."""
    if not isinstance(inputs.project.world.origin, GeodeticOrigin):
        return ()
    apart_m = float(np.linalg.norm(np.median(center_world_m, axis=0)[:2]))
    below_m = curvature_drop(apart_m)
    if apart_m > SAME_SITE_M:
        raise make_key_error(
            inputs.project_path,
            ("world", "origin"),
            f"is {apart_m / 1000:.0f} km from the flight: give a place near it "
            "(are latitude and longitude exchanged?), or leave it out",
        )
    if below_m < 0.5 * inputs.project.ground.height_sigma_m:
        return ()
    text = (
        f"world.origin is {apart_m / 1000:.1f} km from the flight, where the ground is "
        f"{below_m:.2f} m below the origin's horizontal plane by the earth's curvature alone: "
        "choose a nearer one, or take that off ground.height_m."
    )
    return (Message("warning", "origin-far", text),)


def _find_stated_origin(inputs: Inputs, datum: HeightDatum) -> Place | None:
    """Return the project's own origin, its height in the poses' datum; None: home."""
    origin = inputs.project.world.origin
    if not isinstance(origin, GeodeticOrigin):
        return None
    height = origin.height_m + height_shift(inputs, datum)
    return origin.latitude_deg, origin.longitude_deg, height


def _require_matched(frames: Frames, source: str) -> None:
    if frames.matched.any():
        return
    reasons = "; ".join(
        f"{name}: {why}" for name, why in zip(frames.frame_id, frames.reason, strict=True)
    )
    raise GeometryError(f"no usable frame remains, {source} covers no photo: {reasons}")


def _synchronise(inputs: Inputs, log: FlightLog) -> Synchronised:
    known = partial(poses_of, inputs.ties, inputs.photos.frame_id, inputs.calibration)
    ties = known if inputs.ties.image else None
    try:
        return synchronise(inputs.photos, log, inputs.project.time, ties)
    except UavgramError as fault:  # add the name of the file
        raise InputError(log.path, str(fault)) from fault


def _file_time_frames(inputs: Inputs, reason: str) -> Frames:
    """Return frames at the times of their files, none of them matched."""
    photos, options = inputs.photos, inputs.project.time
    known = 0.0 if options.offset_s == "auto" else options.offset_s
    resolution = np.nan_to_num(photos.file_time_resolution_s, nan=0.0)
    return Frames(
        frame_id=photos.frame_id,
        time_utc_s=photos.file_time_s - known,
        sigma_time_s=np.where(np.isfinite(photos.file_time_s), resolution / np.sqrt(12), np.nan),
        matched=np.zeros(len(photos.frame_id), dtype=np.bool_),
        reason=(reason,) * len(photos.frame_id),
        clock_offset_s=known,
        clock_offset_sigma_s=options.offset_sigma_s,
    )


def _photo_frames(inputs: Inputs, poses: PhotoPoses, placed: tuple[str, ...]) -> Frames:
    """Return frames with a pose; their times are the source's own, or else those of the files."""
    base = _file_time_frames(inputs, "")
    stated = dict(zip(poses.frame_id, poses.time_utc_s, strict=True))
    own = np.array([stated.get(name, np.nan) for name in base.frame_id])
    matched = np.isin(base.frame_id, placed)
    return replace(
        base,
        time_utc_s=np.where(np.isfinite(own), own, base.time_utc_s),
        sigma_time_s=np.where(np.isfinite(own), 0.0, base.sigma_time_s),
        matched=matched,
        reason=tuple("" if good else f"no pose in {poses.source}" for good in matched),
    )


def list_unposed(inputs: Inputs) -> PosedFrames:
    """Return names and file times of the frames, and a world that only control points can place."""
    project = inputs.project
    frames = _file_time_frames(inputs, "no flight log")
    place: Geodetic | None = None
    messages: tuple[Message, ...] = ()
    origin = project.world.origin
    if isinstance(origin, GeodeticOrigin):
        place = Geodetic(origin.latitude_deg, origin.longitude_deg, origin.height_m)
    elif inputs.control.kind == "geodetic" and len(inputs.control.label):
        place = Geodetic(*inputs.control.coordinates[0].tolist())
        text = (
            f"Without a log there is no home: the world's origin is the control point "
            f"{inputs.control.label[0]!r}."
        )
        messages = (Message("info", "origin-control", text),)
    elif inputs.control_lines.kind == "geodetic" and len(inputs.control_lines.name):
        start = inputs.control_lines.coordinates[0, 0]
        place = Geodetic(float(start[0]), float(start[1]), float(np.nan_to_num(start[2])))
        text = (
            "Without a log there is no home: the world's origin is the start of the line "
            f"{inputs.control_lines.name[0]!r}."
        )
        messages = (Message("info", "origin-control", text),)
    world = World(origin=place, height_datum=project.world.heights, gauge="world")
    return PosedFrames(world=world, frames=frames, telemetry=None, messages=messages)


def height_shift(inputs: Inputs, datum: HeightDatum) -> float:
    """Return the difference from heights in the input files to the poses' datum [m].

    Raises
    ------
    UavgramError
        The datums differ, and the log does not state the difference.
    """
    heights = inputs.project.world.heights
    if heights == datum:
        return 0.0
    if inputs.log is not None:
        source, undulation = inputs.log.path, inputs.log.undulation_m
    elif inputs.poses is not None:
        source, undulation = inputs.poses.source, float("nan")
    else:
        return 0.0
    if not np.isfinite(undulation):
        raise UavgramError(
            f"heights in the input files are {heights}, those of {source} are {datum}, and it "
            f"does not state the difference: give all heights as {datum} and set "
            f"world.heights: {datum}"
        )
    return undulation if datum == "ellipsoid" else -undulation


def transform_known(
    inputs: Inputs, points: KnownPoints, world: World
) -> tuple[KnownWorldPoints, tuple[Message, ...]]:
    """Transform known points to the local world; none, with a message, without a tie to the earth.

    Parameters
    ----------
    inputs
        The project, which states the datum of its heights.
    points
        With local or geodetic coordinates.
    world
        Location of the local world.

    Raises
    ------
    InputError
        A point is far from the world's origin, and near it with latitude and longitude, or easting
        and northing, exchanged; or all of them are far from it.
    """
    coordinates: Floats = points.coordinates
    if points.kind == "geodetic" and len(points.label):
        if world.origin is None:
            text = (
                "Points with latitude and longitude cannot be used: nothing ties this world to "
                "the earth. Give the log, world.origin, or geodetic control points."
            )
            return NO_CONTROL, (Message("warning", "points-unplaced", text, labels=points.label),)
        shift = height_shift(inputs, world.height_datum)
        latitude, longitude, height = points.coordinates.T
        _check_places(inputs, points, world.origin)
        coordinates = enu_from_geodetic(latitude, longitude, height + shift, world.origin)
    return KnownWorldPoints(label=points.label, world_m=coordinates, sigma_m=points.sigma_m), ()


def _check_places(inputs: Inputs, points: KnownPoints, origin: Geodetic) -> None:
    """Refuse exchanged coordinates, or those of another place, as in `transform_known`."""
    latitude, longitude, _ = points.coordinates.T
    place, crs = origin[:2], inputs.project.crs
    turned = {
        "latitude and longitude": (longitude, latitude),
        "easting and northing": exchange_axes(
            latitude, longitude, utm_crs(*place) if crs == "auto" else crs
        ),
    }
    for what, places in turned.items():
        exchanged = are_axes_exchanged((latitude, longitude), places, origin)
        if exchanged.any():
            labels = [repr(points.label[k]) for k in np.flatnonzero(exchanged)]
            one = len(labels) == 1
            raise InputError(
                inputs.project_path,
                f"the known point{'' if one else 's'} {join_names(labels)} "
                f"{'is' if one else 'are'} far from where the survey is, and near it with {what} "
                f"exchanged: correct {'its row' if one else 'their rows'}",
            )
    away_m = np.linalg.norm(enu_from_geodetic(latitude, longitude, 0.0, (*place, 0.0)), axis=-1)
    if not (away_m < SAME_SITE_M).any():
        raise InputError(
            inputs.project_path,
            f"all known points are far from where the survey is, {points.label[0]!r} by "
            f"{away_m[0] / 1000:.0f} km: they are of another place, or their coordinate system is "
            "another one",
        )

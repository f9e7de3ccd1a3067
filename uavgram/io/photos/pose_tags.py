"""Poses from the photos themselves: EXIF GPS, and drone makers' tags in XMP.

`MAKERS` is the table of tag readers: a new maker is one more function in it. They are tried in
order; the first that finds its tags is used, and plain EXIF comes last.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uavgram.errors import InputError
from uavgram.geometry.geodesy import enu_from_geodetic
from uavgram.geometry.motion.camera_motion import gimbal_from_nadir
from uavgram.io.photos import metadata
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import HeightDatum
from uavgram.model.frames import PhotoPoses, Photos
from uavgram.model.message import Message
from uavgram.model.naming import format_photo_count, join_photo_names

Angles = tuple[float, float, float]
NONE: Angles = (math.nan, math.nan, math.nan)

# An RTK receiver states its own noise only, without the errors of the base, the antenna's phase
# centre and the lever arm to the camera.
RTK_FLOOR_HORIZONTAL_M, RTK_FLOOR_VERTICAL_M = 0.05, 0.10
# Programs that rotate photos on a click, and leave the pose tags unchanged.
_EDITORS = re.compile(r"windows|viewer|picasa|photoshop|lightroom|gimp|irfan|photos", re.IGNORECASE)
_UPSIDE_DOWN_DEG = 90.0
_LEVEL_DEG = 3.0  # a gimbal's own accuracy
_MOVED_M = 3.0  # a receiver's: photos farther apart were not taken from one place
_NEAR_NADIR_DEG = 30.0
# A barometric altitude may be some tens of metres off, and below the sea by as much.
_LEAST_DEPTH_M = 30.0
_MIRRORED_SHARE = (
    0.15  # share of the difference to the others that remains after a change of the sign
)

DJI_GUESS = (
    "DJI writes no datum; without RTK its AbsoluteAltitude is roughly above sea level (barometer "
    "and GPS), and may be tens of metres off"
)
RTK_GUESS = "DJI writes ellipsoidal heights where RTK is in use"
EXIF_GUESS = "EXIF altitude references 0 and 1 name no datum; sea level was assumed"

_HEIGHTS = {"height_m": "altitude", "height_home_m": "height above take-off"}
"""Heights in the tags, and their names in messages."""

_COLUMNS = (
    *("latitude_deg", "longitude_deg", "height_m", "height_home_m"),
    *("sigma_horizontal_m", "sigma_vertical_m"),
)


@dataclass(frozen=True, kw_only=True)
class TagPose:
    """Pose in the tags of one photo, in degrees and metres; NaN where missing."""

    latitude_deg: float
    longitude_deg: float
    height_m: float
    height_home_m: float = math.nan
    exif_height_m: float = math.nan  # where the maker's own tags have a height
    datum: HeightDatum = "msl"
    datum_guess: str = ""
    ypr_deg: Angles = NONE
    vehicle_ypr_deg: Angles = NONE
    sigma_horizontal_m: float = math.nan
    sigma_vertical_m: float = math.nan
    source: str = ""
    editor: str = ""


def dji_pose(xmp: metadata.XmpTags, exif: metadata.ExifPlace) -> TagPose | None:
    """Read DJI's tags: attitude of the gimbal (NED, Z-Y-X), heights above take-off, RTK sigmas.

    Names after the manuals of Zenmuse P1 (page 22) and Mavic 3M (page 89); older firmware writes
    ``GpsLongtitude``, the oldest leaves the place to EXIF.
    """
    if not any(namespace == metadata.DJI for namespace, _ in xmp):
        return None

    def number(*names: str) -> float:
        return _first_number(xmp, metadata.DJI, names)

    latitude, longitude = number("GpsLatitude"), number("GpsLongitude", "GpsLongtitude")
    if not _is_place(latitude, longitude):
        latitude, longitude = exif.latitude_deg, exif.longitude_deg
    altitude = number("AbsoluteAltitude")
    flag = number("RtkFlag")
    has_rtk = xmp.get((metadata.DJI, "AltitudeType"), "").lower().startswith("rtk") or flag >= 16
    # Mean variance of the two horizontal axes.
    horizontal = float(np.hypot(number("RtkStdLat"), number("RtkStdLon")) / math.sqrt(2))
    vertical = number("RtkStdHgt")
    stated = has_rtk and horizontal > 0 and vertical > 0
    return TagPose(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=exif.altitude_m if math.isnan(altitude) else altitude,
        exif_height_m=exif.altitude_m,
        height_home_m=number("RelativeAltitude"),
        datum="ellipsoid" if has_rtk else "msl",
        datum_guess=RTK_GUESS if has_rtk else DJI_GUESS,
        ypr_deg=_angles(xmp, metadata.DJI, "Gimbal{}Degree"),
        vehicle_ypr_deg=_angles(xmp, metadata.DJI, "Flight{}Degree"),
        sigma_horizontal_m=max(horizontal, RTK_FLOOR_HORIZONTAL_M) if stated else math.nan,
        sigma_vertical_m=max(vertical, RTK_FLOOR_VERTICAL_M) if stated else math.nan,
        source="DJI XMP",
    )


def pix4d_pose(xmp: metadata.XmpTags, exif: metadata.ExifPlace) -> TagPose | None:
    """Read Pix4D's Camera tags (nadir angles), which this program's `geotag --exif` writes too."""
    if (metadata.PIX4D, "Yaw") not in xmp and (metadata.PIX4D, "GPSXYAccuracy") not in xmp:
        return None
    nadir = np.radians([_angles(xmp, metadata.PIX4D, "{}")])
    yaw, pitch, roll = np.degrees(gimbal_from_nadir(nadir)[0]).tolist()
    system = xmp.get((metadata.PIX4D, "VertCS"), "").lower()
    datum: HeightDatum = "ellipsoid" if system == "ellipsoidal" else "msl"
    return TagPose(
        latitude_deg=exif.latitude_deg,
        longitude_deg=exif.longitude_deg,
        height_m=exif.altitude_m,
        datum=datum,
        datum_guess="" if system or exif.above_sea else EXIF_GUESS,
        ypr_deg=(yaw, pitch, roll),
        sigma_horizontal_m=_first_number(xmp, metadata.PIX4D, ("GPSXYAccuracy",)),
        sigma_vertical_m=_first_number(xmp, metadata.PIX4D, ("GPSZAccuracy",)),
        source="Pix4D XMP",
    )


def exif_pose(_xmp: metadata.XmpTags, exif: metadata.ExifPlace) -> TagPose | None:
    """Read plain EXIF: a place without attitude."""
    return TagPose(
        latitude_deg=exif.latitude_deg,
        longitude_deg=exif.longitude_deg,
        height_m=exif.altitude_m,
        datum_guess="" if exif.above_sea else EXIF_GUESS,
        source="EXIF GPS",
    )


MAKERS: tuple[Callable[[metadata.XmpTags, metadata.ExifPlace], TagPose | None], ...] = (
    pix4d_pose,  # first: a copy by `geotag` keeps its maker's tags beside the better ones
    dji_pose,
    exif_pose,
)


ASK_FOR_MOUNT = "State `mount` in the project, or the angles in a CSV file (`poses`)."
"""Request of a message on angles that were not filled in."""


def read_photo_tags(photos: Photos) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Read the poses in the tags of photos; photos without place are left out.

    Heights are NaN where a photo has none, or an impossible one.

    Raises
    ------
    InputError
        No photo has a place, tags cannot be read, or the photos' heights have several datums.
    """
    readings = _read_poses(photos)
    rows = [k for k, pose in enumerate(readings) if _has_place(pose)]
    if not rows:
        raise InputError(
            photos.path[0],
            f"has no place in EXIF or XMP, nor has any of the {len(photos.path)} photos: name a "
            "file in `poses`, or a `log`",
        )
    return _convert_tags(photos, rows, readings)


def read_stated_tags(photos: Photos) -> tuple[PhotoPoses | None, tuple[Message, ...]]:
    """Read the poses in the tags where another source has places, so that an attitude is enough.

    As `read_photo_tags`; None, with a message, where no photo has a place or an attitude.
    """
    readings = _read_poses(photos)
    rows = [k for k, pose in enumerate(readings) if _has_place(pose) or _has_attitude(pose)]
    if not rows:
        text = (
            f"None of the {len(readings)} photos states a place or an attitude in EXIF or XMP: "
            "`exif` in `poses` adds nothing."
        )
        return None, (Message("warning", "no-pose-tags", text),)
    return _convert_tags(photos, rows, readings)


def _convert_tags(
    photos: Photos, rows: list[int], readings: list[TagPose]
) -> tuple[PhotoPoses, tuple[Message, ...]]:
    """Convert the tags of some photos to columns."""
    frame_id = tuple(photos.frame_id[k] for k in rows)
    chosen, unused = _remove_fillers(frame_id, [readings[k] for k in rows])
    guesses = dict.fromkeys(pose.datum_guess for pose in chosen if pose.datum_guess)
    poses = PhotoPoses(
        frame_id=frame_id,
        datum=_one_datum(
            photos, [k for k in rows if math.isfinite(readings[k].height_m)], readings
        ),
        datum_guess="; ".join(guesses),
        ypr_rad=np.radians([p.ypr_deg for p in chosen]),
        vehicle_ypr_rad=np.radians([p.vehicle_ypr_deg for p in chosen]),
        source=", ".join(dict.fromkeys(p.source for p in chosen)),
        **{name: np.array([getattr(pose, name) for pose in chosen]) for name in _COLUMNS},
    )
    return poses, (*unused, *_oddities(frame_id, chosen), *_report_edited_photos(frame_id, chosen))


def first_maker(photos: Photos) -> str:
    """Return the maker of the first photo's pose tags; empty if there are none besides EXIF.

    It is also empty if the tags are unreadable.
    """
    try:
        pose = _read_pose(photos.path[0])
    except InputError:
        return ""
    return pose.source if _has_place(pose) and _has_attitude(pose) else ""


def _read_pose(path: str) -> TagPose:
    xmp, exif = metadata.read_xmp(path), metadata.read_exif_place(path)
    poses = (read(xmp, exif) for read in MAKERS)
    pose = next(pose for pose in poses if pose is not None)
    tool = xmp.get((metadata.XMP, "CreatorTool"), "")
    return replace(pose, editor=tool if _EDITORS.search(tool) else "")


def _read_poses(photos: Photos) -> list[TagPose]:
    with ThreadPoolExecutor() as pool:
        return list(pool.map(_read_pose, photos.path))


def _remove_fillers(
    frame_id: tuple[str, ...], poses: list[TagPose]
) -> tuple[list[TagPose], list[Message]]:
    """Remove angles and altitudes that are mere fillers; return messages about them."""
    poses, of_angles = _remove_zero_angles(frame_id, poses)
    poses, of_heights = _replace_odd_heights(frame_id, poses)
    messages = [*of_angles, *of_heights]
    for name, what in _HEIGHTS.items():
        height = _column(poses, name)
        odd = np.flatnonzero(_is_odd(name, height, poses))
        if not odd.size:
            continue
        names = tuple(frame_id[k] for k in odd)
        text = (
            f"{join_photo_names(names)} cannot have been taken at the {what} that the tags state "
            f"({_list_heights(height[odd])}): it is missing, 0 or of the wrong sign, and was not "
            "used, the place was. Give true heights in a CSV file (`poses`)."
        )
        messages.append(Message("warning", "odd-altitude", text, frames=names))
        unknown: dict[str, Any] = {name: math.nan}
        poses = [replace(p, **unknown) if k in odd else p for k, p in enumerate(poses)]
    return poses, messages


def _column(poses: list[TagPose], name: str) -> Floats:
    return np.array([getattr(pose, name) for pose in poses], dtype=np.float64)


def _list_heights(height_m: Floats) -> str:
    """List distinct heights in words; none where missing."""
    return ", ".join(sorted({f"{h:.1f} m" for h in height_m})).replace("nan m", "none")


def _remove_zero_angles(
    frame_id: tuple[str, ...], poses: list[TagPose]
) -> tuple[list[TagPose], list[Message]]:
    """Remove angles that are exactly 0, 0 and 0 as the drone did not fill them in.

    A gimbal may truly be level and point to the north. It is taken for not filled in where no photo
    states anything else, or where the photos that do look elsewhere than to the horizon and were
    taken at other places.
    """
    poses = [p if np.any(p.vehicle_ypr_deg) else replace(p, vehicle_ypr_deg=NONE) for p in poses]
    angles = np.array([pose.ypr_deg for pose in poses])
    stated = np.isfinite(angles).all(axis=1)
    zero, filled = stated & ~angles.any(axis=1), stated & angles.any(axis=1)
    if not zero.any():
        return poses, []
    empty = zero
    if filled.any():
        is_level = (np.abs(angles[filled, 1]) <= _LEVEL_DEG).any()
        empty = zero & _are_elsewhere(poses, filled) & ~is_level
    messages = []
    if empty.any():
        names = tuple(frame_id[k] for k in np.flatnonzero(empty))
        text = (
            f"{_stating_zero(names)}: the drone did not fill them in, and they were not used. "
            f"{ASK_FOR_MOUNT}"
        )
        messages.append(Message("warning", "gimbal-not-filled", text, frames=names))
    if (zero & ~empty).any():
        names = tuple(frame_id[k] for k in np.flatnonzero(zero & ~empty))
        text = (
            f"{_stating_zero(names)}: taken as level and to the north. If the drone did not fill "
            "them in, give the angles in a CSV file (`poses`)."
        )
        messages.append(Message("info", "gimbal-zero", text, frames=names))
    return [replace(p, ypr_deg=NONE) if empty[k] else p for k, p in enumerate(poses)], messages


def _stating_zero(names: tuple[str, ...]) -> str:
    state = "states" if len(names) == 1 else "state"
    return f"{join_photo_names(names)} {state} gimbal angles of exactly 0, 0 and 0"


def _are_elsewhere(poses: list[TagPose], others: Bools) -> Bools:
    """Mark photos (N,) whose place is known, and near that of none of the others."""
    from scipy.spatial import cKDTree  # noqa: PLC0415  (slow to load, and rarely needed)

    placed = np.array([_has_place(pose) for pose in poses])
    away = placed.copy()
    if placed.any():
        degrees = np.array([(pose.latitude_deg, pose.longitude_deg) for pose in poses])
        origin = (*degrees[placed][0], 0.0)
        latitude, longitude = degrees[placed].T
        place = enu_from_geodetic(latitude, longitude, 0.0, origin)[:, :2]
        nearest_m, _ = cKDTree(place[others[placed]]).query(place)
        away[placed] = nearest_m > _MOVED_M
    return away


def _replace_odd_heights(
    frame_id: tuple[str, ...], poses: list[TagPose]
) -> tuple[list[TagPose], list[Message]]:
    """Replace odd altitudes in the maker's tags by those of EXIF; report either kind of odd one."""
    own, exif = _column(poses, "height_m"), _column(poses, "exif_height_m")
    odd_own = _is_odd("height_m", own, poses)
    odd_exif = _is_odd("height_m", exif, poses) & np.isfinite(exif)
    from_exif = odd_own & np.isfinite(exif) & ~odd_exif
    messages = []
    for which, wrong, right, odd in (
        (from_exif, "the maker's tags (XMP)", "EXIF", own),
        (odd_exif & ~odd_own, "EXIF", "the maker's tags (XMP)", exif),
    ):
        names = tuple(frame_id[k] for k in np.flatnonzero(which))
        if names:
            text = (
                f"{join_photo_names(names)} cannot have been taken at the altitude in {wrong} "
                f"({_list_heights(odd[which])}): it is 0 or of the wrong sign. The one in "
                f"{right} was used."
            )
            messages.append(Message("info", "odd-altitude", text, frames=names))
    poses = [replace(p, height_m=exif[k]) if from_exif[k] else p for k, p in enumerate(poses)]
    return poses, messages


def _is_odd(name: str, height: Floats, poses: list[TagPose]) -> Bools:
    """Mark the photos (N,) with a missing altitude, or a height that is 0 or of the wrong sign.

    An altitude is missing where there is a place without it. The sign is wrong if the height
    mirrors those of the other photos, or if all are negative.
    """
    above = height[height > 0]
    usual = float(np.median(above)) if above.size else math.nan
    mirrored = np.abs(usual + height) < _MIRRORED_SHARE * (usual - height)
    missing = np.zeros(len(poses), dtype=np.bool_)
    below = height < 0
    if name == "height_m":
        missing = np.isnan(height) & [_has_place(pose) for pose in poses]
        below = (height < -_LEAST_DEPTH_M) & [pose.datum == "msl" for pose in poses]
    return np.asarray(missing | (height == 0) | (below & (mirrored | math.isnan(usual))))


def _one_datum(photos: Photos, placed: list[int], readings: list[TagPose]) -> HeightDatum:
    """Determine the datum of the heights of photos with a place; sea level where none has one."""
    if not placed:
        return "msl"
    first = readings[placed[0]].datum
    other = [k for k in placed if readings[k].datum != first]
    if other:
        raise InputError(
            photos.path[other[0]],
            f"states a height above {readings[other[0]].datum}, but "
            f"{photos.frame_id[placed[0]]} one above {first} ({len(other)} of {len(placed)} photos "
            "differ from the first; was RTK lost?): leave one kind out, or give the poses in a "
            "CSV file with heights of one datum",
        )
    return first


def _oddities(frame_id: tuple[str, ...], poses: list[TagPose]) -> tuple[Message, ...]:
    """Report cameras that are upside down, at nadir (a matter of notation) or elsewhere."""
    over = [
        (name, pose.ypr_deg)
        for name, pose in zip(frame_id, poses, strict=True)
        if abs(pose.ypr_deg[2]) > _UPSIDE_DOWN_DEG
    ]
    nadir = [name for name, ypr in over if abs(ypr[1] + 90.0) <= _NEAR_NADIR_DEG]
    messages = []
    if nadir:
        text = (
            f"The tags of {format_photo_count(nadir)} state a gimbal roll near 180 degrees while "
            " looking down: taken as a half turn about the optical axis, the same as roll 0 "
            "with the yaw turned by 180 degrees"
        )
        messages.append(Message("info", "gimbal-roll-180", text))
    if len(over) > len(nadir):
        names = [name for name, _ in over if name not in nadir]
        text = (
            f"The tags of {format_photo_count(names)} state a camera upside down; these "
            " directions are used: check the seeds"
        )
        messages.append(Message("warning", "gimbal-upside-down", text))
    return tuple(messages)


def _report_edited_photos(frame_id: tuple[str, ...], poses: list[TagPose]) -> tuple[Message, ...]:
    edited = {name: p.editor for name, p in zip(frame_id, poses, strict=True) if p.editor}
    if not edited:
        return ()
    text = (
        f"{next(iter(edited.values()))} saved {format_photo_count(list(edited))}: where it turned "
        f"or "
        "cropped a photo, the pose tags and the camera file no longer fit; use the camera's own "
        "files"
    )
    return (Message("warning", "photo-edited", text),)


def _angles(xmp: metadata.XmpTags, namespace: str, pattern: str) -> Angles:
    """Read yaw, pitch, roll [deg]; all NaN where one is missing."""
    values = [_first_number(xmp, namespace, (pattern.format(a),)) for a in ("Yaw", "Pitch", "Roll")]
    return NONE if any(math.isnan(v) for v in values) else (values[0], values[1], values[2])


def _first_number(xmp: metadata.XmpTags, namespace: str, names: Iterable[str]) -> float:
    """Return the first of the tags that is present and finite; a fraction (1/50) is one number."""
    for name in names:
        over, _, under = xmp.get((namespace, name), "").partition("/")
        try:
            value = float(over) / (float(under) if under else 1.0)
        except (ValueError, ZeroDivisionError):
            continue
        if math.isfinite(value):
            return value
    return math.nan


def _is_place(latitude_deg: float, longitude_deg: float) -> bool:
    """Return whether this is a place on earth; (0, 0) means "no fix"."""
    inside = abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180
    return inside and not (latitude_deg == 0 and longitude_deg == 0)


def _has_place(pose: TagPose) -> bool:
    return _is_place(pose.latitude_deg, pose.longitude_deg)


def _has_attitude(pose: TagPose) -> bool:
    return not any(math.isnan(angle) for angle in pose.ypr_deg)

"""Photo poses that a person wrote: a CSV table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from uavgram.geometry.earth.geodesy import EXCHANGED, Origin, are_exchanged
from uavgram.io.tables.csv_tables import Columns, Table, read_table
from uavgram.model.flight.log import HeightDatum
from uavgram.model.flight.photo_poses import PhotoPoses

_ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")
_SIGMAS = ("sigma_horizontal_m", "sigma_vertical_m", "sigma_attitude_deg")
_PLACE = ("latitude_deg", "longitude_deg", "height_m")


def read_pose_csv(
    path: str | Path,
    heights: HeightDatum,
    site: Origin | None = None,
    *,
    may_lack_places: bool = False,
) -> PhotoPoses:
    """Read image, latitude_deg, longitude_deg, height_m and, optional, angles and sigmas.

    Angles are those of the optical axis, as of a gimbal: yaw from north, pitch -90 straight down,
    roll 0 with the horizon level; all three, or none.

    Parameters
    ----------
    path
        The table.
    heights
        Datum of its heights.
    site
        Where the photos were taken by their own tags; None: they state no place.
    may_lack_places
        Whether another source has places, so that a row may have none: all three numbers, or none.

    Raises
    ------
    InputError
        Names file and line of every mistake.
    """
    table = read_table(
        path,
        Columns(
            text=("image",),
            numbers=() if may_lack_places else _PLACE,
            optional_numbers=(*(_PLACE if may_lack_places else ()), *_ANGLES, *_SIGMAS),
        ),
    )
    _check(table, site)
    numbers = table.numbers
    return PhotoPoses(
        frame_id=table.text["image"],
        latitude_deg=numbers["latitude_deg"],
        longitude_deg=numbers["longitude_deg"],
        height_m=numbers["height_m"],
        sigma_horizontal_m=numbers["sigma_horizontal_m"],
        sigma_vertical_m=numbers["sigma_vertical_m"],
        datum=heights,
        ypr_rad=np.radians(np.stack([numbers[name] for name in _ANGLES], axis=1)),
        sigma_attitude_rad=np.radians(numbers["sigma_attitude_deg"]),
        source=table.path.name,
    )


def _check(table: Table, site: Origin | None) -> None:
    for name in _SIGMAS:
        table.require_sigma(name)
    table.require_unique("image", "photo")
    table.require_range("latitude_deg", 90.0)
    table.require_range("longitude_deg", 360.0)
    for together in (_ANGLES, _PLACE):
        given = np.stack([np.isfinite(table.numbers[name]) for name in together], axis=1)
        for row in np.flatnonzero(given.any(axis=1) & ~given.all(axis=1)):
            names = f"{', '.join(together[:-1])} and {together[-1]}"
            table.blame(int(row), f"{names}: give all three, or none")
    if site is not None:
        place = table.numbers["latitude_deg"], table.numbers["longitude_deg"]
        for exchanged in np.flatnonzero(are_exchanged(place, place[::-1], site)).tolist():
            table.blame(exchanged, EXCHANGED)
    if not len(table.line):
        table.faults.append((None, "holds no photo: give a row for each, or leave `poses` out"))
    table.raise_faults()

"""How a DataFlash log says that the gimbal was turned (MNT).

Field meanings: ArduPilot libraries/AP_Mount/AP_Mount_Backend.cpp, LogStructure.h.
"""

from __future__ import annotations

import numpy as np

from uavgram.io.logs.dataflash.formats import Columns
from uavgram.io.logs.dataflash.samples import boot_time_s, numbers
from uavgram.io.logs.dataflash.tables import Tables
from uavgram.io.logs.quality.gimbal import from_angles
from uavgram.io.logs.quality.samples import Found
from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight.log import GimbalSamples

_ANGLES = ("Roll", "Pitch", "YawE", "YawB")
_ODD_ONES = 0.05  # of all rows: fewer of another mount are damaged numbers of this one


def gimbal(tables: Tables) -> Found[GimbalSamples]:
    """MNT of the mount with most rows: yaw from north (YawE) where known, else from the nose.

    A mount that knows no angle writes NaN; rows that say something and cannot be used are told.
    """
    columns = tables.columns("MNT")
    if not columns:
        return None, ()
    speaks = np.any([np.isfinite(numbers(columns, name)) for name in _ANGLES], axis=0)
    if not speaks.any():
        return None, ()
    mine, notes = _of_one_mount(columns, speaks)
    earth, vehicle = numbers(columns, "YawE")[mine], numbers(columns, "YawB")[mine]
    use_earth = _use_earth(earth, vehicle)
    tilt = [numbers(columns, name)[mine] for name in ("Roll", "Pitch")]
    samples, remarks = from_angles(
        boot_time_s(columns)[mine],
        np.stack([*tilt, earth if use_earth else vehicle], axis=1),
        "MNT",
        yaw_frame="earth" if use_earth else "vehicle",
        stated=np.ones(int(mine.sum()), dtype=bool),
    )
    notes += remarks
    if samples is None:
        missing = [name for name in ("Roll", "Pitch") if name not in columns]
        why = f": they have no {' and no '.join(missing)}" if missing else ""
        notes = (*notes, f"the gimbal's attitude (MNT) could not be used{why}")
    return samples, notes


def _use_earth(earth: Floats, vehicle: Floats) -> bool:
    known, nose = int(np.isfinite(earth).sum()), int(np.isfinite(vehicle).sum())
    return known > 0 and known >= nose


def _of_one_mount(columns: Columns, speaks: Bools) -> tuple[Bools, tuple[str, ...]]:
    """(N,) rows of the mount that has most of those that say something; what of the others."""
    if "I" not in columns:
        return speaks, ()
    stated = numbers(columns, "I")
    seen, count = np.unique(stated[speaks & np.isfinite(stated)], return_counts=True)
    if not len(seen):
        return speaks, ("MNT rows name no mount: they were taken for one",)
    chosen = float(seen[count.argmax()])
    mine = speaks & (stated == chosen)
    others = int(speaks.sum() - mine.sum())
    if not others:
        return mine, ()
    if others < _ODD_ONES * len(stated):
        return mine, (f"{others} of {len(stated)} MNT rows name no mount that is there: dropped",)
    held = " and ".join(f"{number:g}" for number in seen)
    return mine, (f"MNT is of mounts {held}; number {chosen:g}, which has most rows, was used",)

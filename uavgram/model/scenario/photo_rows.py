"""Where the camera of a simulated flight was while each photo was read, row after row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from uavgram.model.arrays import Floats, FrozenArrays, Ints


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoRows(FrozenArrays):
    """Poses at a few instants of each photo, so near to each other that lines join them.

    Attributes
    ----------
    share
        (R,) when, evenly spaced: in readout times from the middle row, as `row_share`
        (geometry/motion/row_poses.py) says of a row.
    center_world_m, world_from_camera
        (F, R, 3), (F, R, 3, 3).
    """

    share: Annotated[Floats, "r"]
    center_world_m: Annotated[Floats, "f", "r", 3]
    world_from_camera: Annotated[Floats, "f", "r", 3, 3]

    def at(self, frame: Ints | int, share: Floats) -> tuple[Floats, Floats]:
        """Centres (..., 3) and rotations (..., 3, 3) of rows.

        Parameters
        ----------
        frame
            Which photo, one for all rows or (...) one for each.
        share
            (...) of the rows; a little beyond the table's ends the last motion goes on.
        """
        step = (self.share[-1] - self.share[0]) / (len(self.share) - 1)
        place = (share - self.share[0]) / step
        before = np.clip(np.floor(place), 0, len(self.share) - 2).astype(np.int64)
        part = (place - before)[..., None]
        center = _between(self.center_world_m, frame, before, part)
        return center, _between(self.world_from_camera, frame, before, part[..., None])


def _between(table: Floats, frame: Ints | int, before: Ints, part: Floats) -> Floats:
    """Of rows `before` and the next, so far on."""
    first = table[frame, before]
    return np.asarray(first + part * (table[frame, before + 1] - first))

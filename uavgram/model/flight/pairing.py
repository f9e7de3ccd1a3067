"""Which photo is which camera event of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from uavgram.model.arrays import Floats, Ints, freeze, freeze_as

PairStatus = Literal["certain", "hidden", "crowded", "none"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairing:
    """F photos and E camera events of one boot.

    Attributes
    ----------
    frame_id
        (F,) the photos.
    event_index
        (F,) row of the boot's camera events, -1 where the photo has none.
    residual_s
        (F,) photo time by the fitted clock - event time; NaN without an event.
    status
        (F,) of `Alignment.status`: only a ``certain`` photo takes its event's time.
    reason
        (F,) why a photo has no certain event; empty where it has.
    unused_event
        (U,) rows of the boot's camera events that no photo was paired with.
    unused_reason
        (U,) where they lie among the photos.
    drift, drift_sigma
        Of the camera's clock against the autopilot's.
    """

    frame_id: tuple[str, ...]
    event_index: Ints
    residual_s: Floats
    status: tuple[PairStatus, ...]
    reason: tuple[str, ...]
    unused_event: Ints
    unused_reason: tuple[str, ...]
    drift: float
    drift_sigma: float

    def __post_init__(self) -> None:
        n = len(self.frame_id)
        freeze(self, may_be_nan=("residual_s",), residual_s=(n,))
        freeze_as(self, np.int64, event_index=(n,), unused_event=(len(self.unused_reason),))

"""Which photo is which camera event of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from uavgram.model.arrays import NAN_IS_NONE, Floats, FrozenArrays, Ints

PairStatus = Literal["certain", "hidden", "crowded", "none"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairing(FrozenArrays):
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

    frame_id: Annotated[tuple[str, ...], "n"]
    event_index: Annotated[Ints, "n"]
    residual_s: Annotated[Floats, "n", NAN_IS_NONE]
    status: Annotated[tuple[PairStatus, ...], "n"]
    reason: Annotated[tuple[str, ...], "n"]
    unused_event: Annotated[Ints, "u"]
    unused_reason: Annotated[tuple[str, ...], "u"]
    drift: float
    drift_sigma: float

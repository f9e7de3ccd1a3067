"""Stage: assign instants of the flight to photos, by file times and camera events."""

from uavgram.stages.synchronise.photo_times import Synchronised, synchronise

__all__ = ["Synchronised", "synchronise"]

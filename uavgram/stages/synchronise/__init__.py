"""Stage: assign instants of the flight to photos, by file times and camera events."""

from uavgram.stages.synchronise.matching import Synchronised, synchronise

__all__ = ["Synchronised", "synchronise"]

"""Which instant of the flight belongs to which photo, by file times and camera events."""

from uavgram.stages.synchronise.matching import Synchronised, synchronise

__all__ = ["Synchronised", "synchronise"]

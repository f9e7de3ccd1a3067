"""Which instant of the flight belongs to which photo: see `matching`."""

from uavgram.stages.synchronise.matching import Synchronised, synchronise

__all__ = ["Synchronised", "synchronise"]

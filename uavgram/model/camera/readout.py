"""How long a camera takes to read a photo, from the first row to the last."""

from __future__ import annotations

from dataclasses import dataclass

TABLE_SIGMA_S = 0.005
"""Of a published readout time: other firmware, another mode, or the way it was measured."""


@dataclass(frozen=True, kw_only=True)
class Readout:
    """A readout time and its standard deviation [s].

    Row v of a photo of height h is exposed at time + value (v - (h - 1) / 2) / h. It is 0 where a
    shutter exposes all rows at once, negative where the last row is read first.
    """

    value_s: float
    sigma_s: float


UNKNOWN_READOUT = Readout(value_s=0.0, sigma_s=0.030)
"""Of a camera of which nothing is said: all rows at once, or about as slow as most in the table."""

# Milliseconds, by the most megapixels of a photo that they hold for. From OpenDroneMap's
# opendm/rollingshutter.py (values measured by its users with a blinking light,
# https://github.com/OpenDroneMap/RSCalibration). The Phantom 4 Pro (FC6310) is left out: as the
# Mavic 3 Enterprise and others with a mechanical shutter, it has two kinds, and a photo does not
# say which one it was taken with.
_ANY = float("inf")
_PUBLISHED_MS: dict[str, tuple[tuple[float, float], ...]] = {
    "autel robotics xl724": ((_ANY, 29),),  # Nano+
    "autel robotics xt701": ((_ANY, 25),),  # Evo II 8k
    "autel robotics xt705": ((_ANY, 30),),  # Evo II Pro
    "dji phantom vision fc200": ((_ANY, 74),),  # Phantom 2 Vision
    "dji fc2103": ((_ANY, 32),),  # Mavic Air
    "dji fc220": ((_ANY, 64),),  # Mavic Pro
    "dji fc300c": ((_ANY, 33),),  # Phantom 3 Standard
    "dji fc300s": ((_ANY, 33),),  # Phantom 3 Advanced
    "dji fc300x": ((_ANY, 33),),  # Phantom 3 Professional
    "dji fc3170": ((_ANY, 27),),  # Mavic Air 2
    "dji fc330": ((_ANY, 33),),  # Phantom 4
    "dji fc3411": ((_ANY, 32),),  # Air 2S
    "dji fc350": ((_ANY, 30),),  # Inspire 1
    "dji fc3582": ((48, 26), (_ANY, 60)),  # Mini 3 Pro
    "dji fc3682": ((_ANY, 23),),  # Mini 3
    "dji fc7203": ((10, 19), (_ANY, 25)),  # Mavic Mini
    "dji fc8482": ((12, 16), (20, 21), (45, 43), (_ANY, 58)),  # Mini 4 Pro
    "dji mavic2-enterprise-advanced": ((_ANY, 31),),
    "dji zenmuse z30": ((_ANY, 8),),
    "gopro hero4 black": ((_ANY, 30),),
    "gopro hero8 black": ((_ANY, 17),),
    "hasselblad l1d-20c": ((17, 47), (_ANY, 56)),  # Mavic 2 Pro
    "hasselblad l2d-20c": ((_ANY, 16.6),),  # Mavic 3, not the Enterprise
    "parrot anafi": ((_ANY, 39),),
    "yuneec e90": ((_ANY, 44),),
}


def published_readout(make: str, model: str, width_px: int, height_px: int) -> Readout | None:
    """What is published of a camera; None where nothing is.

    Parameters
    ----------
    make, model
        As EXIF has them.
    width_px, height_px
        Size of the photos: some cameras have several modes.
    """
    modes = _PUBLISHED_MS.get(f"{make.strip()} {model.strip()}".casefold().strip())
    if modes is None:
        return None
    megapixels = width_px * height_px / 1e6
    value_ms = next(ms for most, ms in modes if megapixels < most)
    return Readout(value_s=value_ms / 1e3, sigma_s=TABLE_SIGMA_S)

"""What a log says of a flight a second time, on the track's clock and in its world."""

from __future__ import annotations

import numpy as np

from uavgram.estimation.clocks.boot_clock import to_utc
from uavgram.geometry.earth.geodesy import Origin, enu_from_geodetic
from uavgram.geometry.motion.rotation import ENU_FROM_NED
from uavgram.model.flight.log import Boot, BootClock
from uavgram.model.flight.second_opinions import FlightEvidence

_NONE = np.zeros(0), np.zeros((0, 3))


def gather_evidence(boot: Boot, clock: BootClock, origin: Origin) -> FlightEvidence:
    """Velocities, the receiver's own places, rates of turn and the stated resets of a boot.

    Parameters
    ----------
    boot, clock
        The boot, and its line to UTC.
    origin
        Latitude, longitude [deg] and height [m] of the world's origin, as for `build_track`.
    """
    velocity, receiver, turn = _NONE, _NONE, _NONE
    if boot.velocities is not None:
        stated = boot.velocities
        velocity = to_utc(clock, stated.time_boot_s), stated.ned_m_s @ ENU_FROM_NED.T
    if boot.turn_rates is not None:
        turn = to_utc(clock, boot.turn_rates.time_boot_s), boot.turn_rates.body_rad_s
    other = boot.receiver
    if other is not None and boot.positions is not None and other.source != boot.positions.source:
        place = enu_from_geodetic(other.latitude_deg, other.longitude_deg, other.height_m, origin)
        receiver = to_utc(clock, other.time_boot_s), place
    at = to_utc(clock, np.array([reset.time_boot_s for reset in boot.resets]))
    what = (reset.what for reset in boot.resets)
    return FlightEvidence(
        velocity_time_s=velocity[0],
        velocity_world_m_s=velocity[1],
        receiver_time_s=receiver[0],
        receiver_world_m=receiver[1],
        turn_time_s=turn[0],
        turn_body_rad_s=turn[1],
        resets=tuple(zip(at.tolist(), what, strict=True)),
    )

"""In which ways a survey can differ from what the program takes for granted.

A condition is added to a clean survey, in which every unknown is drawn from the prior that the
project states. The named ones are the rows of the study (`tests/benchmarks/study_reality.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType


@dataclass(frozen=True, kw_only=True)
class Condition:
    """What is done to a survey; the defaults make a clean one.

    Attributes
    ----------
    relief_m, relief_length_m
        Standard deviation and correlation length of the ground's departure from its plane; without
        a length each point has its own.
    kerb_m, bank_m
        Step across a line through the scene; rise over 3 m behind a line.
    crown_percent, slope_break_percent, slope_deg
        Fall to both sides of a line; rise behind a line; slope of the whole ground.
    identification_m
        In each photo another place is picked for a label, by so much east and north.
    raised
        Labels that stand off the ground though nobody says so, and by how much [m].
    readout_s
        Row v is exposed at time + readout (v - (height - 1) / 2) / height.
    zoom, other_camera_photos
        Factor of the focal length of all photos; how many photos another camera took.
    focal_error, principal_error_px
        Of the stated calibration: share of the focal length; in u.
    gps_jump_m
        Step of the logged position amid the photos.
    tape_scale, horizontal_tape, wrong_length_m
        All lengths are read long by this share; are horizontal ones; one is wrong by so much.
    length_factor
        True over stated sigma of the lengths.
    heavy_tails, pick_factor
        Share of picks that are five times as bad; true over stated sigma of the picks.
    lag_s, drift_ppm
        Of the camera's clock.
    yaw_deg, mount_deg, lever_m, datum_m
        Common errors of the log's heading, of the mount, of the lever arm, of the log's heights.
    log_hz, has_log
        Rate of attitudes and positions, None: 10 Hz to 25 Hz as drawn; whether there is a log.
    single
        Only one of the photos is there.
    picked_share, sharp
        How many of a photo's labels are picked where no length ends at them; a camera of
        4000 x 3000 px.
    labels, radius_m, farthest_m
        Points, in a scene of this radius; the longest distance that is taped or measured.
    tilts_deg, speeds_m_s
        Range of tilts, first photo to last, and of speeds.
    photos, stride_m, any_geometry
        How many; how far the place looked at moves on, photo to photo; whether all this and the
        tilts are drawn for each survey, see `hostile_things.draw_geometry`.
    cars, walls, kerbs
        That stand on the ground.
    ties, matched, wrong_found
        Number of tie points that the program looks for; whether each label is picked once, and
        found in the other photos by the program; share of what it finds that is wrong.
    draws_scale, draws_readout, draws_slope, draws_relief, draws_identification
        Whether tape scale (0.1 %), readout (30 ms), slopes (the default of
        `ground.slope_sigma_deg`, else 0.5 degrees), each point's own relief (2 cm) and how far
        beside it is picked, alike in all photos (1 cm), are drawn from the program's priors.
    """

    relief_m: float = 0.0
    relief_length_m: float = 0.0
    kerb_m: float = 0.0
    bank_m: float = 0.0
    crown_percent: float = 0.0
    slope_break_percent: float = 0.0
    slope_deg: float = 0.0
    identification_m: float = 0.0
    raised: tuple[tuple[int, float], ...] = ()
    readout_s: float = 0.0
    zoom: float = 1.0
    other_camera_photos: int = 0
    focal_error: float = 0.0
    principal_error_px: float = 0.0
    gps_jump_m: float = 0.0
    tape_scale: float = 0.0
    horizontal_tape: bool = False
    wrong_length_m: float = 0.0
    length_factor: float = 1.0
    heavy_tails: float = 0.0
    pick_factor: float = 1.0
    ties: int = 0
    matched: bool = False
    wrong_found: float = 0.0
    lag_s: float = 0.0
    drift_ppm: float = 0.0
    yaw_deg: float = 0.0
    mount_deg: float = 0.0
    lever_m: float = 0.0
    datum_m: float = 0.0
    log_hz: float | None = None
    has_log: bool = True
    single: bool = False
    picked_share: float = 0.3
    sharp: bool = False
    labels: int = 28
    radius_m: float = 20.0
    farthest_m: float = 12.0
    tilts_deg: tuple[float, float] = (0.0, 36.0)
    speeds_m_s: tuple[float, float] = (3.0, 8.0)
    photos: int = 9
    stride_m: float = 0.0
    any_geometry: bool = False
    cars: int = 0
    walls: int = 0
    kerbs: int = 0
    draws_scale: bool = False
    draws_readout: bool = False
    draws_slope: bool = False
    draws_relief: bool = False
    draws_identification: bool = False


CLEAN = Condition()
REAL_MIX = Condition(
    relief_m=0.05,
    relief_length_m=5.0,
    identification_m=0.02,
    readout_s=0.04,
    focal_error=0.003,
    tape_scale=0.002,
    lag_s=0.1,
    heavy_tails=0.05,
    yaw_deg=3.0,
    mount_deg=1.5,
)
BAD_MIX = Condition(
    relief_m=0.1,
    relief_length_m=5.0,
    identification_m=0.03,
    readout_s=0.06,
    tape_scale=0.005,
    focal_error=0.005,
    lag_s=0.2,
    yaw_deg=5.0,
    mount_deg=3.0,
    length_factor=2.0,
)
PLANE = replace(CLEAN, speeds_m_s=(15.0, 22.0))

_SHARED = {
    "clean": CLEAN,
    "clean_prior": Condition(
        draws_scale=True,
        draws_readout=True,
        draws_slope=True,
        draws_relief=True,
        draws_identification=True,
    ),
    "real_mix": REAL_MIX,
    "bad_mix": BAD_MIX,
}
_SHARP = {
    f"{name}_sharp": replace(condition, sharp=True, picked_share=1.0)
    for name, condition in _SHARED.items()
}
_GROUND = {
    "rough_3cm": Condition(relief_m=0.03),
    "rough_5cm": Condition(relief_m=0.05),
    "rough_10cm": Condition(relief_m=0.1),
    "rough_10cm_tilt45": Condition(relief_m=0.1, tilts_deg=(45.0, 45.0)),
    "relief_10cm": Condition(relief_m=0.1, relief_length_m=8.0),
    "kerb_12cm": Condition(kerb_m=0.12),
    "bank_1m": Condition(bank_m=1.0),
    "crown_2": Condition(crown_percent=2.0),
    "slope_break_4": Condition(slope_break_percent=4.0),
    "slope_5deg": Condition(slope_deg=5.0),
    "identification_3cm": Condition(identification_m=0.03),
}
_CAMERA = {
    "shutter_20": Condition(readout_s=0.02),
    "shutter_40": Condition(readout_s=0.04),
    "shutter_60": Condition(readout_s=0.06),
    "plane": PLANE,
    "shutter_40_plane": replace(PLANE, readout_s=0.04),
    "zoom_1.3": Condition(zoom=1.3),
    "zoom_1.1": Condition(zoom=1.1),
    "two_other_photos": Condition(other_camera_photos=2),
    "focal_0.5": Condition(focal_error=0.005),
    "principal_10px": Condition(principal_error_px=10.0),
    "tails": Condition(heavy_tails=0.05),
    "picks_2x": Condition(pick_factor=2.0),
    "picks_3x": Condition(pick_factor=3.0),
}
_LENGTHS = {
    "tape_1": Condition(tape_scale=0.01),
    "tape_0.3": Condition(tape_scale=0.003),
    "horizontal_tape": Condition(horizontal_tape=True, slope_deg=5.0),
    "wrong_20cm": Condition(wrong_length_m=0.2),
    "wrong_10cm": Condition(wrong_length_m=0.1),
    "wrong_5cm": Condition(wrong_length_m=0.05),
    "lengths_2x": Condition(length_factor=2.0),
}
_LOG = {
    "gps_jump_1m": Condition(gps_jump_m=1.0),
    "gps_jump_3m": Condition(gps_jump_m=3.0),
    "gps_jump_10m": Condition(gps_jump_m=10.0),
    "yaw_5deg": Condition(yaw_deg=5.0),
    "datum_30m": Condition(datum_m=30.0),
    "lag_0.2": Condition(lag_s=0.2),
    "drift_50ppm": Condition(drift_ppm=50.0),
    "log_1hz": Condition(log_hz=1.0),
    "mount_3deg": Condition(mount_deg=3.0),
    "lever_30cm": Condition(lever_m=0.3),
    "no_log": Condition(has_log=False),
    "no_log_dense": Condition(has_log=False, picked_share=1.0),
    "no_log_wide": Condition(has_log=False, picked_share=1.0, radius_m=35.0),
    "no_log_few": Condition(
        has_log=False, picked_share=1.0, radius_m=35.0, labels=14, farthest_m=25.0
    ),
}
_SINGLE = {
    "single": Condition(single=True, picked_share=1.0),
    "single_prior": replace(_SHARED["clean_prior"], single=True, picked_share=1.0),
    "single_bank_1m": Condition(single=True, picked_share=1.0, bank_m=1.0),
    "single_crown_2": Condition(single=True, picked_share=1.0, crown_percent=2.0),
    "single_shutter_40": Condition(single=True, picked_share=1.0, readout_s=0.04),
    "single_identification_3cm": Condition(single=True, picked_share=1.0, identification_m=0.03),
    "single_tape_1": Condition(single=True, picked_share=1.0, tape_scale=0.01),
}
_STREET = Condition(
    draws_scale=True,
    draws_readout=True,
    draws_slope=True,
    picked_share=0.7,
    labels=14,
    any_geometry=True,
    cars=2,
    walls=1,
    kerbs=1,
)
_STREETS = {
    "street": _STREET,
    "street_no_log": replace(
        _STREET, has_log=False, draws_readout=False, picked_share=1.0, farthest_m=25.0
    ),
    "street_rough_3cm": replace(_STREET, relief_m=0.03),
    "street_real_mix": replace(
        REAL_MIX, picked_share=0.7, labels=14, any_geometry=True, cars=2, walls=1, kerbs=1
    ),
}
_FOUND = {
    "tied": Condition(ties=400, draws_slope=True),
    "tied_wrong": Condition(ties=400, wrong_found=0.01, relief_m=0.03),
    "tied_real_mix": replace(REAL_MIX, ties=400, wrong_found=0.005),
    "matched": Condition(matched=True, picked_share=1.0),
    "matched_wrong": Condition(matched=True, picked_share=1.0, wrong_found=0.01, relief_m=0.03),
    "matched_street": replace(_STREET, matched=True, picked_share=1.0),
    "matched_tied": Condition(matched=True, picked_share=1.0, ties=400, wrong_found=0.005),
}

CONDITIONS = MappingProxyType(
    _SHARED | _SHARP | _GROUND | _CAMERA | _LENGTHS | _LOG | _SINGLE | _STREETS | _FOUND
)
"""By their names on the command line."""

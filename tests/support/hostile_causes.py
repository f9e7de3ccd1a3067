"""Causes of misfit that users make or meet, and by which codes they are named rightly.

The study is `tests/benchmarks/study_causes.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import hostile_faults as faults
import hostile_length_faults as lengths
import numpy as np
from hostile_conditions import CLEAN, CONDITIONS, Condition
from hostile_faults import Fault

from uavgram.model.result.result import Result

SURE = 3.0
"""Sigmas beyond which a learnt value tells of what it was learnt from."""


def learnt_readout(result: Result) -> bool:
    """The time in which photos are read is told as not 0."""
    readout = result.shared.readout_s
    return readout is not None and bool((abs(readout.value) > SURE * readout.sigma).all())


def learnt_slope(result: Result) -> bool:
    """The ground is told as not level."""
    slope = result.plane.slope_deg
    return bool((np.abs(slope.value) > SURE * slope.sigma).any())


def learnt_relief(result: Result) -> bool:
    """The ground is told as not plane."""
    rough = () if result.noise is None else result.noise.roughness
    return any(one.shape != "plane" or one.estimated_m > SURE * one.sigma_m for one in rough)


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is wrong, and what names it.

    Attributes
    ----------
    condition, fault
        Of the world, and of the user.
    exact
        Codes that name this very cause.
    also
        Codes that are right as well, but say less.
    learnt
        Whether the result tells of it by a learnt value.
    must
        Whether its naming is among what the program promises.
    common
        All lengths are wrong alike: whether that shows at all, is asked of each survey.
    mended
        Whether `outliers: remove` is to put it in order.
    """

    condition: Condition = CLEAN
    fault: Fault = faults.none
    exact: frozenset[str] = frozenset()
    also: frozenset[str] = frozenset()
    learnt: Callable[[Result], bool] | None = None
    must: bool = False
    common: bool = False
    mended: bool = False

    @property
    def has_cause(self) -> bool:
        """Whether anything is wrong."""
        return bool(self.exact) or self.learnt is not None


def _set(*codes: str) -> frozenset[str]:
    return frozenset(codes)


def _one_length(reading: Callable[[float, np.random.Generator], float]) -> Fault:
    return partial(lengths.one_length, reading=reading)


_WRONG_LENGTH = _set("line-suspect", "line-left-out", "line-removed", "known-suspect")
_WRONG_PICK = _set("pick-suspect", "pick-left-out", "pick-removed")
_DIGIT = Case(exact=_set("line-wrong-digit"), also=_WRONG_LENGTH, must=True)
_UNIT = Case(
    fault=_one_length(lengths.in_feet),
    exact=_set("line-wrong-unit"),
    also=_WRONG_LENGTH,
    must=True,
    mended=True,
)
_FACTOR = Case(exact=_set("lengths-factor"), must=True, common=True)
_OFFSET = replace(_FACTOR, exact=_set("lengths-offset"), also=_set("lengths-factor"))
_ALL_FEET = Case(
    fault=partial(lengths.all_lengths, factor=1 / lengths.FOOT_M),
    exact=_set("lengths-wrong-unit"),
    also=_set("lengths-factor"),
    must=True,
    common=True,
    mended=True,
)
_SWAPPED = Case(fault=faults.swapped_once, exact=_set("labels-swapped"), must=True, mended=True)
_EVERYWHERE = Case(exact=_set("labels-swapped-everywhere"), must=True, mended=True)
_ELSEWHERE = Case(exact=_set("label-elsewhere"), also=_WRONG_PICK | _set("labels-swapped"))
_RAISED = Case(exact=_set("point-off-ground"), must=True, mended=True)
_RELIEF = Case(
    exact=_set("ground-not-plane"),
    learnt=learnt_relief,
    must=True,
)
_SHUTTER = Case(learnt=learnt_readout, must=True)
_OTHER_CAMERA = Case(exact=_set("other-camera"), also=_set("other-zoom"), must=True)
_GIMBAL = Case(exact=_set("gimbal-off", "mount-turned"), must=True)
_CLOCK = Case(exact=_set("clock-off"))
_TURNED = Case(exact=_set("photo-turned"))
_STEP = Case(
    exact=_set("log-position-jump"),
    also=_set("log-receiver-apart"),
    must=True,
)
_NO_LOG = CONDITIONS["no_log_dense"]


def _under(name: str, case: Case) -> Case:
    return replace(case, condition=CONDITIONS[name])


_LABELS = {
    "labels_swapped": _SWAPPED,
    "labels_swapped_everywhere": replace(
        _EVERYWHERE, fault=partial(faults.swapped_everywhere, lengths=(2, 99))
    ),
    "labels_swapped_everywhere_one_length": replace(
        _EVERYWHERE,
        fault=partial(faults.swapped_everywhere, lengths=(1, 1)),
        also=_WRONG_LENGTH | _set("line-other-ends"),
    ),
    "label_elsewhere": replace(_ELSEWHERE, fault=partial(faults.clicked_elsewhere, both=False)),
    "label_elsewhere_both": replace(_ELSEWHERE, fault=partial(faults.clicked_elsewhere, both=True)),
    "pick_60px": Case(
        fault=partial(faults.gross_pick, far_px=60.0), exact=_WRONG_PICK, must=True, mended=True
    ),
    "raised_1_3m": replace(_RAISED, fault=partial(faults.raised_label, from_m=1.0, to_m=3.0)),
    "raised_40_100cm": replace(_RAISED, fault=partial(faults.raised_label, from_m=0.4, to_m=1.0)),
}
_LENGTHS = {
    "length_in_feet": _UNIT,
    "length_1m": replace(_DIGIT, fault=_one_length(lengths.off_by(1.0))),
    "length_10cm": replace(_DIGIT, fault=_one_length(lengths.off_by(0.1))),
    "length_20cm": replace(_DIGIT, fault=_one_length(lengths.off_by(0.2))),
    "length_transposed": replace(_DIGIT, fault=_one_length(lengths.transposed)),
    "length_other_ends": replace(_DIGIT, fault=lengths.other_ends, exact=_set("line-other-ends")),
    "lengths_exchanged": replace(
        _DIGIT, fault=lengths.readings_exchanged, exact=_set("lines-exchanged")
    ),
    "lengths_in_feet": _ALL_FEET,
    "lengths_2_percent": replace(_FACTOR, fault=partial(lengths.all_lengths, factor=1.02)),
    "lengths_5_percent": replace(_FACTOR, fault=partial(lengths.all_lengths, factor=1.05)),
    "lengths_10cm": replace(_OFFSET, fault=partial(lengths.all_lengths, offset_m=0.1)),
    "lengths_20cm": replace(_OFFSET, fault=partial(lengths.all_lengths, offset_m=0.2)),
    "tape_1": _under("tape_1", _FACTOR),
    "length_twice": Case(fault=lengths.length_twice, exact=_set("line-duplicate")),
}
_PHOTOS = {
    "photo_zoomed": replace(_OTHER_CAMERA, fault=partial(faults.other_zoom, photos=1, zoom=1.3)),
    "photos_zoomed": replace(_OTHER_CAMERA, fault=partial(faults.other_zoom, photos=2, zoom=1.3)),
    "two_other_photos": _under("two_other_photos", _OTHER_CAMERA),
    "photo_mirrored": Case(
        fault=partial(faults.turned_photo, turn=faults.mirrored), exact=_set("photo-mirrored")
    ),
    "photo_upside_down": replace(
        _TURNED, fault=partial(faults.turned_photo, turn=faults.upside_down)
    ),
    "photo_quarter_turn": replace(
        _TURNED, fault=partial(faults.turned_photo, turn=faults.quarter_turn)
    ),
    "photo_elsewhere": Case(fault=faults.other_place, exact=_set("photo-elsewhere")),
    "photo_twice": Case(
        fault=faults.photo_twice, exact=_set("photo-duplicate", "photo-saved-anew")
    ),
}
_FLIGHT = {
    "gimbal_tilt_10": replace(
        _GIMBAL, fault=partial(faults.gimbal_turned, roll_pitch_yaw_deg=(0.0, 10.0, 0.0))
    ),
    "gimbal_yaw_90": replace(
        _GIMBAL, fault=partial(faults.gimbal_turned, roll_pitch_yaw_deg=(0.0, 0.0, 90.0))
    ),
    "gimbal_yaw_180": replace(
        _GIMBAL, fault=partial(faults.gimbal_turned, roll_pitch_yaw_deg=(0.0, 0.0, 180.0))
    ),
    "clock_2s": replace(_CLOCK, fault=partial(faults.clock_late, by_s=2.0)),
    "clock_5s": replace(_CLOCK, fault=partial(faults.clock_late, by_s=5.0)),
    "gps_jump_3m": _under("gps_jump_3m", _STEP),
    "gps_jump_10m": _under("gps_jump_10m", _STEP),
}
_WORLD = {
    "rough_10cm": _under("rough_10cm", _RELIEF),
    "bank_1m": _under("bank_1m", replace(_RELIEF, also=_set("point-off-ground"))),
    "crown_2": _under("crown_2", _RELIEF),
    "slope_break_4": _under("slope_break_4", _RELIEF),
    "slope_5deg": _under("slope_5deg", Case(learnt=learnt_slope, must=True)),
    "shutter_40": _under("shutter_40", _SHUTTER),
    "shutter_60": _under("shutter_60", _SHUTTER),
    "shutter_40_plane": _under("shutter_40_plane", _SHUTTER),
    "zoom_1.3": _under("zoom_1.3", Case(exact=_set("other-zoom"), must=True)),
    "zoom_1.1": _under("zoom_1.1", Case(exact=_set("other-zoom"), must=True)),
}
_WITHOUT_LOG = {
    f"{name}_no_log": replace(case, condition=_NO_LOG)
    for name, case in (_LABELS | _LENGTHS).items()
    if name in {"labels_swapped", "length_in_feet", "length_1m", "lengths_in_feet", "pick_60px"}
}
_UNTAPED = {
    f"{name}_untaped": replace(case, fault=partial(lengths.untaped, fault=case.fault))
    for name, case in _FLIGHT.items()
}
_WELL = {
    "clean": Case(),
    "clean_prior": _under("clean_prior", Case()),
    "clean_dense": Case(condition=replace(CLEAN, picked_share=1.0)),
    "clean_no_log": Case(condition=_NO_LOG),
    "clean_untaped": Case(fault=partial(lengths.untaped, fault=faults.none)),
}

CASES: Mapping[str, Case] = MappingProxyType(
    _WELL | _LABELS | _LENGTHS | _PHOTOS | _FLIGHT | _UNTAPED | _WORLD | _WITHOUT_LOG
)
"""By their names on the command line."""
RIGHT: Mapping[str, frozenset[str]] = MappingProxyType(
    {name: case.exact | case.also for name, case in CASES.items()}
)
"""Codes that name a case rightly."""

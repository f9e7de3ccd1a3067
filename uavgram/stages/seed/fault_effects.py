"""Effects of faults in a flight log: affected frames, and messages.

A jump does not show which side of it is right. The side with the most photos keeps its sigmas; for
every other side the size of the jump is added to each frame's own variance. The common errors of
all frames (the biases of the flight) have to cover the other case, so their sigmas are enlarged by
as much.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from uavgram.model.arrays import Bools, Floats
from uavgram.model.flight_log import FaultKind, FlightEvidence, LogFault
from uavgram.model.frames import Frames
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import join_names

Faults = Sequence[LogFault]
_UNKNOWN_RAD = np.pi


class FreedPriors(NamedTuple):
    """Variances to add.

    Attributes
    ----------
    position
        (N, 3) of each frame, east, north, up [m²].
    attitude
        (N, 3) of each frame, about east, north, up [rad²].
    position_bias
        (3,) of the flight [m²].
    heading_bias
        Of the flight [rad²].
    """

    position: Floats
    attitude: Floats
    position_bias: Floats
    heading_bias: float

    @property
    def frames(self) -> Bools:
        """Mask (N,) of frames with added variances."""
        return np.asarray((self.position > 0).any(axis=1) | (self.attitude > 0).any(axis=1))


def free_priors(faults: Faults, time_s: Floats, unsure_s: Floats) -> FreedPriors:
    """Compute the variances that faults of a log add to N frames.

    Horizontal directions are treated alike: the size of a jump is known, but not which of the
    places before and after it is right.

    Parameters
    ----------
    faults
        Faults in the order of time.
    time_s
        (N,) instants of the frames.
    unsure_s
        (N,) possible errors of the instants: so near a jump, a frame may be on its other side.
    """
    jumps, turns = (
        [f for f in faults if f.kind == kind] for kind in ("position-jump", "attitude-jump")
    )
    position, position_bias = _compute_jump_variances(jumps, time_s, unsure_s)
    turned, turned_bias = _compute_jump_variances(turns, time_s, unsure_s)
    for fault in faults:
        if fault.is_jump:
            continue
        inside = (time_s >= fault.start_s - unsure_s) & (time_s <= fault.end_s + unsure_s)
        part = turned if fault.is_of_attitude else position
        part[inside] += _square(np.array(fault.change))
    turned = np.minimum(turned, _UNKNOWN_RAD**2)
    return FreedPriors(position, turned, position_bias, float(min(turned_bias[2], _UNKNOWN_RAD**2)))


def find_unsure_s(frames: Frames) -> Floats:
    """Return possible errors (N,) of the instants of the matched frames: three sigmas."""
    own_s = np.nan_to_num(frames.sigma_time_s[frames.matched], nan=0.0)
    return np.asarray(3.0 * np.hypot(own_s, frames.clock_offset_sigma_s))


def _compute_jump_variances(
    jumps: Faults, time_s: Floats, unsure_s: Floats
) -> tuple[Floats, Floats]:
    """Return variances (N, 3) of frames off the most common level, and the largest (3,)."""
    level = np.zeros((len(time_s), 3))
    between = np.zeros((len(time_s), 3))
    side = np.zeros(len(time_s), dtype=np.int64)
    for jump in jumps:
        behind = time_s >= jump.end_s
        level[behind] += jump.change
        side[behind] += 1
        # During the jump the interpolated path may be wrong by the whole jump.
        during = (time_s > jump.start_s - unsure_s) & (time_s < jump.end_s + unsure_s)
        between[during] += _square(np.array(jump.change))
    if not len(time_s) or not jumps:
        return between, np.zeros(3)
    most = int(np.bincount(side).argmax())
    off = _square(level - level[side == most][0])
    return off + between, (off + between).max(axis=0)


def _square(change: Floats) -> Floats:
    """Compute squares (..., 3), with that of the horizontal size for both horizontal axes."""
    horizontal = np.sum(change[..., :2] ** 2, axis=-1)
    return np.stack([horizontal, horizontal, change[..., 2] ** 2], axis=-1)


_RESET = "estimator-reset"
_LOOK = (
    "Pick points that these photos share with the others, and known lengths or points in them, or "
    "leave them out."
)


def report_faults(faults: Faults, evidence: FlightEvidence, frames: Frames) -> Iterator[Message]:
    """Report each fault, with the photos whose log prior it weakens.

    Also report resets by the autopilot amid the photos without any trace in the track.

    Parameters
    ----------
    faults
        Faults in the order of time.
    evidence
        Evidence with the stated resets.
    frames
        Frames, of which the matched ones have an instant.
    """
    for code in dict.fromkeys(fault.kind for fault in faults):
        alike = [fault for fault in faults if fault.kind == code]
        freed = _list_freed_frames(alike, frames)
        for k, fault in enumerate(alike):
            # Photos affected by jumps follow from all jumps together.
            last = k == len(alike) - 1
            own = freed if fault.is_jump else _list_freed_frames([fault], frames)
            effect = _effect(own) if last or not fault.is_jump else ""
            where = _where(fault.start_s, fault.end_s, frames)
            several = MessagePlural(
                _OPENINGS[code], f"{_size(fault)} {where}", ending=_effect(freed).strip()
            )
            text = f"{_describe_fault(fault)} {where}.{_describe_resets(fault)}{effect}"
            yield Message("warning", f"log-{code}", text, frames=own, several=several)
    yield from _report_untraced_resets(faults, evidence, frames)


_OPENINGS: dict[FaultKind, str] = {
    "position-jump": "The log's position jumps {count} times",
    "attitude-jump": "The log's attitude jumps {count} times",
    "position-frozen": "The log's position is frozen {count} times while the vehicle flies on",
    "attitude-frozen": "The log repeats one and the same attitude {count} times",
    "position-gap": "The log states no position {count} times while photos were taken",
    "attitude-gap": "The log states no attitude {count} times while photos were taken",
    "gimbal-gap": "The log states no gimbal direction {count} times while photos were taken",
    "receiver-apart": ("The log's position differs from the GPS receiver's own, {count} times"),
}
"""Opening of the message on several faults of a kind."""


def _describe_fault(fault: LogFault) -> str:
    """Describe the fault, as the beginning of a sentence."""
    size = _size(fault)
    return {
        "position-jump": f"The log's position jumps {size}",
        "attitude-jump": f"The log's attitude jumps {size}",
        "position-frozen": (
            f"The log's position is frozen {size} while the vehicle flies on by "
            f"{fault.horizontal:.1f} m"
        ),
        "attitude-frozen": f"The log repeats one and the same attitude {size}",
        "position-gap": f"The log states no position {size} while photos were taken",
        "attitude-gap": f"The log states no attitude {size} while photos were taken",
        "gimbal-gap": f"The log states no gimbal direction {size} while photos were taken",
        "receiver-apart": (f"The log's position differs {size} from the GPS receiver's own"),
    }[fault.kind]


def _size(fault: LogFault) -> str:
    """Return ``by 3.0 m``, ``for 2.6 s``."""
    along, up = fault.horizontal, abs(fault.change[2])
    tilt, yaw = np.degrees([along, up])
    if fault.kind == "position-jump":
        return "by " + _larger_part((along, "{:.1f} m"), (up, "{:.1f} m in height"))
    if fault.kind == "attitude-jump":
        return "by " + _larger_part(
            (tilt, "{:.0f} degrees of tilt"), (yaw, "{:.0f} degrees of heading")
        )
    if fault.kind == "receiver-apart":
        return f"by up to {along:.1f} m"
    return f"for {fault.end_s - fault.start_s:.1f} s"


def _larger_part(one: tuple[float, str], other: tuple[float, str]) -> str:
    """Join two parts of a jump, each with its format; omit a part below a fifth of the other."""
    largest = max(one[0], other[0])
    return " and ".join(form.format(size) for size, form in (one, other) if size >= 0.2 * largest)


def _where(start_s: float, end_s: float, frames: Frames) -> str:
    """Return ``between photo a.jpg and b.jpg (10:03:12 UTC)``."""
    order = [k for k in np.argsort(frames.time_utc_s) if frames.matched[k]]
    before = [frames.frame_id[k] for k in order if frames.time_utc_s[k] <= start_s]
    after = [frames.frame_id[k] for k in order if frames.time_utc_s[k] >= end_s]
    if before and after:
        place = f"between photo {before[-1]} and {after[0]}"
    elif after or before:
        place = f"before photo {after[0]}" if after else f"after photo {before[-1]}"
    else:
        place = "around all photos"
    return f"{place} ({_clock(start_s)} UTC)"


def _clock(time_s: float) -> str:
    return f"{datetime.fromtimestamp(time_s, UTC):%H:%M:%S}"


def _describe_resets(fault: LogFault) -> str:
    noted = " and ".join(fault.resets)
    return f" The autopilot itself noted then: {noted}." if noted else ""


def _list_freed_frames(faults: list[LogFault], frames: Frames) -> tuple[str, ...]:
    matched = np.flatnonzero(frames.matched)
    freed = free_priors(faults, frames.time_utc_s[matched], find_unsure_s(frames)).frames
    return tuple(frames.frame_id[k] for k in matched[freed])


def _effect(names: tuple[str, ...]) -> str:
    """Describe the effect on photos, and the action."""
    if not names:
        return " No photo depends on that, so nothing was changed."
    return (
        f" So the log's sigmas are larger in {len(names)} of the photos ({join_names(names)}), "
        f"and their picks place them. {_LOOK}"
    )


def _report_untraced_resets(
    faults: Faults, evidence: FlightEvidence, frames: Frames
) -> Iterator[Message]:
    times = frames.time_utc_s[frames.matched]
    traced = {what for fault in faults for what in fault.resets}
    untraced: dict[str, float] = {}
    for time, what in evidence.resets:
        if len(times) and times.min() < time < times.max() and what not in traced:
            untraced.setdefault(what, time)
    for what, time in untraced.items():
        text = (
            f"The autopilot noted a {what} {_where(time, time, frames)}; positions and attitudes "
            "in the log show no jump there, so nothing was changed."
        )
        yield Message("info", _RESET, text)

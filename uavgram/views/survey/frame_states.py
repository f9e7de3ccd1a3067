"""State of each frame, in one word."""

from __future__ import annotations

from collections import Counter
from typing import Literal

from uavgram.model.naming import counted
from uavgram.model.result.result import Result
from uavgram.views.survey.verdict import named_picks
from uavgram.views.formatting import FRAME_STATE_WORDS

FrameState = Literal["refined", "check", "seeded", "unmatched", "rejected"]


def frame_states(result: Result) -> tuple[FrameState, ...]:
    """Return the (F,) status of each frame; ``check`` if a refined frame deserves a second look.

    That is the case if one of its picks is suspect or was removed, if a reason of the verdict names
    it with a pick, or if the log contradicts its pose.
    """
    odd = {
        image
        for image, status in zip(result.picks.image, result.picks.status, strict=True)
        if status in ("suspect", "removed")
    }
    odd |= {image for image, _ in named_picks(result.verdict)}
    odd |= {name for m in result.messages if m.code == "telemetry-strained" for name in m.frames}
    return tuple(
        "check" if status == "refined" and name in odd else status
        for name, status in zip(result.frames.frame_id, result.frames.status, strict=True)
    )


def frame_counts(result: Result) -> str:
    """Count the frames: ``20 photos: 17 refined (1 to check), 1 rejected``, or none rejected."""
    status, states = Counter(result.frames.status), Counter(frame_states(result))
    check = f" ({states['check']} {FRAME_STATE_WORDS['check']})" if states["check"] else ""
    parts = [f"{status['refined']} refined{check}"]
    parts += [
        f"{status[one]} {FRAME_STATE_WORDS[one]}"
        for one in ("seeded", "unmatched", "rejected")
        if status[one]
    ]
    if not status["rejected"]:
        parts.append("none rejected")
    return f"{counted(len(result.frames.frame_id), 'photo')}: {', '.join(parts)}"

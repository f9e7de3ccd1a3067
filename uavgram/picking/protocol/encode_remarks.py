"""Remarks on an adjustment as JSON: short and detailed text, their subjects and remedies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from uavgram.model.message import Message
from uavgram.model.observations import KnownLines
from uavgram.model.result.reliability import Reason
from uavgram.model.result.tables import PickResults
from uavgram.picking.protocol import messages as m
from uavgram.picking.protocol.encode_remedies import remedies_json
from uavgram.stages.judge.verdict import make_reason

NOTHING = Reason(cause="", text="")


@dataclass(frozen=True)
class Remarks:
    """Survey to which remarks refer.

    Attributes
    ----------
    picks
        Fit of each pick.
    lines
        Known lengths as adjusted.
    index
        Numbers of the photos by name.
    """

    picks: PickResults
    lines: KnownLines
    index: Mapping[str, int]

    def of_message(self, message: Message) -> m.Remark:
        """Encode a warning that is no reason of the verdict."""
        return self.json(make_reason(message), message)

    def json(self, reason: Reason, at_length: Message | None = None) -> m.Remark:
        """Encode a reason of the verdict.

        Parameters
        ----------
        reason
            The reason.
        at_length
            Message that describes it with its statistics, if there is one.
        """
        return {
            "level": at_length.level if at_length else "warning",
            "code": reason.cause,
            "text": at_length.text if at_length else reason.text,
            "plain": reason.plain or reason.text,
            "labels": list(reason.labels),
            "frames": [self.index[name] for name in reason.frames if name in self.index],
            "lengths": list(reason.lengths),
            "measurements": list(reason.measurements),
            "mends": remedies_json((reason.mend, *reason.instead), self.lines, self.index),
            "show": self._show(reason),
        }

    def _show(self, reason: Reason) -> m.PhotoLabel | None:
        """Return the worst-fitting of the picks that a reason names; None if it names none.

        For a length, in a photo that shows both ends, if there is one: the length is drawn there.
        """
        frames, ends = set(reason.frames), self._ends(reason)
        labels = set(reason.labels) | ends
        if not frames and not labels:
            return None
        frames = frames or self._photos_of(ends)
        worst: m.PhotoLabel | None = None
        size = -1.0
        for row, (image, label) in enumerate(zip(self.picks.image, self.picks.label, strict=True)):
            named = (not frames or image in frames) and (not labels or label in labels)
            if not named or image not in self.index:
                continue
            off = math.hypot(*self.picks.residual_px[row].tolist())
            # A pick that was left out has no residual; show it first.
            off = off if math.isfinite(off) else math.inf
            if off > size:
                worst, size = {"image": self.index[image], "label": label}, off
        return worst

    def _ends(self, reason: Reason) -> set[str]:
        """Return the end labels of the lengths that a reason names."""
        rows = [i for i, name in enumerate(self.lines.name) if name in reason.lengths]
        return {one for i in rows for one in (self.lines.start[i], self.lines.end[i])}

    def _photos_of(self, labels: set[str]) -> set[str]:
        """Return the photos in which all of some labels are picked."""
        seen: dict[str, set[str]] = {}
        for image, label in zip(self.picks.image, self.picks.label, strict=True):
            seen.setdefault(image, set()).add(label)
        return {image for image, here in seen.items() if labels and labels <= here}

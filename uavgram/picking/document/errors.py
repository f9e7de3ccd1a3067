"""Error for a message of the page that cannot be carried out."""

from __future__ import annotations

from uavgram.errors import UavgramError


class RefusedError(UavgramError):
    """Message whose content or request is impossible; the page shows the reason.

    Attributes
    ----------
    seq
        Sequence number of the message, if it could be read.
    """

    seq: int | None = None

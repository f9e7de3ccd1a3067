"""A message of the page that cannot be done, and why."""

from __future__ import annotations

from uavgram.errors import UavgramError


class RefusedError(UavgramError):
    """A message that says or asks for something impossible; the page shows why.

    Attributes
    ----------
    seq
        The message's own number, as far as it could be read.
    """

    seq: int | None = None

"""What the program has to say beside the numbers: never a silent guess."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Message:
    """One remark for the user; it goes to results.json, to the report and on screen.

    Attributes
    ----------
    level
        ``info``: a choice that was made; ``warning``: look at this; ``error``: something that was
        asked for could not be computed.
    code
        Stable, machine-readable, kebab-case: ``label-unseen``, ``frame-unmatched``...
    text
        One sentence or two: what, where, and what to do.
    """

    level: Literal["info", "warning", "error"]
    code: str
    text: str

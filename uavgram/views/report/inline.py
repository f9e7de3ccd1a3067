"""A picture inside a page."""

from __future__ import annotations

import base64
from dataclasses import dataclass


@dataclass(frozen=True)
class Inline:
    """A picture as an address that holds it; no text, in which lengths would be sought."""

    jpeg: bytes

    def __html__(self) -> str:
        return f"data:image/jpeg;base64,{base64.b64encode(self.jpeg).decode()}"

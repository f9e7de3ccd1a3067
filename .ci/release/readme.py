"""The README as the description of the package: no link in it may be dead where it is shown."""

from __future__ import annotations

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

ADDRESS = ""
"""Of a release's files, with ``{version}``; empty: the project has no public address yet."""


class Readme(MetadataHookInterface):
    """Hatchling asks it for what pyproject.toml calls dynamic."""

    def update(self, metadata: dict[str, object]) -> None:
        """Add the description."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        shown = described(text, ADDRESS.format(version=metadata["version"]))
        metadata["readme"] = {"content-type": "text/markdown", "text": shown}


def described(text: str, address: str) -> str:
    """Return the README with absolute links; without an address, with no relative link at all.

    Parameters
    ----------
    text
        The README.
    address
        Of the folder that its relative links begin at; empty: there is none.
    """
    text = re.sub(r"<!--.*?-->\n", "", text)
    if address:
        return re.sub(r"\]\((?!https?://|#)", f"]({address.rstrip('/')}/", text)
    text = re.sub(r"!\[[^\]]*\]\((?!https?://)[^)]*\)\n*", "", text)
    return re.sub(r"\[([^\]]*)\]\((?!https?://|#)[^)]*\)", r"\1", text)

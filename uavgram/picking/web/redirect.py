"""A file that leads the browser to the page: its command line, which others can read, has no key.

The page's address holds a token. Given to the browser as an argument it would stand in the list of
processes; so the browser is given a file that only its own user can read.
"""

from __future__ import annotations

import html
import os
import shutil
import tempfile
from pathlib import Path


class RedirectFile:
    """A file of this user alone that leads to an address, until it is removed.

    Parameters
    ----------
    address
        Where it leads.

    Attributes
    ----------
    uri
        What to open.
    """

    def __init__(self, address: str) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="uavgram-"))  # mode 0700
        path = self._folder / "open.html"
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(leading_to(address))
        self.uri = path.as_uri()

    def remove(self) -> None:
        """Remove it; it may be gone already."""
        shutil.rmtree(self._folder, ignore_errors=True)


def leading_to(address: str) -> str:
    """A document that leads on at once."""
    return (
        '<!doctype html><meta charset="utf-8"><title>uavgram pick</title>'
        f'<meta http-equiv="refresh" content="0;url={html.escape(address)}">\n'
    )

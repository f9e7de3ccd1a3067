"""Documents beside the page: a redirect to it, and an explanation of refused access.

The page's address holds a token, and other users can read command lines in the list of processes;
so the browser is given a file that only its own user can read.
"""

from __future__ import annotations

import html
import os
import shutil
import tempfile
from pathlib import Path

from uavgram.io.files import open_own


class RedirectFile:
    """File readable by this user alone that redirects to an address, until it is removed.

    Parameters
    ----------
    address
        Target of the redirect.

    Attributes
    ----------
    uri
        Address of the file, to be opened.
    """

    def __init__(self, address: str) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="uavgram-"))  # mode 0700
        path = self._folder / "open.html"
        handle = open_own(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(make_redirect(address))
        self.uri = path.as_uri()

    def remove(self) -> None:
        """Remove the file, if it still exists."""
        shutil.rmtree(self._folder, ignore_errors=True)


def make_redirect(address: str) -> str:
    """Return a document that redirects at once."""
    return (
        '<!doctype html><meta charset="utf-8"><title>uavgram pick</title>'
        f'<meta http-equiv="refresh" content="0;url={html.escape(address)}">\n'
    )


def make_refusal(why: str) -> str:
    """Return a document that explains how to get an address with a valid token."""
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8"><title>uavgram pick</title>'
        '<meta name="color-scheme" content="light dark">'
        f"<h1>This page needs a fresh address</h1><p>{html.escape(why)} Nothing is lost.</p>"
        "<p>Start uavgram once more, the same way as before: by its icon on the desktop, or by "
        "<code>uavgram</code> in a terminal. While the first one runs, that opens the page in a "
        "new tab, as it was left.</p></html>\n"
    )

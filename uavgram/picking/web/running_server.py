"""Running servers of this user: a second start, as after a lost tab, leads to the first one.

Each server keeps a locked file with its port and a secret in a folder that only its user can read.
A request with the secret is answered with an address that has a token for one browser. If the file
is not locked, its server was killed, and another program may use the port.

The browser is started with a file instead of the page's address: the address has a token, and other
users can read command lines in the list of processes.
"""

from __future__ import annotations

import contextlib
import html
import http.client
import json
import logging
import os
import re
import shutil
import socket
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from urllib.parse import quote

from platformdirs import user_state_path

from uavgram.errors import UavgramError
from uavgram.io.files import open_own, read_own
from uavgram.io.outputs import FileLock, is_locked

log = logging.getLogger(__name__)

PATH = "/fresh-address"
LASTS_S = 300.0
"""Lifetime of a fresh address [s]: the user has just asked for it."""

WAITS, USED = "waits", "used"
BROWSER_COMES_WITHIN_S = 30.0
STARTS_WITHIN_S = 60.0
"""Longest wait for another start [s], which may have to read a large project."""

_ANSWERED_AFTER_S = 10.0
_LOOK_EVERY_S = 0.1
_SUFFIX = ".door"
_FRESH = re.compile(r"(/(?:door)?)\?token=([\w-]{43})", re.ASCII)  # 32 bytes, see `guard.Tokens`


@dataclass(frozen=True)
class ServerAddress:
    """Port of a running server, and the secret for a fresh address.

    Attributes
    ----------
    port
        Port on this machine.
    secret
        Secret in the file.
    """

    port: int
    secret: str


def servers_folder() -> Path:
    """Return the folder of this user in which running servers leave their files."""
    return user_state_path("uavgram", appauthor=False)


def _prefix_of_machine() -> str:
    """Return the beginning of the names of the files: several machines may share a home."""
    return re.sub(r"\W", "_", socket.gethostname()) + "-"


@contextlib.contextmanager
def announce_server(door: ServerAddress) -> Iterator[None]:
    """Keep a file with port and secret, for this user alone, while the server listens."""
    held = None
    try:
        folder = _make_folder(servers_folder())
        held = FileLock(folder / f"{_prefix_of_machine()}{door.port}{_SUFFIX}")
        held.write(json.dumps(asdict(door)))
    except (OSError, RuntimeError, UavgramError) as fault:  # the page works without it
        log.warning("a second start will not find this page (%s)", type(fault).__name__)
    try:
        yield
    finally:
        if held is not None:
            held.release()


@contextlib.contextmanager
def wait_for_other_start() -> Iterator[None]:
    """Wait until another start of this user has left its file, as after a double click."""
    held = None
    latest = time.monotonic() + STARTS_WITHIN_S
    while held is None and time.monotonic() < latest:
        try:
            held = FileLock(_make_folder(servers_folder()) / f"{_prefix_of_machine()}start.lock")
        except BlockingIOError:
            time.sleep(_LOOK_EVERY_S)
        except (OSError, UavgramError) as fault:  # it works without it
            log.info("starts at the same moment are not noticed: %s", fault)
            break
    try:
        yield
    finally:
        if held is not None:
            held.release()


def _make_folder(folder: Path) -> Path:
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    return folder


@dataclass(frozen=True)
class FreshAddress:
    """Address for one browser.

    Attributes
    ----------
    door
        The server.
    way
        Path on the server.
    token
        Token in the address.
    """

    door: ServerAddress
    way: str
    token: str

    @property
    def text(self) -> str:
        """Address to open in a browser."""
        return address(self.door.port, self.token, self.way)

    def wait_until_used(self) -> None:
        """Wait until a browser has used the address, the server has ended, or the time is over."""
        latest = time.monotonic() + BROWSER_COMES_WITHIN_S
        while _ask(self.door, {"X-Token": self.token}) == WAITS and time.monotonic() < latest:
            time.sleep(_LOOK_EVERY_S)


def request_address(
    wanted: Path | None, may_change: Callable[[ServerAddress], bool] = lambda _: True
) -> FreshAddress | None:
    """Ask the running servers of this user for an address; None if there is none.

    Parameters
    ----------
    wanted
        Project file or folder to show; None: what a page shows now. The server that has the project
        open comes first; another one leads to its start page, which opens the project.
    may_change
        Returns whether a server that does not have it open is asked, too.
    """
    doors = list(_doors())
    path = {} if wanted is None else {"X-Wanted": quote(os.fsencode(wanted.resolve()))}
    asked = [(door, {**path, "X-Only": "open"}) for door in doors if wanted is not None]
    asked += [(door, path) for door in doors if may_change(door)]
    for door, headers in asked:
        if found := _FRESH.fullmatch(_ask(door, headers)):
            return FreshAddress(door, *found.groups())
    return None


def address(port: int, token: str, way: str = "/") -> str:
    """Return the address to open in a browser.

    Parameters
    ----------
    port, token
        Of the server, and valid once.
    way
        Path on the server.
    """
    return f"http://127.0.0.1:{port}{way}?token={token}"


def _doors() -> Iterator[ServerAddress]:
    """Yield the running servers of this user on this machine; remove what killed ones left."""
    for path in sorted(servers_folder().glob(f"{_prefix_of_machine()}*{_SUFFIX}")):
        if not is_locked(path):
            with contextlib.suppress(OSError):
                path.unlink()
            continue
        try:
            match json.loads(read_own(path)):
                case {"port": int(port), "secret": str(secret)}:
                    yield ServerAddress(port, secret)
        except (OSError, ValueError, UavgramError):
            continue


def _ask(door: ServerAddress, more: dict[str, str]) -> str:
    """Return the server's answer; empty if there is none."""
    line = http.client.HTTPConnection("127.0.0.1", door.port, timeout=_ANSWERED_AFTER_S)
    with contextlib.closing(line):
        try:
            line.request("POST", PATH, headers={"X-Secret": door.secret, **more})
            answer = line.getresponse()
            return answer.read(1000).decode("ascii") if answer.status == 200 else ""
        except (OSError, ValueError, http.client.HTTPException):
            return ""


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
        "<style>body { margin: 12vh auto; max-width: 620px; padding: 0 24px; color: #e8eaed; "
        "background: #1c2025; font: 16px/1.5 system-ui, sans-serif; } h1 { font-size: 22px; }"
        "</style>"
        '<link rel="icon" href="data:,">'  # or the browser would ask for one, and be refused again
        f"<h1>This page needs a fresh address</h1><p>{html.escape(why)} Nothing is lost.</p>"
        "<p>Start uavgram once more, the same way as before: by its icon on the desktop, or by "
        "<code>uavgram</code> in a terminal. While the first one runs, that opens the page in a "
        "new tab, as it was left.</p></html>\n"
    )

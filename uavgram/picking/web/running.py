"""A fresh address from the server of an open project: for another browser, or a lost tab.

The server leaves a file in the project's output folder, beside its lock, which only its user can
read: its port, and a secret. A request with the secret gets a token for one browser.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import logging
import os
import re
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

from uavgram.config.project import load_project
from uavgram.errors import UavgramError
from uavgram.io.locks import LOCK, is_locked
from uavgram.io.own_files import check_own, open_own, read_own

log = logging.getLogger(__name__)

FILE = "pick.door"
PATH = "/fresh-address"
LASTS_S = 300.0
"""Lifetime of a fresh address [s]: the user has just asked for it."""

WAITS, USED = "waits", "used"
BROWSER_COMES_WITHIN_S = 30.0

_ANSWERED_AFTER_S = 10.0
_LOOK_EVERY_S = 0.1
_TOKEN = re.compile(r"[\w-]{43}", re.ASCII)  # 32 bytes, as made in tokens.py


@dataclass(frozen=True)
class Door:
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


@contextlib.contextmanager
def left_in(folder: Path, door: Door) -> Iterator[None]:
    """Keep a file with port and secret, for this user alone, while the server listens.

    Raises
    ------
    OutputError
        A link is in place of the file.
    """
    path = folder / FILE
    check_own(path)
    try:
        path.unlink(missing_ok=True)  # left by a server that was killed
        handle = open_own(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            json.dump(asdict(door), stream)
    except OSError as fault:  # the page works without it
        log.warning("%s: no fresh addresses while this runs (%s)", path, fault.strerror)
    try:
        yield
    finally:
        if _read(path) == door:  # leave the file of a later server
            path.unlink(missing_ok=True)


@dataclass(frozen=True)
class FreshAddress:
    """Address for one browser.

    Attributes
    ----------
    door
        The server.
    token
        Token in the address.
    """

    door: Door
    token: str

    @property
    def text(self) -> str:
        """Address to open in a browser."""
        return address(self.door.port, self.token)

    def wait_until_used(self) -> None:
        """Wait until a browser has used the address, the server has ended, or the time is over."""
        latest = time.monotonic() + BROWSER_COMES_WITHIN_S
        while _asked(self.door, {"X-Token": self.token}) == WAITS and time.monotonic() < latest:
            time.sleep(_LOOK_EVERY_S)


def fresh_address(project: Path) -> FreshAddress | None:
    """Ask the server that has a project open for an address; None if no server has.

    Parameters
    ----------
    project
        The project file, or its folder.

    Raises
    ------
    UavgramError
        The project file cannot be read.
    """
    folder = Path(load_project(project, unfinished=True).output)
    door = _read(folder / FILE)
    # Ignore the file of a killed server: another program may use its port by now.
    if door is None or not is_locked(folder / LOCK):
        return None
    token = _asked(door, {})
    return FreshAddress(door, token) if _TOKEN.fullmatch(token) else None


def address(port: int, token: str) -> str:
    """Return the address to open in a browser."""
    return f"http://127.0.0.1:{port}/?token={token}"


def _read(path: Path) -> Door | None:
    try:
        match json.loads(read_own(path)):
            case {"port": int(port), "secret": str(secret)}:
                return Door(port, secret)
    except (OSError, ValueError, UavgramError):
        pass
    return None


def _asked(door: Door, more: dict[str, str]) -> str:
    """Return the server's answer; empty if there is none."""
    line = http.client.HTTPConnection("127.0.0.1", door.port, timeout=_ANSWERED_AFTER_S)
    with contextlib.closing(line):
        try:
            line.request("POST", PATH, headers={"X-Secret": door.secret, **more})
            answer = line.getresponse()
            return answer.read(1000).decode("ascii") if answer.status == 200 else ""
        except (OSError, ValueError, http.client.HTTPException):
            return ""

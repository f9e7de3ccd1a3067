"""A fresh address from the server that has a project open: for another browser, or a lost tab.

The server leaves a file in the project's output folder, beside its lock, which only its user can
read: its port, and a secret. Who shows it the secret gets a token that lets one browser in.
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
"""How long a fresh address serves: somebody asked for it just now."""

WAITS, USED = "waits", "used"
BROWSER_COMES_WITHIN_S = 30.0

_ANSWERED_AFTER_S = 10.0
_LOOK_EVERY_S = 0.1
_TOKEN = re.compile(r"[\w-]{43}", re.ASCII)  # 32 bytes, as tokens.py makes them


@dataclass(frozen=True)
class Door:
    """Where a running server listens, and what it gives a fresh address for.

    Attributes
    ----------
    port
        On this machine.
    secret
        That of the file.
    """

    port: int
    secret: str


@contextlib.contextmanager
def left_in(folder: Path, door: Door) -> Iterator[None]:
    """A file that says where the server listens, for this user alone, as long as it does.

    Raises
    ------
    OutputError
        A link stands where the file should be.
    """
    path = folder / FILE
    check_own(path)
    try:
        path.unlink(missing_ok=True)  # of a server that was killed
        handle = open_own(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            json.dump(asdict(door), stream)
    except OSError as fault:  # the page works all the same
        log.warning("%s: no fresh addresses while this runs (%s)", path, fault.strerror)
    try:
        yield
    finally:
        if _read(path) == door:  # not that of a server that came after this one
            path.unlink(missing_ok=True)


@dataclass(frozen=True)
class FreshAddress:
    """An address that lets one browser in.

    Attributes
    ----------
    door
        Of the server.
    token
        In the address.
    """

    door: Door
    token: str

    @property
    def text(self) -> str:
        """What a browser is to open."""
        return address(self.door.port, self.token)

    def wait_until_used(self) -> None:
        """Wait until a browser has come, the server has gone, or it has taken too long."""
        latest = time.monotonic() + BROWSER_COMES_WITHIN_S
        while _asked(self.door, {"X-Token": self.token}) == WAITS and time.monotonic() < latest:
            time.sleep(_LOOK_EVERY_S)


def fresh_address(project: Path) -> FreshAddress | None:
    """Ask the server that has a project open for an address; None where none has it.

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
    # What a killed server left behind says nothing: its port may be somebody else's by now.
    if door is None or not is_locked(folder / LOCK):
        return None
    token = _asked(door, {})
    return FreshAddress(door, token) if _TOKEN.fullmatch(token) else None


def address(port: int, token: str) -> str:
    """What a browser is to open."""
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
    """What the server answers; empty where it gives nothing."""
    line = http.client.HTTPConnection("127.0.0.1", door.port, timeout=_ANSWERED_AFTER_S)
    with contextlib.closing(line):
        try:
            line.request("POST", PATH, headers={"X-Secret": door.secret, **more})
            answer = line.getresponse()
            return answer.read(1000).decode("ascii") if answer.status == 200 else ""
        except (OSError, ValueError, http.client.HTTPException):
            return ""

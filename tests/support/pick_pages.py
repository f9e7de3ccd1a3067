"""The picking page's server as a process of its own, and a page that talks to it.

Servers are forked from a process that has the program loaded, so that a test can kill many.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol
from urllib.parse import urlsplit

import cv2
import httpx
import numpy as np
from websockets import Origin
from websockets.sync.client import connect

Json = dict[str, Any]
WIDTH, HEIGHT = 640, 480
LONGEST_WAIT_S = 60.0

ask = partial(httpx.get, timeout=LONGEST_WAIT_S)
"""Ask a server for an address, and wait as long as it takes on a busy machine."""

CAMERA = f"""\
name: small
model: brown
width_px: {WIDTH}
height_px: {HEIGHT}
parameters: [600.0, 600.0, 319.5, 239.5, 0.0, 0.0, 0.0, 0.0, 0.0]
sigma: [3.0, 3.0, 3.0, 3.0, 0.01, 0.01, 0.0001, 0.0001, 0.01]
"""
PROJECT = """\
name: small
images: photos/*.jpg
camera: camera.yaml
picks: picks.csv
lines: lines.csv
measure: measure.csv
output: out
"""


def small_project(folder: Path, photos: int = 2) -> Path:
    """Two photos and a camera, nothing picked; returns the project file."""
    (folder / "photos").mkdir(parents=True)
    rng = np.random.default_rng(3)
    for k in range(photos):
        grass = rng.integers(60, 140, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / "photos" / f"P{k + 1}.jpg"), grass)
    (folder / "camera.yaml").write_text(CAMERA, encoding="utf-8")
    project = folder / "project.yaml"
    project.write_text(PROJECT, encoding="utf-8")
    return project


@cache
def _forking_process() -> subprocess.Popen[str]:
    """The process that forks servers; it ends with this one, as its input ends."""
    return subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("pick_forks.py"))],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )


class RefusedToStartError(Exception):
    """What `uavgram pick` would have refused with."""


class Server:
    """A server of a project's page, in its own process.

    Parameters
    ----------
    project
        The project file.
    save_after_s
        How long after the last change the tables are written.
    """

    def __init__(self, project: Path, save_after_s: float = 0.4) -> None:
        self.log = project.parent / "server.log"
        forking = _forking_process()
        asked = {"project": str(project), "log_file": str(self.log), "save_after_s": save_after_s}
        assert forking.stdin is not None
        assert forking.stdout is not None
        forking.stdin.write(json.dumps(asked) + "\n")
        forking.stdin.flush()
        answer = json.loads(forking.stdout.readline())
        self.pid: int = answer["pid"]
        if "refused" in answer:
            raise RefusedToStartError(answer["refused"])
        self.address: str = answer["address"]

    @property
    def origin(self) -> str:
        parts = urlsplit(self.address)
        return f"{parts.scheme}://{parts.netloc}"

    @property
    def is_alive(self) -> bool:
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        return True

    def strike(self) -> None:
        """Kill it as a crash does: nothing is saved, no message is sent."""
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def kill(self) -> None:
        """Kill it, and wait until it is gone."""
        self.strike()
        self._wait()

    def stop(self) -> None:
        """End it as Ctrl+C does."""
        if self.is_alive:
            os.kill(self.pid, signal.SIGINT)
        self._wait()

    def _wait(self) -> None:
        latest = time.monotonic() + LONGEST_WAIT_S
        while self.is_alive:
            if time.monotonic() > latest:
                self.strike()
                raise TimeoutError("the server did not end")
            time.sleep(0.005)


@contextmanager
def running(project: Path) -> Iterator[Server]:
    """A server that ends with the block."""
    server = Server(project)
    try:
        yield server
    finally:
        server.stop()


class Reachable(Protocol):
    """A server, in another process or in this one."""

    @property
    def address(self) -> str:
        """The address that is printed: it lets in once."""

    @property
    def origin(self) -> str: ...


class Entry(NamedTuple):
    """What lets a page in: the browser's cookie, and the key that its tab alone has."""

    cookie: str
    key: str

    def to(self, address: str) -> str:
        """The address with the key."""
        return f"{address}{'&' if '?' in address else '?'}tab={self.key}"


def entry_of(server: Reachable) -> Entry:
    """What the printed address is exchanged for."""
    return entry_by(ask(server.address, follow_redirects=False))


def entry_by(answer: httpx.Response) -> Entry:
    """What an answer brings that lets in."""
    assert answer.status_code == 303, answer.text
    way, _, key = answer.headers["location"].partition("#")
    assert way == "/"
    return Entry(answer.headers["set-cookie"].split(";")[0], key)


def browser_of(server: Reachable, entry: Entry) -> httpx.Client:
    """A tab of a browser that was let in."""
    return httpx.Client(
        base_url=server.origin,
        headers={"Cookie": entry.cookie},
        params={"tab": entry.key},
        timeout=LONGEST_WAIT_S,
    )


class Page:
    """A page that is open: it sends commands, and keeps the state that the server confirmed."""

    def __init__(self, server: Reachable, entry: Entry | None = None) -> None:
        self.entry = entry_of(server) if entry is None else entry
        netloc = urlsplit(server.origin).netloc
        self._open = ExitStack()
        self.socket = self._open.enter_context(
            connect(
                self.entry.to(f"ws://{netloc}/socket"),
                origin=Origin(server.origin),
                additional_headers={"Cookie": self.entry.cookie},
                open_timeout=LONGEST_WAIT_S,
                max_size=None,
                proxy=None,
            )
        )
        self.initial_state = self.until("initial-state")
        self.picks: dict[tuple[int, str], Json] = {
            (pick["image"], pick["label"]): pick for pick in self.initial_state["state"]["picks"]
        }
        self.lines = self.initial_state["state"]["lines"]
        self.measurements = self.initial_state["state"]["measurements"]
        self.seq = 0

    def close(self) -> None:
        self._open.close()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def send(self, kind: str, /, **fields: object) -> int:
        """Send a command without waiting for its answer."""
        self.seq += 1
        self.socket.send(json.dumps({"seq": self.seq, "t": kind, **fields}))
        return self.seq

    def read(self) -> Json:
        """The next message; what it confirms is taken over."""
        answer: Json = json.loads(self.socket.recv(timeout=LONGEST_WAIT_S))
        if answer["t"] == "changed":
            self._take(answer["diff"])
        return answer

    def until(self, kind: str, /, **wanted: object) -> Json:
        """The next message of a kind with these fields."""
        while True:
            answer = self.read()
            if answer["t"] == kind and all(answer.get(k) == v for k, v in wanted.items()):
                return answer

    def do(self, kind: str, /, **fields: object) -> Json:
        """Send a command and wait until it is confirmed or refused."""
        seq = self.send(kind, **fields)
        while True:
            answer = self.read()
            if (
                answer["t"] in {"changed", "refused", "snapped", "ground"}
                and answer.get("seq") == seq
            ):
                return answer

    @property
    def state(self) -> Json:
        """All that was confirmed, in one form."""
        return {
            "picks": [self.picks[key] for key in sorted(self.picks)],
            "lines": self.lines,
            "measurements": self.measurements,
        }

    def _take(self, diff: Json) -> None:
        for key in diff.get("picks", {}).get("gone", []):
            del self.picks[key[0], key[1]]
        for pick in diff.get("picks", {}).get("put", []):
            self.picks[pick["image"], pick["label"]] = pick
        self.lines = diff.get("lines", self.lines)
        self.measurements = diff.get("measurements", self.measurements)

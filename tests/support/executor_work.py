"""What workers do in tests: each function can be found by a process that is started afresh."""

from __future__ import annotations

import os
import signal
import threading
import time
from pathlib import Path

import distributed

from uavgram.errors import InputError


def squared(number: int) -> int:
    return number * number


def die_once(marker: str) -> str:
    """Be killed in the midst of it the first time."""
    path = Path(marker)
    if path.name.startswith("dies") and not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return path.name


def die(name: str) -> str:
    """Be killed each time, where the name says so."""
    if name == "poison":
        os.kill(os.getpid(), signal.SIGKILL)
    return name


def hold(megabytes: int) -> int:
    """Keep memory; the process that does."""
    _HELD.append(b"x" * (megabytes << 20))
    return os.getpid()


_HELD: list[bytes] = []


def need(megabytes: int) -> str:
    """Need memory for a moment."""
    try:
        bytearray(megabytes << 20)
    except MemoryError:
        return "refused"
    return "granted"


def threads(_: int) -> tuple[str, int]:
    """What libraries are told, and how many cores our own code takes."""
    from uavgram.pipeline.process_settings import cores

    return os.environ["OPENBLAS_NUM_THREADS"], cores()


def sleep_or_square(item: int | str) -> int | None:
    """Sleep, or not."""
    if isinstance(item, int):
        return squared(item)
    sleep_long(item)
    return None


def stop_or_square(item: int | str) -> int:
    """Stop for good, and say who did: no polite signal reaches a stopped process. Or do not."""
    if isinstance(item, str):
        Path(item).write_text(str(os.getpid()), encoding="ascii")
        os.kill(os.getpid(), signal.SIGSTOP)
        return 0
    return squared(item)


def sleep_long(marker: str) -> None:
    """Say who sleeps, then sleep; say so again when asked to end."""
    Path(marker).write_text(str(os.getpid()), encoding="ascii")
    try:
        time.sleep(60.0)
    finally:
        Path(marker).with_suffix(".ended").touch()


def fail_at_two(number: int) -> int:
    """Fail as a worker does that lacks something."""
    if number == 2:
        raise ValueError("two")
    return number * number


def misread(number: int) -> int:
    """Fail with an error that cannot be put together again from what is sent of it."""
    if number == 3:
        raise InputError("picks.csv", "is wrong", 7)
    return number


STOPPED = threading.Event()
"""Set once the work below began, of workers in this very process."""
HELD_BY: list[str] = []
GO_ON = threading.Event()


def hang_once(number: int) -> int:
    """Of the first item, the first time: wait, as a worker does that was stopped."""
    if number == 0 and not STOPPED.is_set():
        HELD_BY.append(distributed.get_worker().address)
        STOPPED.set()
        GO_ON.wait(60.0)
    return number

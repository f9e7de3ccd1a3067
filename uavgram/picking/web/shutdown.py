"""Orderly end of the page's server: on Ctrl+C, a system signal, or a closed terminal."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType

_KILLED = 128
"""Value that a shell adds to the number of the signal that ended a program."""


@contextlib.contextmanager
def shut_down_orderly() -> Iterator[None]:
    """Leave the enclosed block by an exception where a signal would end the program at once.

    uvicorn stops at SIGTERM, and then sends it again as if it had not caught it: by default that
    ends the program before anything is cleared away. At SIGHUP it does not even stop.
    """
    if threading.current_thread() is not threading.main_thread():  # it gets no signals
        yield
        return
    before = {signal.SIGTERM: signal.signal(signal.SIGTERM, _leave)}
    if sys.platform != "win32" and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:  # no nohup
        before[signal.SIGHUP] = signal.signal(signal.SIGHUP, _terminate)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave(number: int, _: FrameType | None) -> None:
    sys.exit(_KILLED + number)


def _terminate(_number: int, _: FrameType | None) -> None:
    signal.raise_signal(signal.SIGTERM)

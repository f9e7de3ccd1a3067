"""Ctrl+C at any moment: one line on standard error and status 130, never a traceback."""

from __future__ import annotations

import _thread
import atexit
import os
import signal
import sys
import threading
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

INTERRUPTED = 130
_AGAIN_AFTER_S = 0.01
_came = False
_status: int | None = None  # with which this process ends, once it is known


def has_come() -> bool:
    """Whether Ctrl+C came while this process was watched, whatever became of its exception."""
    return _came


def watch() -> None:
    """Note every Ctrl+C from now on: libraries may turn its exception into another one.

    Where Python can raise none, as at the end of an object's life, it is raised a moment later.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as by nohup
        signal.signal(signal.SIGINT, _interrupt)
        sys.unraisablehook = _again
        atexit.register(_leave)  # the first to be registered is the last to be called


def told(*, is_own_process: bool) -> int:
    """Say that the command was interrupted; from now on this process ends undisturbed."""
    if is_own_process:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    _say("earlier results are as they were")
    return _ending(INTERRUPTED)


def end(status: int) -> int:
    """The status with which a command that was not interrupted ends, unless Ctrl+C comes yet."""
    if signal.getsignal(signal.SIGINT) is _interrupt:
        # What went wrong was said, in a line of its own.
        signal.signal(signal.SIGINT, signal.SIG_IGN if status else _interrupt_end)
    return _ending(status)


def _ending(status: int) -> int:
    global _status  # noqa: PLW0603
    _status = status
    return status


def _leave() -> None:
    """End here: while Python takes its modules apart, a signal would end it without a word."""
    if _status is None:  # a bug, whose traceback is shown
        return
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):  # Python has a status of its own for that
        return
    os._exit(_status)


def _say(what: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"uavgram: interrupted; {what}\n")


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global _came  # noqa: PLW0603  (a process has one handler)
    _came = True
    raise KeyboardInterrupt


def _interrupt_end(_number: int, _frame: FrameType | None) -> None:
    """Nothing can be caught any more: Python puts things away."""
    _say("what was asked for was done already")
    os._exit(INTERRUPTED)


def _again(ignored: UnraisableHookArgs) -> None:
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        later = threading.Timer(_AGAIN_AFTER_S, _thread.interrupt_main)
        later.daemon = True
        later.start()
    else:
        sys.__unraisablehook__(ignored)

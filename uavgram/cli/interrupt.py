"""Handle Ctrl+C at any moment: one line on standard error and status 130, never a traceback."""

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
_interrupted = False
_status: int | None = None  # with which this process ends, once it is known


def was_interrupted() -> bool:
    """Return whether Ctrl+C came while this process was watched."""
    return _interrupted


def watch() -> None:
    """Record every Ctrl+C from now on: libraries may convert its exception to another one.

    Where Python cannot raise it, as at the end of an object's life, it is raised a moment later.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as by nohup
        signal.signal(signal.SIGINT, _interrupt)
        sys.unraisablehook = _interrupt_again
        atexit.register(_leave)  # the first to be registered is the last to be called


def report_interruption(words: str = "interrupted; earlier results are as they were") -> int:
    """Report in one line that the command was interrupted; return the status of the process."""
    sys.stderr.write(f"uavgram: {words}\n")
    return set_end_status(INTERRUPTED)


def set_end_status(status: int) -> int:
    """Set the status with which this process ends: from now on nothing is interrupted."""
    global _status  # noqa: PLW0603  (a process has one)
    _status = status
    return status


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    global _interrupted  # noqa: PLW0603
    _interrupted = True
    if _status is None:
        if not _is_ending():
            raise KeyboardInterrupt
        return
    if _status == 0:  # at the end of the process, nothing is caught any more
        sys.stderr.write("uavgram: interrupted; the command was done already\n")
        os._exit(INTERRUPTED)
    # Otherwise one line was written already.


def _is_ending() -> bool:
    """Return whether an earlier Ctrl+C is ending the command: nothing interrupts its tidying up."""
    handled = sys.exception()
    while handled is not None and not isinstance(handled, KeyboardInterrupt):
        handled = handled.__context__
    return handled is not None


def _leave() -> None:
    """End here: while Python unloads modules, a signal would end the process without a message."""
    if _status is None:  # a bug, whose traceback is shown
        return
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (AttributeError, OSError, ValueError):  # closed: Python has its own status for this
        return
    os._exit(_status)


def _interrupt_again(ignored: UnraisableHookArgs) -> None:
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        later = threading.Timer(_AGAIN_AFTER_S, _thread.interrupt_main)
        later.daemon = True
        later.start()
    else:
        sys.__unraisablehook__(ignored)

"""Handle Ctrl+C at any moment: one line on standard error and status 130, never a traceback."""

from __future__ import annotations

import _thread
import atexit
import os
import signal
import sys
import time
from contextlib import _GeneratorContextManager
from types import FrameType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

INTERRUPTED = 130
_AGAIN_AFTER_S = 0.01
_CONTEXT = {
    _GeneratorContextManager.__enter__.__code__,
    _GeneratorContextManager.__exit__.__code__,
}
_OWN_CODE = os.path.dirname(os.path.dirname(__file__))  # noqa: PTH120 (pathlib is slow to load)
_interrupted = False
_status: int | None = None  # with which this process ends, once it is known


def was_interrupted() -> bool:
    """Return whether Ctrl+C came while this process was watched."""
    return _interrupted


def watch() -> None:
    """Record every Ctrl+C from now on: libraries may convert its exception to another one.

    Where Python cannot raise it, as at the end of an object's life, it is raised a moment later;
    so it is while a context (``@contextmanager``) sets up or puts away, which would stay half done.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as by nohup
        signal.signal(signal.SIGINT, _interrupt)
        sys.unraisablehook = _interrupt_again
        atexit.register(_leave)  # the first to be registered is the last to be called


def report_interruption(words: str = "interrupted; no result is half written") -> int:
    """Report in one line that the command was interrupted; return the status of the process."""
    sys.stderr.write(f"uavgram: {words}\n")
    return set_end_status(INTERRUPTED)


def set_end_status(status: int) -> int:
    """Set the status with which this process ends: from now on nothing is interrupted."""
    global _status  # noqa: PLW0603  (a process has one)
    _status = status
    return status


def _interrupt(_number: int, frame: FrameType | None) -> None:
    global _interrupted  # noqa: PLW0603
    _interrupted = True
    if _status is None:
        if _is_ending():
            return
        if not _is_in_whole(frame):
            raise KeyboardInterrupt
        _interrupt_later()
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


def _is_in_whole(frame: FrameType | None) -> bool:
    """Return whether a context of this program is being set up or put away: that is done whole.

    Those of libraries are not known to end soon, and uvicorn's passes the signal on from there.
    """
    while frame is not None:
        if frame.f_code in _CONTEXT:
            context = frame.f_locals["self"]
            if context.gen.gi_code.co_filename.startswith(_OWN_CODE):
                return True
        frame = frame.f_back
    return False


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
        _interrupt_later()
    else:
        sys.__unraisablehook__(ignored)


def _interrupt_later() -> None:
    def wait() -> None:
        time.sleep(_AGAIN_AFTER_S)
        _thread.interrupt_main()

    _thread.start_new_thread(wait, ())  # takes none of the locks that the main thread may hold

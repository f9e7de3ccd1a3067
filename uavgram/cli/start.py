"""Start of a command: set up the process before its modules are loaded."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from uavgram.cli.interrupt import set_end_status, was_interrupted, watch


def start(arguments: Sequence[str] | None) -> int:
    """Set the process up, and run the command; return its exit status.

    Raises
    ------
    KeyboardInterrupt
        Ctrl+C came, even if its exception was converted to another one, or put off until the end.
    """
    if arguments is None:  # this process is ours alone
        _leave_ascii()
        watch()
    try:
        status = _run(arguments)
    except BaseException as fault:
        if was_interrupted():
            raise KeyboardInterrupt from fault
        raise
    if was_interrupted() and status == 0:  # it was put off, or a library caught it
        raise KeyboardInterrupt
    return set_end_status(status)


def _leave_ascii() -> None:
    """Start Python again in its UTF-8 mode if file names may have ASCII letters only.

    That is so with ``LC_ALL=C`` and ``PYTHONUTF8=0``: no path with an umlaut could be shown, or
    written into a result.
    """
    if sys.getfilesystemencoding() == "ascii":
        words = [sys.executable, "-X", "utf8", *sys.orig_argv[1:]]
        os.execv(sys.executable, words)  # noqa: S606 (the same program and arguments)


def _run(arguments: Sequence[str] | None) -> int:
    # Most matrices here are small: more threads wait for each other longer than they help. numpy's
    # library reads this when a command loads it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Photos are processed by own threads, as many as there are cores: those of OpenCV would
    # wait beside them, and waiting takes a core too. It reads this when it is loaded.
    os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")
    # OpenCV's messages on damaged photos refer to its source; own messages name the action.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    # pydantic searches every installed package for plugins; none is used.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if arguments is None:
        from uavgram.pipeline.process_settings import avoid_modules, collect_garbage_rarely

        avoid_modules()
        collect_garbage_rarely()
    from uavgram.cli.entry import run_command

    return run_command(arguments)

"""Where a command begins: the process is set up before what the command needs is loaded."""

from __future__ import annotations

import os
from collections.abc import Sequence

from uavgram.cli.interrupt import ending, has_come, watch


def begin(arguments: Sequence[str] | None) -> int:
    """Set the process up, and run the command; its exit status.

    Raises
    ------
    KeyboardInterrupt
        Ctrl+C came, whatever exception it was turned into on its way here.
    """
    if arguments is None:  # this process is ours alone
        watch()
    try:
        return ending(_run(arguments))
    except BaseException as fault:
        if has_come():
            raise KeyboardInterrupt from fault
        raise


def _run(arguments: Sequence[str] | None) -> int:
    # Most matrices here are small: more threads wait for each other longer than they help. numpy's
    # library reads this when a command loads it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Photos are looked at by threads of ours, as many as there are cores: those of OpenCV would
    # wait beside them, and waiting takes a core too. It reads this when it is loaded.
    os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")
    # Of damaged photos OpenCV speaks in terms of its own source; our messages say what to do.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    # pydantic asks every installed package whether it has a plugin for it; we use none.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if arguments is None:
        from uavgram.pipeline.own_process import load_little, seldom_look_for_cycles

        load_little()
        seldom_look_for_cycles()
    from uavgram.cli.entry import called

    return called(arguments)

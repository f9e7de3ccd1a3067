"""The Rerun viewer's program, kept from outliving whoever started it.

Run as a script, in a session of its own. Its standard input is a pipe that nobody writes to: it
ends when the process at the other end ends, in whatever way (kill -9 too), and then all of this
session ends.
"""

from __future__ import annotations

import os
import signal
import sys
import threading


def main() -> int:
    """Run the viewer with the arguments of this program; its exit status."""
    threading.Thread(target=_end_with_who_started, daemon=True).start()
    from rerun_cli.__main__ import main as rerun  # type: ignore[import-untyped]  # noqa: PLC0415

    return int(rerun())


def _end_with_who_started() -> None:
    while os.read(0, 1024):
        pass
    if sys.platform == "win32":
        os._exit(1)
    os.killpg(os.getpgrp(), signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main())

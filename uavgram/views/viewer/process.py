"""The Rerun viewer's program, kept from outliving the process that started it.

Run as a script. Its standard input is a pipe that nobody writes to: it is closed when the process
at the other end wants this to end, or has ended itself, in whatever way (kill -9 too).
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading

END_S = 5.0
"""Longest wait for the viewer's end, before it is killed."""


def main() -> int:
    """Run the viewer with the arguments of this program; its exit status."""
    import rerun_cli.__main__ as rerun  # type: ignore[import-untyped]  # noqa: PLC0415

    rerun.subprocess = _Started  # it runs the viewer by `subprocess.call`, whose process is ours
    return int(rerun.main())


class _Started:
    """What Rerun's start script uses of `subprocess`."""

    @staticmethod
    def call(command: list[str]) -> int:
        """Run a program until it ends, or until nobody wants it any more; its exit status."""
        with subprocess.Popen(command, stdin=subprocess.DEVNULL) as viewer:  # noqa: S603
            threading.Thread(target=_end_with_who_started, args=(viewer,), daemon=True).start()
            return viewer.wait()


def _end_with_who_started(viewer: subprocess.Popen[bytes]) -> None:
    while os.read(0, 1024):
        pass
    viewer.terminate()
    try:
        viewer.wait(END_S)
    except subprocess.TimeoutExpired:
        viewer.kill()


if __name__ == "__main__":
    sys.exit(main())

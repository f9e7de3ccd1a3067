"""Wrapper of the Rerun viewer's program, which ends it with the process that started it.

Run as a script. Its standard input is a pipe to which nothing is written: it is closed when the
process at the other end wants this to end, or has ended itself, in any way (kill -9 too).
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading

END_S = 5.0
"""Longest wait for the viewer's end, before it is killed."""


def main() -> int:
    """Run the viewer with the arguments of this program; return its exit status."""
    import rerun_cli.__main__ as rerun  # type: ignore[import-untyped]  # noqa: PLC0415

    rerun.subprocess = _Started  # it runs the viewer by `subprocess.call`
    return int(rerun.main())


class _Started:
    """Part of `subprocess` that Rerun's start script uses."""

    @staticmethod
    def call(command: list[str]) -> int:
        """Run a program until it ends, or standard input is closed; return its exit status."""
        with subprocess.Popen(command, stdin=subprocess.DEVNULL) as viewer:  # noqa: S603
            threading.Thread(target=_end_with_parent, args=(viewer,), daemon=True).start()
            return viewer.wait()


def _end_with_parent(viewer: subprocess.Popen[bytes]) -> None:
    while os.read(0, 1024):
        pass
    viewer.terminate()
    try:
        viewer.wait(END_S)
    except subprocess.TimeoutExpired:
        viewer.kill()


if __name__ == "__main__":
    sys.exit(main())

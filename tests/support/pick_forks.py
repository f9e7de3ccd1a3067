"""A process that has the program loaded and forks picking servers: one a line of its input.

A line names a project file and a log file, as JSON; ``pid`` and address, or what was refused, come
back as JSON. At the end of the input it ends, and so do its children.
"""

from __future__ import annotations

import json
import logging
import os
import signal
import sys
from pathlib import Path

from uavgram.errors import UavgramError
from uavgram.picking.web import server, serving


def report(**facts: object) -> None:
    os.write(1, (json.dumps(facts) + "\n").encode())


def child(project: str, log_file: str, save_after_s: float) -> None:
    server.SAVE_AFTER_S = save_after_s
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    logging.basicConfig(filename=log_file, level=logging.INFO, force=True)
    try:
        serving.serve(
            Path(project),
            lambda address: report(pid=os.getpid(), address=address),
            lambda _: None,
        )
    except UavgramError as why:
        report(pid=os.getpid(), refused=str(why))


def main() -> None:
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # children that end need not be waited for
    children = []
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            os.close(0)
            try:
                child(**json.loads(line))
            finally:
                logging.shutdown()
                os._exit(0)
        children.append(pid)
    for pid in children:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue


if __name__ == "__main__":
    main()

"""Command `uavgram view`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, Flag, app
from uavgram.cli.terminal import print_lines


@app.command
def view(recording: Path, /, *, web: Flag = False) -> int:
    """Open a recording in the Rerun viewer.

    Parameters
    ----------
    recording
        A recording.rrd from an output folder.
    web
        In a browser: serve it to this machine only, and show the address.
    """
    show(recording, web=web)
    return DONE


def show(recording: Path, *, web: bool) -> None:
    """Show a recording until its viewer is closed."""
    from uavgram.views.viewer.server import open_viewer, serve_viewer

    if not web:
        open_viewer(recording)
        return
    serve_viewer(recording, lambda address: print_lines(f"open {address}", "Ctrl+C ends it"))

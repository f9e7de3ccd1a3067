"""`uavgram view`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, app


@app.command
def view(recording: Path, /) -> int:
    """Open a recording in the Rerun viewer.

    Parameters
    ----------
    recording
        A recording.rrd from an output folder.
    """
    from uavgram.views.viewer import open_viewer

    open_viewer(recording)
    return DONE

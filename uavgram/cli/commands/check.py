"""`uavgram check`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, app
from uavgram.cli.terminal import say, tell_as


@app.command
def check(project: Path = Path(), /) -> int:
    """Read and validate every input of a project; run nothing.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    """
    from uavgram.pipeline.check import check as check_project
    from uavgram.views.terminal import check_lines

    tell_as(project)
    checked = check_project(project)
    posed = checked.posed
    say(*check_lines(checked.inputs.photos, posed.frames, posed.pairing, checked.messages))
    return DONE

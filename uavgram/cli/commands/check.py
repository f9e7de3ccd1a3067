"""Command `uavgram check`."""

from __future__ import annotations

from pathlib import Path

from uavgram.cli.application import DONE, Json, app
from uavgram.cli.terminal import print_json, print_lines, set_project_units


@app.command
def check(project: Path = Path(), /, *, json: Json = False) -> int:
    """Read and validate every input of a project; run nothing.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    json
        Print a JSON object instead of text.
    """
    from uavgram.cli.json_objects import check_object
    from uavgram.pipeline.check import check as check_project
    from uavgram.views.terminal import check_lines

    set_project_units(project)
    checked = check_project(project)
    if json:
        print_json(check_object(checked, project))
        return DONE
    posed = checked.posed
    print_lines(*check_lines(checked.inputs.photos, posed.frames, posed.pairing, checked.messages))
    return DONE

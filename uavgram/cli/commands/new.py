"""Command `uavgram new`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavgram.cli.application import DONE, app
from uavgram.cli.terminal import print_lines

Images = Annotated[list[str] | None, Parameter(negative=())]


@app.command
def new(
    folder: Path = Path(),
    /,
    *,
    images: Images = None,
    log: Path | None = None,
    camera: Path | None = None,
    poses: Path | None = None,
) -> int:
    """Write a project.yaml for a folder of photos, and list missing inputs.

    Finds the photos, the flight log, the camera file (or the camera by the tags of the photos; or,
    without tags, an ordinary drone camera with very wide errors), poses in the photos, existing
    tables, and a gcp_list.txt. Lists unused files. Never overwrites a file.

    Parameters
    ----------
    folder
        Folder with the photos, in it or in its subfolders; by default the present one.
    images
        Photos to take, as a pattern relative to the folder, where it holds several kinds.
    log, camera, poses
        File to take, relative to the folder, where it holds several.
    """
    from uavgram.pipeline.new import Choices, new_project
    from uavgram.views.terminal import message_lines

    made = new_project(
        folder, Choices(images=tuple(images or ()), log=log, camera=camera, poses=poses)
    )
    print_lines(f"Written: {made.path}", *(f"  {what}" for what in made.found))
    print_lines("", *message_lines(made.messages))
    print_lines("", f"Next: uavgram pick {shlex.quote(str(made.path))}")
    return DONE

"""`uavgram new`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from uavgram.cli.application import DONE, app
from uavgram.cli.terminal import say

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
    """Write a project.yaml for a folder of photos, and say what is still missing.

    Finds the photos, the flight log, the camera file (or what the photos say of theirs; or, where
    they say nothing, an ordinary drone camera with very wide errors), poses in the photos, tables
    that are there, and a gcp_list.txt. Says what it passed over. Never writes over a file.

    Parameters
    ----------
    folder
        It, or folders in it, holds the photos; by default the present one.
    images
        Which photos to take, as a pattern relative to the folder, where it holds several kinds.
    log, camera, poses
        Which file to take, relative to the folder, where it holds several.
    """
    from uavgram.pipeline.new import Choices, new_project
    from uavgram.views.terminal import message_lines

    made = new_project(
        folder, Choices(images=tuple(images or ()), log=log, camera=camera, poses=poses)
    )
    say(f"Written: {made.path}", *(f"  {what}" for what in made.found))
    say("", *message_lines(made.messages))
    say("", f"Next: uavgram pick {shlex.quote(str(made.path))}")
    return DONE

"""Command `uavgram geotag`."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from uavgram.cli.application import DONE, app
from uavgram.cli.terminal import print_lines, print_written_files, progress, set_project_units


@app.command
def geotag(
    project: Path = Path(),
    /,
    *,
    output: Path | None = None,
    poses: Literal["seed", "refined"] = "refined",
    exif: bool = False,
) -> int:
    """Export the photos' poses: geo.txt (OpenDroneMap), pix4d.csv, and tagged copies.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    output
        Folder of the files; by default `geotag` in the project's output folder.
    poses
        As adjusted (refined), or by the log or the photos (seed).
    exif
        Also write copies of the photos with the pose in EXIF and XMP; the originals are unchanged.
    """
    from uavgram.pipeline.geotag import geotag as write_tags
    from uavgram.views.terminal import geotag_lines

    units = set_project_units(project)
    done = write_tags(project, output, poses, exif=exif, progress=progress())
    print_lines(*geotag_lines(done.tags, done.messages, units))
    print_written_files(done.folder, done.files)
    return DONE

"""Commands that write photos for other programs: `uavgram geotag` and `uavgram rectify`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Decimal, app
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


@app.command
def rectify(
    project: Path = Path(),
    /,
    *,
    output: Path | None = None,
    frame: str | None = None,
    pixel_size: Annotated[Decimal | None, Parameter(validator=validators.Number(gt=0))] = None,
) -> int:
    """Make a metric top view of the ground: GeoTIFF, a PNG with a scale bar, a map of the sigma.

    Objects above the ground lean in it: measure such objects with points of their own.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    output
        Folder of the files; by default `rectified` in the project's output folder.
    frame
        One photo; by default the mosaic of all adjusted ones, each spot from the photo most above
        it.
    pixel_size
        Edge of a pixel on the ground in metres; by default that of the photos.
    """
    from uavgram.pipeline.rectify import PICTURE, SHEET, SIGMA
    from uavgram.pipeline.rectify import rectify as make
    from uavgram.views.terminal import message_lines

    set_project_units(project)
    done = make(project, output, frame, pixel_size, progress())
    raster = done.raster
    print_lines(*message_lines(done.messages))
    print_lines(
        f"{len(done.frames)} of the photos, {raster.width} x {raster.height} pixels of "
        f"{raster.pixel_m:.3g} m, {done.covered:.0%} covered",
        f"coordinates: {raster.crs or 'local metres; north is arbitrary'}",
        f"sigma of a place in it: {done.sigma_m[0]:.3f} m (95 % below {done.sigma_m[1]:.3f} m)",
    )
    print_written_files(done.folder, (PICTURE, SHEET, SIGMA))
    return DONE

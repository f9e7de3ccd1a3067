"""Export the photos' poses for other programs."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from uavgram.errors import GeometryError
from uavgram.io.exports.photogrammetry import write_geo_txt, write_pix4d_csv
from uavgram.io.files import check_folder_of_project, check_no_originals
from uavgram.io.outputs import stage_output
from uavgram.io.photos.tagging import write_tagged_photo
from uavgram.model.frames import GeoTags, PoseChoice
from uavgram.model.message import Message
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.exports import make_geotags
from uavgram.pipeline.measure.inputs import Inputs, read_inputs
from uavgram.pipeline.measure.pose import pose_frames
from uavgram.pipeline.parallel import Progress, silent
from uavgram.pipeline.threads import limit_blas_threads
from uavgram.stages.messages import order_messages
from uavgram.stages.products.geotags import geotag as make_tags

FOLDER = "geotag"
TAGGED = "tagged"


@dataclass(frozen=True, kw_only=True, eq=False)
class GeotagOutput:
    """Written files and tags, and messages."""

    folder: Path
    files: tuple[str, ...]
    tags: GeoTags
    messages: tuple[Message, ...]


@limit_blas_threads
def geotag(
    project: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    poses: PoseChoice = "refined",
    *,
    exif: bool = False,
    progress: Progress = silent,
) -> GeotagOutput:
    """Write geo.txt, pix4d.csv and, on request, tagged copies of the photos.

    Parameters
    ----------
    project
        The project file.
    output
        Folder; by default ``geotag`` in the project's output folder.
    poses
        ``refined``: as adjusted (for photos without picks, the seed); ``seed``: by the log or the
        photos.
    exif
        Copies into the folder ``tagged``; the photos themselves are never touched.
    progress
        Shows long loops.

    Raises
    ------
    UavgramError
        A problem that the user can solve. Earlier files are untouched.
    """
    inputs = read_inputs(Path(project))
    folder = Path(inputs.project.output) / FOLDER if output is None else Path(output).absolute()
    if output is None:
        check_folder_of_project(folder, Path(project).absolute().parent)
    if exif:
        check_no_originals(folder / TAGGED, inputs.photos.path)
    tags, messages = _tags(inputs, poses)
    files = ["geo.txt", "pix4d.csv"]
    with stage_output(folder, inputs.files, inputs.photos.path) as staging:
        write_geo_txt(tags, staging / files[0])
        write_pix4d_csv(tags, staging / files[1])
        if exif:
            (staging / TAGGED).mkdir()
            for k, name in enumerate(progress(tags.frame_id, "tagging", len(tags.frame_id))):
                write_tagged_photo(tags, k, staging / TAGGED / name)
            files.append(f"{TAGGED}/ ({len(tags.frame_id)} photos)")
    return GeotagOutput(folder=folder, files=tuple(files), tags=tags, messages=messages)


def _tags(inputs: Inputs, choice: PoseChoice) -> tuple[GeoTags, tuple[Message, ...]]:
    if choice == "refined":
        result = compute(inputs).result
        tags, messages = make_geotags(result), result.messages
    else:
        tags, messages = _seeds(inputs)
    return tags, (*messages, *_report_left_out(inputs, tags, choice))


def _seeds(inputs: Inputs) -> tuple[GeoTags, tuple[Message, ...]]:
    posed = pose_frames(inputs)
    if posed.telemetry is None:
        raise GeometryError(
            f"{inputs.project_path}: there are no seed poses without `log` or `poses`; write the "
            "refined ones (--poses refined)"
        )
    poses = posed.telemetry.poses
    path = dict(zip(inputs.photos.frame_id, inputs.photos.path, strict=True))
    paths = tuple(path[name] for name in poses.frame_id)
    seed: PoseChoice = "seed"
    tags = make_tags(poses, paths, (seed,) * len(paths), posed.world)
    return tags, order_messages(*inputs.messages, *posed.messages)


def _report_left_out(inputs: Inputs, tags: GeoTags, choice: PoseChoice) -> Iterator[Message]:
    without = [name for name in inputs.photos.frame_id if name not in set(tags.frame_id)]
    if without:
        text = (
            f"{len(without)} photos have no pose and were left out (the first is {without[0]}): "
            "`uavgram check` lists the reasons."
        )
        yield Message("warning", "geotag-without-pose", text, frames=tuple(without))
    poses = zip(tags.frame_id, tags.pose, strict=True)
    seeds = tuple(name for name, pose in poses if pose == "seed")
    if choice == "refined" and seeds:
        text = (
            f"{len(seeds)} photos have no picks, so they were not adjusted: their poses are those "
            "of the log, and as inaccurate. Pick points in them for better ones."
        )
        yield Message("warning", "geotag-seeds", text, frames=seeds)

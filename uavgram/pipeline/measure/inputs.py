"""Read all inputs of a project, and check them against each other and the photos."""

from __future__ import annotations

import glob
from collections import Counter
from collections.abc import Collection, Container, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from uavgram.config.project import load_project, project_file
from uavgram.config.project_text import setting_text
from uavgram.errors import InputError, suggest_spelling
from uavgram.geometry.camera.projection import share_without_rays
from uavgram.imaging.photos.decoding import is_same_exposure
from uavgram.input_files import UnusableFile
from uavgram.io.files import digest_inputs
from uavgram.io.logs.flight_log import read_flight_log
from uavgram.io.outputs import LOCK, check_saved, is_locked, list_put_aside
from uavgram.io.photos.catalogue import MAX_NAMED, UnusablePhotosError, list_absent, read_photos
from uavgram.io.photos.metadata import exif_text, read_camera_tags, read_exif_tags
from uavgram.io.photos.pose_sources import FROM_PHOTOS, read_pose_sources
from uavgram.io.photos.pose_tags import ASK_FOR_MOUNT, first_maker
from uavgram.io.tables.csv_tables import find_own_columns
from uavgram.io.tables.known import (
    CONTROL_LINES_COLUMNS,
    KNOWN_COLUMNS,
    LINES_COLUMNS,
    read_control_lines,
    read_known,
    read_known_points,
    read_lines,
)
from uavgram.io.tables.measure import MEASURE_COLUMNS, read_measure
from uavgram.io.tables.picks import PICKS_COLUMNS, TIES_COLUMNS, read_picks, read_ties
from uavgram.model.arrays import Floats
from uavgram.model.camera import Calibration, Readout, find_published_readout
from uavgram.model.flight_log import FlightLog
from uavgram.model.frames import PhotoPoses, Photos
from uavgram.model.message import Message, MessagePlural
from uavgram.model.naming import join_names
from uavgram.model.observations import (
    NO_CONTROL_LINES,
    NO_KNOWN,
    ControlLines,
    KnownLines,
    KnownPoints,
    KnownThings,
    MeasurementRequest,
    Picks,
    select_rows,
)
from uavgram.model.options import CAMERA_UNKNOWN, TIES_FILE, TIES_FOUND, Project
from uavgram.model.provenance import InputDigest
from uavgram.model.survey import NO_TIES, TiePicks
from uavgram.pipeline.cameras import assume_photo_camera, describe_size, read_camera
from uavgram.stages.duplicates import Duplicates, find_duplicates

ANEW = "or take the tie points out by `uavgram picks ties --undo`, and search for them again"


def check_picks(project: Project, picks: Picks, photos: Photos) -> None:
    """Refuse the first pick outside its photo.

    Parameters
    ----------
    project
        Project, which names the table.
    picks, photos
        Picks and photos of the project.

    Raises
    ------
    InputError
        With file and line.
    """
    for i, why in _find_outside(picks.image, picks.pixel_px, photos):
        what = f"the pick of {picks.label[i]!r}"
        raise InputError(project.picks, f"{what} {why}", picks.line_of(i))


def check_ties(path: str, ties: TiePicks, photos: Photos) -> None:
    """Refuse the first sighting of a tie point outside its photo.

    Parameters
    ----------
    path
        The table.
    ties, photos
        Tie points and photos of the project.

    Raises
    ------
    InputError
        With file and line.
    """
    for i, why in _find_outside(ties.image, ties.pixel_px, photos):
        text = f"the sighting of tie point {ties.tie[i]!r} {why}; {ANEW}"
        raise InputError(path, text, ties.line[i] if ties.line else None)


def _find_outside(
    images: Sequence[str], pixel_px: Floats, photos: Photos
) -> Iterator[tuple[int, str]]:
    """Yield the first pixel outside its photo, with the reason."""
    at = {name: k for k, name in enumerate(photos.frame_id)}
    photo = np.array([at[image] for image in images], dtype=np.int64)
    size = np.stack([photos.width_px, photos.height_px], axis=1)[photo]
    inside = ((pixel_px >= -0.5) & (pixel_px <= size - 0.5)).all(axis=1)
    for i in np.flatnonzero(~inside)[:1].tolist():
        image, (u, v), (width, height) = images[i], pixel_px[i], size[i]
        yield (
            i,
            f"at ({u:g}, {v:g}) is outside {image!r} "
            f"({width:.0f} x {height:.0f} px, original and unrotated)",
        )


def _list_named_photos(
    project: Project, picks: Picks, ties_file: str | None, ties: TiePicks
) -> dict[str, str]:
    """List the photos that the project's file and tables name, each with where first."""
    tables = (
        (project.picks, picks.image, picks.line),
        (ties_file, ties.image, ties.line),
    )
    named = {Path(one).name: "`images`" for one in project.images if not glob.has_magic(one)}
    for file, images, lines in tables:
        for image, line in zip(images, lines or ("",) * len(images), strict=True):
            named.setdefault(image, f"{Path(file or '').name}{line and f' (line {line})'}")
    return named


if TYPE_CHECKING:
    from uavgram.model.planned import FlightPlanned

_CAMERA_TAGS = ("Image Make", "Image Model", "EXIF BodySerialNumber")

NO_PICKS = Picks(
    image=(),
    label=(),
    pixel_px=np.empty((0, 2)),
    sigma_px=np.empty(0),
    height_m=np.empty(0),
)
NO_LINES = KnownLines(
    name=(),
    start=(),
    end=(),
    length_m=np.empty(0),
    sigma_m=np.empty(0),
    adjust=np.empty(0, dtype=np.bool_),
)
NO_POINTS = KnownPoints(
    label=(), kind="local", coordinates=np.empty((0, 3)), sigma_m=np.empty((0, 3))
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Inputs:
    """All inputs that a project names, as read.

    Attributes
    ----------
    digests
        Chain of custody: every file that was read, the project file first.
    unused_picks
        Rows of the table of picks that are in photos that are left out, or were found from there;
        `picks` has all others.
    """

    project_path: str
    project: Project
    calibration: Calibration
    photos: Photos
    picks: Picks
    unused_picks: tuple[int, ...] = ()
    lines: KnownLines
    known: KnownThings = NO_KNOWN
    requests: tuple[MeasurementRequest, ...]
    control: KnownPoints
    control_lines: ControlLines = NO_CONTROL_LINES
    check: KnownPoints
    ties: TiePicks = NO_TIES
    planned: FlightPlanned | None = None
    log: FlightLog | None
    poses: PhotoPoses | None
    digests: tuple[InputDigest, ...]
    messages: tuple[Message, ...]

    @property
    def folder(self) -> Path:
        """Folder of the project file, to which its paths are relative."""
        return Path(self.project_path).absolute().parent

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that was read; no output may replace one."""
        return tuple(self.folder / digest.path for digest in self.digests)


def _report_put_aside(output: Path) -> tuple[Message, ...]:
    """Report journals of sessions whose changes are not in the tables."""
    names = [path.name for path in list_put_aside(output)]
    text = (
        f"{join_names(names)} in {output}: changes of a picking session that ended without saving "
        "are not in the tables, as they did not fit them. `uavgram pick` offers to take or to "
        "discard them; or move the file away."
    )
    return (Message("warning", "pick-not-recovered", text),) if names else ()


def read_inputs(
    path: Path,
    *,
    unfinished: bool = False,
    unpicked: bool = False,
    without: Collection[str] = (),
) -> Inputs:
    """Read and validate every input of a project; run nothing.

    Parameters
    ----------
    path
        The project file, or its folder.
    unfinished
        Whether it may still lack picks, ties, lengths and measurements: missing files then count as
        empty.
    unpicked
        Whether the table of picks may be empty.
    without
        Names of photos to leave out, with their picks, besides those that the project leaves out.

    Raises
    ------
    UnusablePhotosError
        Photos are missing or damaged; the message names the first ones, and the way to go on
        without them.
    InputError
        The first problem found, with file, line, frame or label.
    """
    path = project_file(path)
    project = load_project(path, unfinished=unfinished)
    output = Path(project.output)
    if not unfinished and not is_locked(output / LOCK):  # an open page saves its picks itself
        check_saved(output)
    picks_file, lines_file, measure_file = (
        None if name and unfinished and not Path(name).is_file() else name
        for name in (project.picks, project.lines, project.measure)
    )
    picks = read_picks(picks_file, may_be_empty=unfinished or unpicked) if picks_file else NO_PICKS
    lines = read_lines(lines_file) if lines_file else NO_LINES
    requests = read_measure(measure_file) if measure_file else ()
    known = read_known(project.known) if project.known else NO_KNOWN
    ties_file = _existing(ties_path(project, path.absolute().parent))
    ties = read_ties(ties_file) if ties_file else NO_TIES
    planned = None
    if project.plan:
        from uavgram.io.results.command_json import read_plan  # noqa: PLC0415 - slow to load

        planned = read_plan(project.plan)
    columns = _column_messages(
        picks_file, lines_file, measure_file, project.known, ties_file, project.control_lines
    )
    control = read_known_points(project.control) if project.control else NO_POINTS
    control_lines = _control_lines(project, known)
    check = read_known_points(project.check) if project.check else NO_POINTS
    left_out = frozenset(project.leave_out).union(without)
    named = _list_named_photos(project, picks, ties_file, ties)
    try:
        photos, photo_messages = read_photos(project.images, project.time, left_out, named)
        calibration, messages = _camera(project, photos)
        _check_sizes(project, calibration, photos)
    except UnusablePhotosError as fault:
        way_out = _way_without(path, project, fault.photos)
        raise UnusablePhotosError(fault.photos, way_out) from None
    photo_messages += tuple(_report_left_out(project, picks, photos, named))
    unused_picks = tuple(_list_unused(picks, left_out))
    picks = picks.take(np.setdiff1d(np.arange(len(picks.image)), unused_picks).tolist())
    ties = _remove_sightings(ties, left_out)
    for readout in _readout(project, calibration, photos):
        calibration = replace(calibration, readout=readout)
        messages += (_report_readout(readout),)
    check_picks(project, picks, photos)
    check_ties(ties_file or "", ties, photos)
    log = read_flight_log(project.log) if project.log else None
    poses, pose_messages = _poses(project, photos)
    notes = () if log is None else log_messages(log)
    if not unfinished:
        notes += _report_put_aside(output)
    files = [*list_named_files(path, project, picks_file, lines_file, measure_file), *photos.path]
    return Inputs(
        project_path=str(path),
        project=project,
        calibration=calibration,
        photos=photos,
        picks=picks,
        unused_picks=unused_picks,
        lines=lines,
        known=known,
        requests=requests,
        control=control,
        control_lines=control_lines,
        check=check,
        ties=ties,
        planned=planned,
        log=log,
        poses=poses,
        digests=digest_inputs(files, path.absolute().parent),
        messages=(
            *columns,
            *messages,
            *_lens_messages(calibration),
            *photo_messages,
            *pose_messages,
            *notes,
        ),
    )


def _way_without(path: Path, project: Project, photos: Sequence[UnusableFile]) -> str:
    """Return how to go on without some photos, as a clause."""
    names = [*project.leave_out, *(photo.path.name for photo in photos)]
    which = "it" if len(photos) == 1 else "them"
    if len(names) > MAX_NAMED:
        return f"leave {which} out by the button that `uavgram pick` shows for this project"
    setting = setting_text("leave_out", names)
    return f"write `{setting}` into {path.name} to go on without {which}"


def _list_unused(picks: Picks, left_out: frozenset[str]) -> Iterator[int]:
    """List the rows of picks in photos left out, or found from picks there."""
    for i, pair in enumerate(zip(picks.image, picks.from_image, strict=True)):
        if not left_out.isdisjoint(pair):
            yield i


def _report_left_out(
    project: Project, picks: Picks, photos: Photos, named: Container[str]
) -> Iterator[Message]:
    """Report each photo that the project leaves out, with its picks; and names of no photo."""
    labels: dict[str, dict[str, None]] = {name: {} for name in sorted(project.leave_out)}
    for image, label in zip(picks.image, picks.label, strict=True):
        if image in labels:
            labels[image][label] = None
    absent = list_absent(project.images, labels) if labels else ()
    for image, names in labels.items():
        if image in absent and image not in named:
            near = suggest_spelling(image, photos.frame_id)
            text = (
                f"`leave_out` names {image}, and no photo of the project has that name"
                f"{f' ({near})' if near else ''}: correct it, or take it out of `leave_out`."
            )
            yield Message("warning", "left-out-unknown", text, frames=(image,))
            continue
        with_picks = (
            f", with its picks of {join_names(tuple(names), MAX_NAMED)}, which stay in the table"
        )
        yield Message(
            "warning" if names else "info",
            "photo-left-out",
            f"The project leaves out {image} (`leave_out`){with_picks if names else ''}.",
            frames=(image,),
            labels=tuple(names),
            several=MessagePlural(
                "The project leaves out {count} photos (`leave_out`)",
                image,
                ending="Their picks stay in the table." if names else "",
            ),
        )


def _remove_sightings(ties: TiePicks, photos: Collection[str]) -> TiePicks:
    """Return the tie points without their sightings in some photos; each needs two others."""
    rows = [i for i, image in enumerate(ties.image) if image not in photos]
    if len(rows) == len(ties.image):
        return ties
    sightings = Counter(ties.tie[i] for i in rows)
    return TiePicks(**select_rows(ties, [i for i in rows if sightings[ties.tie[i]] > 1]))


def list_named_files(
    path: Path,
    project: Project,
    picks: str | None,
    lines: str | None,
    measure: str | None,
) -> tuple[str, ...]:
    """Return the project file and every other file of it but photos; ties only if they exist.

    Parameters
    ----------
    path
        The project file.
    project
        Its content.
    picks, lines, measure
        Those of its tables that exist.
    """
    poses = (source for source in project.pose_sources if source != FROM_PHOTOS)
    named = (
        project.camera_file,
        picks,
        project.log,
        *poses,
        lines,
        measure,
        project.known,
        project.control,
        project.control_lines,
        project.check,
        _existing(ties_path(project, path.absolute().parent)),
        project.plan,
    )
    return (str(path), *(name for name in named if name))


def ties_path(project: Project, folder: Path) -> Path | None:
    """Return the path of a project's table of tie points; None where it names none."""
    if project.ties is None:
        return None
    return folder / TIES_FILE if project.ties == TIES_FOUND else Path(project.ties)


def _control_lines(project: Project, known: KnownThings) -> ControlLines:
    """Read lines of known position; results name them and known things in one list."""
    if not project.control_lines:
        return NO_CONTROL_LINES
    lines = read_control_lines(project.control_lines)
    for name in lines.name:
        if name in known.name:
            text = f"line {name!r} has the name of a known thing: give one of them another name"
            raise InputError(project.control_lines, text)
    return lines


def _existing(path: Path | None) -> str | None:
    """Return the path of a file that may be missing, as tie points may still have to be found."""
    return str(path) if path is not None and path.is_file() else None


def find_project_duplicates(inputs: Inputs) -> Duplicates:
    """Find the duplicates in a project."""
    digests = dict(zip(inputs.files, (one.sha256 for one in inputs.digests), strict=True))
    pairs = zip(inputs.photos.frame_id, map(Path, inputs.photos.path), strict=True)
    sha256 = {name: digests[path] for name, path in pairs if path in digests}
    path = dict(zip(inputs.photos.frame_id, inputs.photos.path, strict=True))
    tables = inputs.picks, inputs.lines, inputs.known
    return find_duplicates(
        inputs.photos,
        sha256,
        *tables,
        lambda one, other: _is_same(path[one], path[other]),
        inputs.project.picks_sigma_px,
    )


@lru_cache(maxsize=10_000)
def _is_same(one: str, other: str) -> bool:
    """Return whether two photos are of one camera, if stated, and show the same."""
    cameras = [_read_camera_name(path) for path in (one, other)]
    return (not all(cameras) or cameras[0] == cameras[1]) and is_same_exposure(one, other)


def _read_camera_name(path: str) -> str:
    tags = read_exif_tags(path)
    return " ".join(exif_text(tags, tag) for tag in _CAMERA_TAGS).strip()


def _column_messages(*files: str | None) -> Iterator[Message]:
    """Report columns of picks, lengths and measurements that are not read."""
    columns_of = (
        *(PICKS_COLUMNS, LINES_COLUMNS, MEASURE_COLUMNS, KNOWN_COLUMNS, TIES_COLUMNS),
        CONTROL_LINES_COLUMNS,
    )
    tables = zip(files, columns_of, strict=True)
    for file, columns in tables:
        if file and (own := find_own_columns(file, columns)):
            names = ", ".join(map(repr, own))
            what = "column" if len(own) == 1 else "columns"
            text = f"{Path(file).name}: the program keeps, but does not use, the {what} {names}."
            yield Message("info", "own-columns", text, files=(Path(file).name,))


def log_messages(log: FlightLog) -> tuple[Message, ...]:
    """Report anomalies of a log's file as warnings."""
    name = Path(log.path).name
    return tuple(
        Message("warning", "log-note", f"{name}: {note}", files=(name,)) for note in log.notes
    )


def _lens_messages(calibration: Calibration) -> tuple[Message, ...]:
    """Report a part of the image without rays: picks there cannot be used."""
    share = share_without_rays(
        calibration.model, calibration.parameters, calibration.width_px, calibration.height_px
    )
    if share == 0:
        return ()
    text = (
        f"The calibration of camera {calibration.name!r} does not hold in {share:.1%} of each "
        "photo, at its rim: picks there are left out. Pick nearer to the middle."
    )
    return (Message("info", "lens-rim", text),)


def _camera(project: Project, photos: Photos) -> tuple[Calibration, tuple[Message, ...]]:
    if project.camera_file is None:
        return assume_photo_camera(photos, may_be_unknown=project.camera == CAMERA_UNKNOWN)
    read = read_camera(project.camera_file)
    return read.calibration, read.messages


def _readout(project: Project, camera: Calibration, photos: Photos) -> Iterator[Readout]:
    """Yield the camera's published readout time, where it is needed and not stated."""
    if project.log is None or camera.readout is not None or not photos.path:
        return
    tags = read_camera_tags(photos.path[0])
    known = find_published_readout(tags.make, tags.model, camera.width_px, camera.height_px)
    if known is not None:
        yield known


def _report_readout(readout: Readout) -> Message:
    text = (
        "By a published table this camera reads a photo row after row, in "
        f"{1e3 * readout.value_s:.0f} ms: the adjustment starts from that, ± "
        f"{1e3 * readout.sigma_s:.0f} ms. `readout_ms` in camera.yaml takes its place."
    )
    return Message("info", "readout-published", text)


def _poses(project: Project, photos: Photos) -> tuple[PhotoPoses | None, tuple[Message, ...]]:
    """Read the poses that the project names; without any, or a log, hint at available ones."""
    if project.poses is not None:
        poses, messages = read_pose_sources(project.pose_sources, photos, project.world.heights)
        if not np.isnan(project.mount.angles_deg((np.nan,) * 3)).all():
            messages = tuple(map(_remove_mount_request, messages))
        return poses, messages
    maker = "" if project.log else first_maker(photos)
    if not maker:
        return None, ()
    text = (
        f"The photos carry poses ({maker}) that were not used: `poses: {FROM_PHOTOS}` in the "
        "project would use them."
    )
    return None, (Message("info", "poses-available", text),)


def _remove_mount_request(message: Message) -> Message:
    """Return the message without its request to state `mount`, as the project states it."""
    text = message.text.replace(ASK_FOR_MOUNT, "The camera is taken to look as `mount` states.")
    return replace(message, text=text)


def _check_sizes(project: Project, calibration: Calibration, photos: Photos) -> None:
    """Refuse photos of another size than the camera's: some of them, or all."""
    width, height = calibration.width_px, calibration.height_px
    wrong = np.flatnonzero((photos.width_px != width) | (photos.height_px != height))
    if 0 < wrong.size < len(photos.path):
        raise UnusablePhotosError(
            [
                UnusableFile(
                    Path(photos.path[i]),
                    describe_size(
                        (int(photos.width_px[i]), int(photos.height_px[i])), (width, height)
                    ),
                )
                for i in wrong.tolist()
            ]
        )
    if wrong.size:
        i = int(wrong[0])
        size = int(photos.width_px[i]), int(photos.height_px[i])
        raise InputError(
            photos.path[i],
            f"is {size[0]} x {size[1]} px, but {project.camera} describes {width} x {height} px "
            f"({wrong.size} of {len(photos.path)} photos differ): "
            + _suggest_size(project.camera, (width, height), size),
        )


def _suggest_size(camera: str, have: tuple[int, int], want: tuple[int, int]) -> str:
    """Suggest an action for photos of another size than the camera file's."""
    # One factor for both sides, up to the rounding of both to whole pixels.
    if abs(have[0] * want[1] - have[1] * want[0]) > max(have):
        return "give the camera file of this camera and resolution, or leave these photos out"
    size = f"{want[0]}x{want[1]}"
    name = Path(camera).stem
    return (
        "if they are the same images made larger or smaller, make a camera file of their size: "
        f"`uavgram camera {camera} --size {size} --output {name}_{size}.yaml`; else give the "
        "`camera` file of this camera and resolution, or leave these photos out"
    )

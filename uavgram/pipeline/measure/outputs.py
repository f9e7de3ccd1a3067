"""Outputs of a run: recording, report with parts of photos, results, files for other programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from threading import Lock

from uavgram.imaging.photos.decoding import read_pixels
from uavgram.imaging.photos.preview import (
    Pixels,
    Preview,
    cut_parts,
    jpeg_preview_scale,
    make_preview_of_decoded,
    read_preview,
)
from uavgram.imaging.top_view.mosaic import GroundTexture, Mosaic, cut_ground
from uavgram.io.exports.gis import GROUND
from uavgram.io.files import photo_files
from uavgram.io.outputs import LAST_MOVED, replace_bytes
from uavgram.io.results.results_json import write_results
from uavgram.model.maps import PLAN_PDF, Paper, PlanPaper
from uavgram.model.message import Message
from uavgram.model.result.result import GroundPicture, Picture, Pictures, Region, Result
from uavgram.model.result.tables import TieCloud
from uavgram.pipeline.measure.exports import make_writers
from uavgram.pipeline.measure.run import Journal
from uavgram.pipeline.parallel import Progress, prefetch, silent
from uavgram.stages.products.picture_plan import picture_plan
from uavgram.views.recording.write import write_recording
from uavgram.views.report import annex_of, ground_extent, report_pdf, write_report

MAX_BYTES = 9_000_000
"""Largest size of all pictures together. As text in report.html they are a third larger: it stays
below 15 MB."""

_ORDER = {"overview": 0, "measurement": 1, "point": 2}


class ReportPictures:
    """Parts of photos for a report, cut out while the photos are read for another purpose."""

    def __init__(self, result: Result) -> None:
        """Choose the parts of each photo."""
        self._result, self._plan = result, picture_plan(result)
        files = photo_files(result.frames)
        self._wanted = {
            files[frame]: tuple(regions)
            for frame, regions in groupby(sorted(self._plan.regions, key=_frame), _frame)
        }
        self._made: dict[str, tuple[Picture, ...]] = {}
        self._one = Lock()
        self._room: Pixels | None = None

    def needs_photo(self, path: str) -> bool:
        """Return whether any part of a photo is shown."""
        return path in self._wanted

    def cut_parts(self, path: str) -> tuple[Preview, Pixels]:
        """Cut the parts out of a photo, which is decoded once for all.

        Only one photo that is decoded as a whole is in memory at a time, for any number of threads.

        Returns
        -------
        As `read_preview`.

        Raises
        ------
        InputError
            The file cannot be read, or is no photo.
        """
        with self._one:
            whole = read_pixels(path, room=self._room)
            preview, pixels, halves = make_preview_of_decoded(whole)
            self._made[path] = cut_parts(halves, preview.tone, self._wanted[path])
            self._room = None if pixels is whole else whole
        return preview, pixels

    def pictures(self) -> Pictures:
        """Return all parts, once their photos have been read."""
        self._room = None
        made = [picture for path in self._wanted for picture in self._made[path]]
        made.sort(key=lambda one: (_ORDER[one.region.subject], one.region.row))
        shown: list[Picture] = []
        left_out = list(self._plan.left_out)
        weight = 0
        for picture in made:
            weight += len(picture.jpeg)
            if weight <= MAX_BYTES:
                shown.append(picture)
            else:
                left_out.append(_name(self._result, picture.region))
        return Pictures(shown=tuple(shown), left_out=tuple(left_out))


def cut_out_ground(result: Result, texture: GroundTexture | None) -> GroundPicture | None:
    """Cut out the ground below the report's plans; None where photos show none of it."""
    corners = ground_extent(result)
    return None if texture is None or corners is None else cut_ground(texture, *corners)


def _frame(region: Region) -> int:
    return region.frame


def _name(result: Result, region: Region) -> str:
    rows = result.points.label if region.subject == "point" else result.measurements.name
    return rows[region.row]


MAX_RECORDED = 5_000
"""Largest number of photos in a recording: at some 0.3 MB each the viewer needs gigabytes to open
more."""


def select_recorded(count: int) -> range:
    """Return rows of the photos in a recording of so many: all, or a regular selection."""
    return range(0, count, max(1, -(-count // MAX_RECORDED)))


def note_thinning(result: Result) -> Result:
    """Add a note where the recording has only some of the photos."""
    count = len(result.frames.frame_id)
    rows = select_recorded(count)
    if len(rows) == count:
        return result
    text = (
        f"The recording carries {len(rows)} of the {count} photos, one in {rows.step}: with all of "
        "them it would be too large to open. Nothing else is left out of it."
    )
    return replace(result, messages=(*result.messages, Message("info", "recording-thinned", text)))


def write_outputs(
    result: Result,
    ties: TieCloud | None,
    folder: Path,
    journal: Journal,
    progress: Progress,
    pdf: Paper | None = None,
    plan: PlanPaper | None = None,
) -> None:
    """Write all outputs into a folder.

    Parameters
    ----------
    result, ties
        Result of a run, and tie points if there are any.
    folder
        Where the files go.
    journal
        Notes how long each of them takes, and becomes run.jsonl.
    progress
        Shows long loops.
    pdf, plan
        Paper of a report.pdf, and of plan.pdf and plan.png; None: there is none.

    Raises
    ------
    UavgramError
        A photo cannot be read, or a file cannot be written.
    """
    parts = ReportPictures(result)
    with journal.step("write recording.rrd"):
        texture = write_review(result, folder / "recording.rrd", progress, ties, parts)
    with journal.step("put the report's pictures together"):
        pictures = replace(parts.pictures(), ground=cut_out_ground(result, texture))
    writers: dict[str, Callable[[Path], None]] = {
        **make_writers(result, texture),
        "report.html": lambda path: write_report(result, path, pictures),
        "results.json": lambda path: write_results(result, path),
    }
    if pdf is not None:
        writers["report.pdf"] = lambda path: write_pdf(result, path, pdf)
    if plan is not None:
        from uavgram.pipeline.measure.site_plan import write_plan  # noqa: PLC0415 - loads matplotlib

        writers[PLAN_PDF] = lambda path: write_plan(result, plan, path.parent)
    for name, write in progress(writers.items(), "writing", len(writers)):
        with journal.step(f"write {name}"):
            (folder / name).parent.mkdir(exist_ok=True)
            write(folder / name)
    journal.write(folder / "run.jsonl")


NOT_ALWAYS = (
    *("report.pdf", "report-annex.pdf", PLAN_PDF, "plan.png", "plan.tif"),
    *("profiles.csv", "survey_map.dxf", GROUND),
)
"""Files that only some runs write, by their options or their data."""


def list_earlier(folder: Path, written: Path) -> list[str]:
    """List the files of an earlier run that a new one does not replace.

    Parameters
    ----------
    folder
        The output folder, before the new files are moved there.
    written
        Folder of the new files.
    """
    if not (folder / LAST_MOVED).is_file():
        return []
    there = (name for name in NOT_ALWAYS if (folder / name).is_file())
    return [name for name in there if not (written / name).exists()]


def write_pdf(result: Result, path: Path, paper: Paper) -> None:
    """Write report and annex as PDF, from their pages and results.json beside them.

    Parameters
    ----------
    result
        Result of a run.
    path
        The report to write; the annex is beside it, as by `annex_of`.
    paper
        Their size.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    results = path.with_name("results.json").read_text(encoding="utf-8")
    made = result.provenance.created_utc
    for file, attach in ((path, True), (annex_of(path), False)):
        html = file.with_suffix(".html").read_text(encoding="utf-8")
        replace_bytes(file, report_pdf(html, results, paper, result.name, made, attach=attach))


def write_review(
    result: Result,
    path: Path,
    progress: Progress = silent,
    ties: TieCloud | None = None,
    parts: ReportPictures | None = None,
) -> GroundTexture | None:
    """Write the recording of a result, with its photos and the ground in them.

    With very many photos it contains a selection (see `select_recorded`), while all show the
    ground. They are processed one by one: the used memory does not grow with their number.

    Parameters
    ----------
    result
        Result of a run.
    path
        The recording to write.
    progress
        Shows long loops.
    ties
        Tie points, where there are any.
    parts
        Parts of the photos for the report.

    Returns
    -------
    GroundTexture
        The ground; None where photos show none of it.

    Raises
    ------
    InputError
        A photo cannot be read.
    OutputError
        The file cannot be written.
    """
    names = result.frames.frame_id
    shown_photos = {names[row] for row in select_recorded(len(names))}
    mosaic = Mosaic(result, names, jpeg_preview_scale(result.camera.width_px))

    def reduced_photo(path: str) -> tuple[Preview, Pixels]:
        return parts.cut_parts(path) if parts and parts.needs_photo(path) else read_preview(path)

    def photos() -> Iterator[tuple[str, Preview]]:
        reduced = prefetch(reduced_photo, photo_files(result.frames))
        shown = progress(zip(names, reduced, strict=True), "photos", len(names))
        for name, (_, (preview, pixels)) in shown:
            mosaic.add(name, pixels)
            if name in shown_photos:
                yield name, preview

    shown: list[GroundTexture | None] = []

    def texture() -> GroundTexture | None:
        shown.append(mosaic.texture())
        return shown[-1]

    write_recording(result, photos(), texture, path, ties)
    return shown[-1] if shown else None

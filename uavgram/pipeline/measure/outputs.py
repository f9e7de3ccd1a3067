"""Write every output of a run: recording, report, results, and files for other programs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from uavgram.imaging.photos.preview import Pixels, Preview, jpeg_preview_scale, read_preview
from uavgram.imaging.top_view.mosaic import GroundTexture, Mosaic
from uavgram.io.exports.gis import GROUND
from uavgram.io.files import photo_files
from uavgram.io.outputs import LAST_MOVED, replace_bytes
from uavgram.io.results.results_json import write_results
from uavgram.model.maps import PLAN_PDF, Paper, PlanPaper
from uavgram.model.result.result import Result
from uavgram.model.result.tables import TieCloud
from uavgram.pipeline.measure.exports import make_writers
from uavgram.pipeline.measure.pictures import ReportPictures, cut_out_ground, select_recorded
from uavgram.pipeline.measure.run import Journal
from uavgram.pipeline.parallel import prefetch
from uavgram.pipeline.progress import Progress, silent
from uavgram.views.recording.write import write_recording
from uavgram.views.report import annex_of, report_pdf, write_report


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

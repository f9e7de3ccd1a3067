"""Batch of surveys: find them, measure each in a worker unless it is unchanged, make one table."""

from __future__ import annotations

import glob
import logging
import math
import os
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from uavgram.config.project import PROJECT_FILE, load_project
from uavgram.errors import InputError, UavgramError
from uavgram.input_files import read_text
from uavgram.io.exports.batch_tables import write_batch_csv, write_batch_parquet
from uavgram.io.files import photo_files
from uavgram.io.outputs import LAST_MOVED, SupersededError, claim_folder, stage_output
from uavgram.io.photos.catalogue import find_photos
from uavgram.io.photos.metadata import read_camera_tags
from uavgram.io.results.command_json import (
    STATE,
    append_record,
    is_unchanged,
    read_file_stat,
    read_file_state,
    read_records,
)
from uavgram.model.arrays import Floats
from uavgram.model.batch import Batch, FileState, Fit, ParameterUpdate, SurveyRecord, SurveyRow
from uavgram.model.maps import Paper
from uavgram.model.options import Project
from uavgram.model.result.result import Result, compare_cameras
from uavgram.pipeline.cluster import Cluster, run_on_cluster
from uavgram.pipeline.measure.inputs import list_named_files
from uavgram.pipeline.measure.run import run
from uavgram.pipeline.process_settings import cores
from uavgram.pipeline.processes import Bounds, ItemOutcome, run_in_workers
from uavgram.pipeline.versions import stamp
from uavgram.stages.pooled_statistics import find_camera_drifts, pool_fits
from uavgram.views.batch import render_batch_page
from uavgram.views.survey.verdict import verdict_sentence

POOLED_GROUPS = ("pixels", "lengths", "telemetry")


def row_of(result: Result, project: str, output: str, seconds: float) -> SurveyRow:
    """Return the table row of a measured survey.

    Parameters
    ----------
    result
        Result of its run.
    project
        Its project file.
    output
        Folder of its results.
    seconds
        Computing time.
    """
    origin = result.world.origin
    nowhere = (math.nan, math.nan)
    place = nowhere if origin is None else (origin.latitude_deg, origin.longitude_deg)
    warnings = (one.code for one in result.messages if one.level != "info")
    sigmas = result.measurements.sigma[[unit == "m" for unit in result.measurements.unit]]
    return SurveyRow(
        name=result.name,
        project=project,
        status="done",
        level=result.verdict.level,
        sentence=verdict_sentence(result),
        taken_utc=_format_mean_time(result.frames.time_utc_s),
        latitude_deg=place[0],
        longitude_deg=place[1],
        camera=result.camera.name,
        drone=_drone(photo_files(result.frames)),
        photos=len(result.frames.frame_id),
        measurements=len(result.measurements.name),
        mean_sigma_m=_mean(sigmas),
        worst_w=_largest(result.picks.w, result.lines.w, result.line_checks.z),
        warnings=tuple(dict.fromkeys(warnings)),
        output=output,
        seconds=seconds,
        fits=tuple(_fits(result)),
        seen=_list_camera_updates(result),
    )


def _format_mean_time(times: Floats) -> str:
    known = times[np.isfinite(times)]
    if not known.size:
        return ""
    return datetime.fromtimestamp(float(known.mean()), UTC).isoformat(timespec="seconds")


def _mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else math.nan


def _largest(*values: Floats) -> float:
    known = np.concatenate(values)
    known = known[np.isfinite(known)]
    return float(known[np.abs(known).argmax()]) if known.size else math.nan


def _drone(photos: tuple[str, ...]) -> str:
    """Return make, model and serial number in the first photo; empty where not stated."""
    try:
        tags = read_camera_tags(photos[0])
    except InputError:
        return ""
    return " ".join(filter(None, (tags.camera_name, tags.serial)))


def _fits(result: Result) -> Iterator[Fit]:
    checks = result.checks_overall
    if checks is not None and math.isfinite(checks.chi2) and checks.count:
        yield Fit(kind="checks", squares=checks.chi2, freedom=float(checks.count))
    for group in result.solution.groups:
        squares = group.variance_factor * group.redundancy
        if group.name in POOLED_GROUPS and group.redundancy > 0 and math.isfinite(squares):
            yield Fit(kind=group.name, squares=squares, freedom=group.redundancy)


def _list_camera_updates(result: Result) -> tuple[ParameterUpdate, ...]:
    found = compare_cameras(result.camera, result.shared.intrinsics)
    columns = (found.prior_value, found.prior_sigma, found.value, found.sigma)
    rows = zip(found.names, *(column.tolist() for column in columns), strict=True)
    return tuple(
        ParameterUpdate(name=name, stated=stated, stated_sigma=prior, value=value, sigma=sigma)
        for name, stated, prior, value, sigma in rows
        if prior > 0
    )


LEFT = ".uavgram-measured.jsonl"
"""File in the output folder with the record of a worker's result, until the batch has received
it."""


@dataclass(frozen=True, kw_only=True)
class Requests:
    """Requests of a batch for each survey, beside its project file: paper of a report.pdf."""

    pdf: Paper | None = None


@dataclass(frozen=True, kw_only=True)
class Task:
    """Survey to measure.

    Attributes
    ----------
    project
        Its project file.
    asked
        Requests.
    before
        Record of an earlier run, if any.
    results
        Size and time of its results.json when the survey was given to a worker of a cluster, which
        may begin late, when another one has finished it; None: impossible.
    """

    project: str
    asked: Requests
    before: SurveyRecord | None = None
    results: tuple[int, int] | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a survey: its row, and its record; None if it must be measured again next time."""

    row: SurveyRow
    record: SurveyRecord | None


def measure_survey(task: Task) -> Outcome:
    """Measure a survey, unless it is unchanged since the last run; report its problems in the row.

    Parameters
    ----------
    task
        The survey.

    Raises
    ------
    SupersededError
        Another process measures it, or did: nothing was written.
    """
    try:
        return _measure(task)
    except SupersededError:
        raise
    except UavgramError as fault:
        why = str(fault)
    except MemoryError:
        why = (
            "needs more memory than a worker of the batch may take: run it alone (uavgram run), or "
            "the batch with fewer workers (--workers 1)"
        )
    except Exception as fault:  # noqa: BLE001 (a bug in one survey must not stop the others)
        where = traceback.extract_tb(fault.__traceback__)[-1]
        why = (
            f"the program failed ({type(fault).__name__}: {fault}, in {Path(where.filename).name} "
            f"line {where.lineno}): this is a bug, please report it with this survey"
        )
    return failure_outcome(task, why)


def failure_outcome(task: Task, why: str) -> Outcome:
    """Return the outcome of a survey without results, with the reason."""
    row = SurveyRow(name=name_of(task.project), project=task.project, status="failed", message=why)
    return Outcome(row=row, record=None)


def add_present_results(task: Task) -> Task:
    """Add the present state of the results, before a survey is given to a worker of a cluster."""
    try:
        output = load_project(Path(task.project)).output
    except UavgramError:  # reported when it is measured
        return task
    return replace(task, results=read_file_stat(Path(output) / LAST_MOVED))


def name_of(project: str) -> str:
    """Return the name of a survey in the table where its project cannot be read."""
    path = Path(project)
    return path.absolute().parent.name if path.stem == "project" else path.stem


def _measure(task: Task) -> Outcome:
    path = Path(task.project)
    project = load_project(path)
    if task.before is not None and _is_unchanged(task, task.before, project):
        return Outcome(row=replace(task.before.row, status="unchanged"), record=task.before)
    left = _recover_result(task, project)
    if left is not None:
        return Outcome(row=left.row, record=left)
    if task.results is not None and task.results != read_file_stat(
        Path(project.output) / LAST_MOVED
    ):
        raise SupersededError(project.output)
    begun, before = time.process_time(), _stats(_inputs(path, project))
    with _claim_folder(project) as hold:
        result = run(path, pdf=task.asked.pdf, hold=hold)
    row = row_of(result, task.project, str(project.output), time.process_time() - begun)
    states = _states(result, path.absolute().parent, before)
    if states is None:
        return Outcome(row=row, record=None)
    record = SurveyRecord(
        row=row,
        version=stamp()["version"],
        asked=repr(task.asked),
        inputs=states,
        results=read_file_state(Path(project.output) / LAST_MOVED),
    )
    if task.results is not None:
        with suppress(OSError):  # then it is measured again if the record is lost
            append_record(Path(project.output) / LEFT, record)
    return Outcome(row=row, record=record)


def _recover_result(task: Task, project: Project) -> SurveyRecord | None:
    """Return the result of a worker interrupted before its report, if it is still valid."""
    path = Path(project.output) / LEFT
    found = read_records(path).get(task.project)
    with suppress(OSError):
        path.unlink(missing_ok=True)
    return found if found is not None and _is_unchanged(task, found, project) else None


def remove_record(outcome: Outcome) -> None:
    """Remove the record of a result that a worker of a cluster has reported."""
    with suppress(OSError):
        (Path(outcome.row.output) / LEFT).unlink(missing_ok=True)


def _claim_folder(project: Project) -> AbstractContextManager[Callable[[], None] | None]:
    """Claim the output folder; no claim to one that will be refused, as it holds the photos."""
    output = Path(project.output).resolve()
    if any(
        Path(one).resolve().parent == output
        for one in find_photos(project.images, project.leave_out)
    ):
        return nullcontext()
    return claim_folder(project.output)


def _inputs(path: Path, project: Project) -> list[str]:
    named = list_named_files(path, project, project.picks, project.lines, project.measure)
    photos = map(str, find_photos(project.images, project.leave_out))
    return [str(Path(one).absolute()) for one in (*named, *photos)]


def _is_unchanged(task: Task, before: SurveyRecord, project: Project) -> bool:
    """Return whether a run would give the existing results."""
    if (before.version, before.asked) != (stamp()["version"], repr(task.asked)):
        return False
    if {one.path for one in before.inputs} != set(_inputs(Path(task.project), project)):
        return False
    if before.results.path != str(Path(project.output) / LAST_MOVED):
        return False
    return all(map(is_unchanged, (before.results, *before.inputs)))


def _stats(paths: list[str]) -> dict[str, tuple[int, int]]:
    return {path: read_file_stat(path) for path in paths}


def _states(
    result: Result, folder: Path, before: dict[str, tuple[int, int]]
) -> tuple[FileState, ...] | None:
    """Return the files read by the run, from its provenance; None where one changed meanwhile."""
    states = []
    for one in result.provenance.inputs:
        path = str(folder / one.path)
        size, changed = read_file_stat(path)
        # a table of ties that the run itself found was not there before
        if before.get(path, (size, changed)) != (size, changed) or size != one.size_bytes:
            return None
        states.append(FileState(path=path, size_bytes=size, changed_ns=changed, sha256=one.sha256))
    return tuple(states)


_PROJECTS = (".yaml", ".yml")


def find_projects(wanted: Iterable[str | Path]) -> tuple[Path, ...]:
    """Find project files in the given order, each once.

    Parameters
    ----------
    wanted
        Project files; folders, which stand for every project.yaml in them at any depth; patterns
        with ``*`` and ``**``; and list files, with one of these on each line, relative to the list,
        and ``#`` before remarks.

    Raises
    ------
    InputError
        A named file or folder does not exist, or a pattern matches nothing.
    UavgramError
        There is no project at all.
    """
    named = list(wanted)
    found: dict[Path, Path] = {}
    for one in named:
        for path in _meant(Path(one)):
            found.setdefault(path.resolve(), path)
    if not found:
        raise UavgramError(
            "there is no survey to measure: name project files, folders that hold them, or a "
            "pattern (uavgram batch 'surveys/*/project.yaml')"
        )
    return tuple(found.values())


def _meant(path: Path) -> Iterator[Path]:
    if path.is_dir():
        inside = sorted(path.rglob(PROJECT_FILE))
        if not inside:
            raise InputError(
                path, f"holds no {PROJECT_FILE}, nor does a folder in it: name another"
            )
        yield from inside
    elif not path.exists() and glob.has_magic(str(path)):
        matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207 (absolute ones too)
        if not matches:
            raise InputError(path, "matches no file: correct the pattern (quote it in a shell)")
        for match in matches:
            yield from _meant(Path(match))
    elif path.exists() and path.suffix.lower() not in _PROJECTS:
        yield from _read_list(path)
    elif path.exists():
        yield path
    else:
        raise InputError(path, "there is no such file: correct the name")


def _read_list(path: Path) -> Iterator[Path]:
    """Yield the projects of a list file; report a wrong line with its number."""
    lines = read_text(path, "so it is no list of projects").splitlines()
    for number, line in enumerate(lines, start=1):
        name = line.partition("#")[0].strip()
        if not name:
            continue
        one = path.parent / name
        if one.is_file() and one.suffix.lower() not in _PROJECTS:
            raise InputError(path, f"{name!r} is no project file (.yaml): correct it", number)
        try:
            yield from _meant(one)
        except InputError as fault:
            raise InputError(path, f"{name!r}: {fault.message}", number) from fault


log = logging.getLogger(__name__)

CSV, PARQUET, PAGE = "batch.csv", "batch.parquet", "batch.html"
_MEMORY_SHARE = 0.8
"""Share of the machine's memory for all workers together."""


@dataclass(frozen=True, kw_only=True)
class Resources:
    """Resources of a batch.

    Attributes
    ----------
    workers
        Processes on this machine; None: one for each core.
    memory_mb
        Memory limit of each; None: its share of the machine's memory.
    most_minutes
        Time limit of one survey.
    cluster
        Run on these workers instead.
    """

    workers: int | None = None
    memory_mb: int | None = None
    most_minutes: float = 180.0
    cluster: Cluster | None = None


@dataclass(frozen=True)
class Step:
    """End of a survey: its row, the number of ended ones, the total, and the remaining seconds."""

    row: SurveyRow
    ended: int
    total: int
    seconds_left: float


def run_batch(
    wanted: Sequence[str | Path],
    output: Path,
    asked: Requests | None = None,
    means: Resources | None = None,
    tell: Callable[[Step], None] | None = None,
) -> Batch:
    """Measure many surveys; each writes its own results, the batch one table of all.

    Parameters
    ----------
    wanted
        As for `find_projects`.
    output
        Folder of the table, the page, and the records of earlier surveys.
    asked
        Requests for each survey beside its project file.
    means
        Resources.
    tell
        Called when a survey ends.

    Raises
    ------
    UavgramError
        There is no survey, the scheduler does not answer, or the table cannot be written.
    """
    asked, means = asked or Requests(), means or Resources()
    projects = [str(path.absolute()) for path in find_projects(wanted)]
    known = read_records(output / STATE)
    tasks = [Task(project=one, asked=asked, before=known.get(one)) for one in projects]
    rows = {one: _waiting(one) for one in projects}
    begun = time.monotonic()
    clashes = _find_clashes(tasks)
    try:
        for row, record in _outcomes([one for one in tasks if one.project not in clashes], means):
            rows[row.project] = row
            if record is not None and row.status == "done":
                _record_outcome(output / STATE, record)
            _report_progress(tell, row, rows, begun)
        rows |= {outcome.row.project: outcome.row for outcome in clashes.values()}
    finally:  # at Ctrl+C too: the table then lists the waiting ones
        batch = _batch(tuple(rows.values()), time.monotonic() - begun)
        write_batch(batch, output, projects)
    return batch


def _outcomes(
    tasks: Sequence[Task], means: Resources
) -> Iterator[tuple[SurveyRow, SurveyRecord | None]]:
    for one in _run_tasks(tasks, means):
        outcome = one.value
        if outcome is None:
            outcome = failure_outcome(tasks[one.number], one.why)
        elif means.cluster is not None and outcome.record is not None:
            remove_record(outcome)
        yield replace(outcome.row, tries=one.tries), outcome.record


def _run_tasks(tasks: Sequence[Task], means: Resources) -> Iterator[ItemOutcome[Outcome]]:
    seconds = 60.0 * means.most_minutes
    if means.cluster is not None:
        return run_on_cluster(measure_survey, tasks, means.cluster, seconds, add_present_results)
    workers = means.workers or cores()
    memory = _memory_bytes(workers) if means.memory_mb is None else means.memory_mb * 2**20
    bounds = Bounds(memory_bytes=memory, seconds=seconds)
    return run_in_workers(measure_survey, tasks, workers, bounds)


def _memory_bytes(workers: int) -> int | None:
    """Return a worker's share of the machine's memory; None where the system does not state it."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
    return int(_MEMORY_SHARE * total / workers)


def _find_clashes(tasks: Sequence[Task]) -> dict[str, Outcome]:
    """Find surveys that would overwrite each other's results, with the reason."""
    first: dict[Path, str] = {}
    found: dict[str, Outcome] = {}
    for task in tasks:
        try:
            folder = Path(load_project(Path(task.project)).output).resolve()
        except UavgramError:  # reported when it is run
            continue
        other = first.setdefault(folder, task.project)
        if other != task.project:
            why = (
                f"{task.project}: has the output folder of {other}, {folder}: name another as "
                "`output` in one of the two"
            )
            found[task.project] = failure_outcome(task, why)
    return found


def _waiting(project: str) -> SurveyRow:
    return SurveyRow(
        name=name_of(project),
        project=project,
        status="waiting",
        message="not begun yet, as the batch was interrupted: the same command goes on",
    )


def _report_progress(
    tell: Callable[[Step], None] | None, row: SurveyRow, rows: dict[str, SurveyRow], begun: float
) -> None:
    if tell is None:
        return
    ended = [one for one in rows.values() if one.status != "waiting"]
    # unchanged surveys took no time: leave them out of the estimate
    slow = sum(one.status != "unchanged" for one in ended)
    each = (time.monotonic() - begun) / max(slow, 1)
    tell(Step(row, len(ended), len(rows), each * (len(rows) - len(ended))))


def _record_outcome(path: Path, record: SurveyRecord) -> None:
    """Record a survey; after a failure it is only measured again next time."""
    try:
        append_record(path, record)
    except OSError as fault:
        log.warning(
            "%s: cannot be written (%s): the next run will measure these surveys again",
            path,
            fault.strerror,
        )


def _batch(rows: tuple[SurveyRow, ...], seconds: float) -> Batch:
    made = stamp()
    return Batch(
        rows=rows,
        pooled=pool_fits(rows),
        drifts=find_camera_drifts(rows),
        version=made["version"],
        created_utc=made["created_utc"],
        seconds=seconds,
    )


def write_batch(batch: Batch, folder: Path, inputs: Sequence[str]) -> None:
    """Write the tables and the page, all or none.

    Parameters
    ----------
    batch
        The batch.
    folder
        Output folder.
    inputs
        Files that no output may replace.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    with stage_output(folder, inputs) as hidden:
        write_batch_csv(batch, hidden / CSV)
        write_batch_parquet(batch, hidden / PARQUET)
        page = render_batch_page(batch, folder)
        (hidden / PAGE).write_text(page, encoding="utf-8")

"""Run a batch: find the surveys, measure new ones, and write one table of all."""

from __future__ import annotations

import glob
import logging
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from uavgram.config.project import PROJECT_FILE, load_project
from uavgram.errors import InputError, UavgramError
from uavgram.input_files import read_text
from uavgram.io.exports.batch_tables import write_batch_csv, write_batch_parquet
from uavgram.io.outputs import staged_output
from uavgram.io.results.command_json import STATE, append_record, read_records
from uavgram.model.batch import Batch, SurveyRecord, SurveyRow
from uavgram.pipeline.batch.survey import (
    Outcome,
    Requests,
    Task,
    add_present_results,
    failure_outcome,
    measure_survey,
    name_of,
    remove_record,
)
from uavgram.pipeline.cores import cores
from uavgram.pipeline.executor.cluster import Cluster, on_cluster
from uavgram.pipeline.executor.processes import Bounds, ItemOutcome, in_workers
from uavgram.pipeline.versions import stamp
from uavgram.stages.pooled_statistics import find_camera_drifts, pool_fits
from uavgram.views.batch import render_batch_page

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
        yield from _listed(path)
    elif path.exists():
        yield path
    else:
        raise InputError(path, "there is no such file: correct the name")


def _listed(path: Path) -> Iterator[Path]:
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
    for one in _ended(tasks, means):
        outcome = one.value
        if outcome is None:
            outcome = failure_outcome(tasks[one.number], one.why)
        elif means.cluster is not None and outcome.record is not None:
            remove_record(outcome)
        yield replace(outcome.row, tries=one.tries), outcome.record


def _ended(tasks: Sequence[Task], means: Resources) -> Iterator[ItemOutcome[Outcome]]:
    seconds = 60.0 * means.most_minutes
    if means.cluster is not None:
        return on_cluster(measure_survey, tasks, means.cluster, seconds, add_present_results)
    workers = means.workers or cores()
    memory = _memory_bytes(workers) if means.memory_mb is None else means.memory_mb * 2**20
    bounds = Bounds(memory_bytes=memory, seconds=seconds)
    return in_workers(measure_survey, tasks, workers, bounds)


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
    with staged_output(folder, inputs) as hidden:
        write_batch_csv(batch, hidden / CSV)
        write_batch_parquet(batch, hidden / PARQUET)
        page = render_batch_page(batch, folder)
        (hidden / PAGE).write_text(page, encoding="utf-8")

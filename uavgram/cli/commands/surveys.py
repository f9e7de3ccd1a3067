"""Commands that measure surveys: `uavgram new`, `check`, `run`, `view` and `batch`."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, PROBLEM, VERDICT, Flag, Json, Seed, Verbose, app
from uavgram.cli.terminal import (
    log_to_stderr,
    print_json,
    print_lines,
    print_unchanged,
    print_written_files,
    progress,
    set_project_units,
    set_result,
    warn_of,
)

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


@app.command
def check(project: Path = Path(), /, *, json: Json = False) -> int:
    """Read and validate every input of a project; run nothing.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    json
        Print a JSON object instead of text.
    """
    from uavgram.cli.json_objects import check_object
    from uavgram.pipeline.check import check as check_project
    from uavgram.views.terminal import check_lines

    set_project_units(project)
    checked = check_project(project)
    if json:
        print_json(check_object(checked, project))
        return DONE
    posed = checked.posed
    print_lines(*check_lines(checked.inputs.photos, posed.frames, posed.pairing, checked.messages))
    return DONE


TABLE_ROWS = 40
Rows = Annotated[int, Parameter(validator=validators.Number(gte=0))]
Scale = Annotated[int, Parameter(validator=validators.Number(gte=1, lte=1_000_000))]
Samples = Annotated[
    int, Parameter(name="--monte-carlo", validator=validators.Number(gte=100, lte=1_000_000))
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class PrintOptions:
    """Documents for printing.

    Parameters
    ----------
    pdf
        Write the report as report.pdf too, on this paper: for archives (PDF/A-3b) and for printing.
    plan
        Draw a plan to scale on the ground in the photos: plan.pdf on this paper, plan.png and
        plan.tif.
    plan_scale
        Scale of that plan, on as many sheets as necessary: 100 is 1:100; by default one sheet.
    """

    pdf: Literal["a4", "letter"] | None = None
    plan: Literal["a4", "letter"] | None = None
    plan_scale: Scale | None = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class ProgramOptions:
    """Options for other programs that start this one.

    Parameters
    ----------
    json
        Print a JSON object (verdict, measurements, checks, messages) instead of text.
    fail_on
        Exit with status 3 where the verdict is this or worse, and print it on standard error; the
        results are still written.
    """

    json: Json = False
    fail_on: Literal["red", "amber"] | None = None


@app.command
def run(
    project: Path = Path(),
    /,
    *,
    output: Path | None = None,
    monte_carlo: Samples | None = None,
    seed: Seed = 0,
    rows: Rows = TABLE_ROWS,
    view: Flag = False,
    printed: PrintOptions | None = None,
    programs: ProgramOptions | None = None,
    verbose: Verbose = False,
) -> int:
    """Measure: read the project, adjust, and write all outputs.

    Parameters
    ----------
    project
        The project file, or the folder of a project.yaml; by default the present folder.
    output
        Folder of the outputs; by default the one that the project names.
    monte_carlo
        Repeat the adjustment N times with new random errors, and compare the sigmas.
    seed
        Seed of those draws.
    rows
        Largest number of measurements in the table, least certain first; 0: all of them.
    view
        Open the review in the Rerun viewer afterwards.
    printed
        Documents for printing.
    programs
        Options for other programs that start this one.
    verbose
        Show the progress of the work.
    """
    from uavgram.cli.json_objects import run_object
    from uavgram.config.project import load_project
    from uavgram.model.maps import PlanPaper
    from uavgram.pipeline.measure.compute import Sampling
    from uavgram.pipeline.measure.run import FROM_PROJECT
    from uavgram.pipeline.measure.run import run as run_project
    from uavgram.views.survey.verdict import verdict_sentence
    from uavgram.views.terminal import findings_lines, hidden_rows_line, measurement_table

    log_to_stderr(verbose=verbose)
    set_project_units(project)
    paper = PrintOptions() if printed is None else printed
    plan = None if paper.plan is None else PlanPaper(paper.plan, paper.plan_scale)
    sampling = None if monte_carlo is None else Sampling(monte_carlo, seed)
    target = FROM_PROJECT if output is None else output
    result = run_project(project, target, progress(), sampling, paper.pdf, plan)
    set_result(result)
    folder = Path(load_project(project).output) if output is None else output
    wanted = ProgramOptions() if programs is None else programs
    if wanted.json:
        print_json(run_object(result, folder))
    else:
        print_lines(measurement_table(result, rows), *hidden_rows_line(result, rows, folder))
        print_lines(*findings_lines(result, verbose=verbose))
    if view:
        show_recording(folder / "recording.rrd", web=False)
    fails = {"red": ("red",), "amber": ("red", "amber"), None: ()}[wanted.fail_on]
    level = result.verdict.level
    if level in {"red", "amber"}:
        warn_of(verdict_sentence(result), only_quiet=level not in fails)
    return VERDICT if level in fails else DONE


@app.command
def view(recording: Path, /, *, web: Flag = False) -> int:
    """Open a recording in the Rerun viewer.

    Parameters
    ----------
    recording
        A recording.rrd from an output folder.
    web
        In a browser: serve it to this machine only, and show the address.
    """
    show_recording(recording, web=web)
    return DONE


def show_recording(recording: Path, *, web: bool) -> None:
    """Show a recording until its viewer is closed."""
    from uavgram.views.viewer import open_viewer, serve_viewer

    if not web:
        open_viewer(recording)
        return
    serve_viewer(recording, lambda address: print_lines(f"open {address}", "Ctrl+C ends it"))


if TYPE_CHECKING:
    from uavgram.pipeline.batch import Step
    from uavgram.pipeline.cluster import Cluster

Count = Annotated[int, Parameter(validator=validators.Number(gte=1))]
Minutes = Annotated[float, Parameter(validator=validators.Number(gt=0))]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Scheduler:
    """Workers of other machines.

    Parameters
    ----------
    scheduler
        Address of a Dask scheduler (tcp://host:8786, tls://host:8786): its workers measure. They
        need the same folders under the same names. A scheduler executes everything that it is sent:
        give access only to those who may run programs on its workers.
    tls_ca_file
        Certificate (PEM) of the authority that the scheduler's is checked against.
    tls_cert
        Certificate (PEM) to show to it.
    tls_key
        Key of that certificate.
    """

    scheduler: str | None = None
    tls_ca_file: Path | None = None
    tls_cert: Path | None = None
    tls_key: Path | None = None


@app.command
def batch(
    *projects: Path,
    output: Path = Path("uavgram-batch"),
    workers: Count | None = None,
    memory_mb: Count | None = None,
    most_minutes: Minutes = 180.0,
    pdf: Literal["a4", "letter"] | None = None,
    scheduler: Scheduler | None = None,
    verbose: Verbose = False,
) -> int:
    """Measure many surveys, and put all of them into one table.

    Each survey's results go to the folder in its project. An unchanged survey is not measured
    again; so after Ctrl+C the same command continues.

    Parameters
    ----------
    projects
        Project files, folders (with every project.yaml in them), patterns in quotes
        ('2026/**/project.yaml'), and text files that list these line by line.
    output
        Folder of batch.html, batch.csv and batch.parquet.
    workers
        Surveys measured at a time on this machine; by default one for each core.
    memory_mb
        Memory limit of each of them; by default its share of the machine's. A cluster's workers
        have limits of their own (dask worker --nthreads 1 --memory-limit 8GB).
    most_minutes
        Time limit of one survey; after it the survey is given up, and the others continue.
    pdf
        Write each report as report.pdf too, on this paper.
    scheduler
        Workers of other machines.
    verbose
        Show the progress of the work.
    """
    from uavgram.pipeline.batch import CSV, PAGE, PARQUET, Requests, Resources, run_batch
    from uavgram.views.batch import summarise_batch

    log_to_stderr(verbose=verbose)
    means = Resources(
        workers=workers,
        memory_mb=memory_mb,
        most_minutes=most_minutes,
        cluster=_cluster(scheduler),
    )
    found = run_batch(projects, output, Requests(pdf=pdf), means, _print_row)
    words = summarise_batch(found)
    print_unchanged("", words.sentence, *(f"  {reason}" for reason in words.reasons))
    print_written_files(output, (PAGE, CSV, PARQUET))
    return PROBLEM if found.count("failed") else DONE


def _print_row(step: Step) -> None:
    from uavgram.views.batch import format_time_left, survey_line

    left = f"; {format_time_left(step.seconds_left)}" if step.ended < step.total else ""
    print_unchanged(f"[{step.ended}/{step.total}{left}] {survey_line(step.row)}")


def _cluster(asked: Scheduler | None) -> Cluster | None:
    from uavgram.errors import UavgramError
    from uavgram.pipeline.cluster import Cluster

    if asked is None:
        return None
    files = (asked.tls_ca_file, asked.tls_cert, asked.tls_key)
    if asked.scheduler is None:
        if any(files):
            raise UavgramError("--tls-... files are for a cluster: name its --scheduler too")
        return None
    ca, cert, key = (None if one is None else str(one.absolute()) for one in files)
    return Cluster(address=asked.scheduler, tls_ca_file=ca, tls_cert=cert, tls_key=key)

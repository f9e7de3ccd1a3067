"""Command `uavgram batch`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, PROBLEM, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_unchanged, print_written_files

if TYPE_CHECKING:
    from uavgram.pipeline.batch.run import Step
    from uavgram.pipeline.executor.cluster import Cluster

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
    from uavgram.pipeline.batch.run import CSV, PAGE, PARQUET, Resources, run_batch
    from uavgram.pipeline.batch.survey import Requests
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
    from uavgram.pipeline.executor.cluster import Cluster

    if asked is None:
        return None
    files = (asked.tls_ca_file, asked.tls_cert, asked.tls_key)
    if asked.scheduler is None:
        if any(files):
            raise UavgramError("--tls-... files are for a cluster: name its --scheduler too")
        return None
    ca, cert, key = (None if one is None else str(one.absolute()) for one in files)
    return Cluster(address=asked.scheduler, tls_ca_file=ca, tls_cert=cert, tls_key=key)

"""Command `uavgram study`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_lines, print_written_files, progress

Draws = Annotated[int, Parameter(validator=validators.Number(gte=20, lte=1_000_000))]
Workers = Annotated[int, Parameter(validator=validators.Number(gte=0, lte=256))]


@app.command
def study(
    name: str,
    /,
    *,
    repetitions: Draws = 2000,
    workers: Workers = 0,
    output: Path = Path("uavgram-study"),
    verbose: Verbose = False,
) -> int:
    """Study which errors matter most, where, and where not: predicted and simulated.

    Parameters
    ----------
    name
        lengths, picks, view, camera or methods; or all.
    repetitions
        Draws of each condition.
    workers
        Processes; 0: as many as there are cores.
    output
        Folder of the page, the figures and the numbers.
    verbose
        Show the progress of the work.
    """
    from uavgram.synthetic.study import JSON_FILE, PAGE_FILE, list_studies, make_studies
    from uavgram.views.study import describe_study

    log_to_stderr(verbose=verbose)
    names = list_studies(name)
    for found in make_studies(names, output, repetitions, workers, progress()):
        print_lines(
            "",
            f"{found.title} ({found.seconds:.0f} s)",
            *(f"  {text}" for text in describe_study(found)),
        )
    figures = [f"{one}.{kind}" for one in names for kind in ("svg", "png")]
    print_written_files(output, [JSON_FILE, PAGE_FILE, *figures])
    return DONE

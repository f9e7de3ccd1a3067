"""The command line: arguments -> one call of the pipeline -> exit status."""

from __future__ import annotations

import io
import logging
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import cyclopts
from cyclopts import App, Parameter, validators

from uavgram.errors import UavgramError

if TYPE_CHECKING:
    from uavgram.pipeline.progress import Progress

Item = TypeVar("Item")
Verbose = Annotated[bool, Parameter(name=["--verbose", "-v"], negative=())]
Seed = Annotated[int, Parameter(validator=validators.Number(gte=0))]
Samples = Annotated[
    int, Parameter(name="--monte-carlo", validator=validators.Number(gte=100, lte=1_000_000))
]

DONE, PROBLEM, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130

app = App(
    name="uavgram",
    help="Ground measurements with honest uncertainties from a drone's photos, its flight log and "
    "a few taped lengths.",
    help_format="plaintext",
    version_flags=["--version"],
    print_error=False,  # `main` tells every error in one form
    exit_on_error=False,
    suppress_keyboard_interrupt=False,
    result_action="return_value",
)


@app.command
def run(
    project: Path,
    /,
    *,
    output: Path | None = None,
    monte_carlo: Samples | None = None,
    seed: Seed = 0,
    verbose: Verbose = False,
) -> int:
    """Measure: read the project, adjust, and write all outputs.

    Parameters
    ----------
    project
        The project file (project.yaml).
    output
        Folder of the outputs; by default the one that the project names.
    monte_carlo
        Repeat the adjustment N times with everything drawn anew, and compare the sigmas.
    seed
        Of those draws.
    verbose
        Say what is being done.
    """
    from uavgram.pipeline.compute import Sampling
    from uavgram.pipeline.run import FROM_PROJECT
    from uavgram.pipeline.run import run as run_project
    from uavgram.views.table import measurement_table, message_lines

    _log_to_stderr(verbose=verbose)
    sampling = None if monte_carlo is None else Sampling(monte_carlo, seed)
    result = run_project(project, FROM_PROJECT if output is None else output, _progress(), sampling)
    _say(measurement_table(result), "", *message_lines(result))
    return DONE


@app.command
def demo(
    *,
    output: Path = Path("uavgram-demo"),
    scenario: Path | None = None,
    seed: Seed | None = None,
    verbose: Verbose = False,
) -> int:
    """Write the built-in survey (flight, photos, log, picks), run it, and compare with its truth.

    Parameters
    ----------
    output
        Folder of the survey; its results go to DIR/out.
    scenario
        Another survey than the built-in one, such as an edited configs/demo.yaml.
    seed
        Of the random errors; by default always the same survey.
    verbose
        Say what is being done.
    """
    from uavgram.config.scenario import load_scenario
    from uavgram.model.scene import DemoScenario
    from uavgram.pipeline.demo import demo as run_demo
    from uavgram.views.table import message_lines, truth_table

    _log_to_stderr(verbose=verbose)
    survey = DemoScenario() if scenario is None else load_scenario(scenario)
    survey = survey if seed is None else survey.with_seed(seed)
    result, truth, project = run_demo(output, survey, _progress())
    recording = project.parent / "out" / "recording.rrd"
    _say(truth_table(result, truth), "", *message_lines(result))
    _say("", f"project:   {project}", f"results:   {recording.with_name('results.json')}")
    _say(f"report:    {recording.with_name('report.html')}", f"look:      uavgram view {recording}")
    return DONE


@app.command
def check(project: Path, /) -> int:
    """Read and validate every input of a project; run nothing.

    Parameters
    ----------
    project
        The project file (project.yaml).
    """
    from uavgram.pipeline.check import check as check_project
    from uavgram.views.table import check_lines

    checked = check_project(project)
    posed = checked.posed
    _say(*check_lines(checked.inputs.photos, posed.frames, posed.pairing, checked.messages))
    return DONE


@app.command(name="log")
def show_log(
    file: Path,
    /,
    *,
    json: Annotated[bool, Parameter(negative=())] = False,
    plot: Path | None = None,
) -> int:
    """Say what is in a flight log: span, vehicle, boots, messages, clock, camera events.

    Parameters
    ----------
    file
        ArduPilot DataFlash .bin/.BIN/.log, MAVLink .tlog, or PX4 .ulg.
    json
        Print a JSON object instead of text.
    plot
        Also draw track, heights, clock and camera events to this PNG.
    """
    from uavgram.io.flight_log import read_flight_log
    from uavgram.io.outputs import replace_bytes
    from uavgram.stages.log_summary import summarise_log
    from uavgram.views.log_json import log_summary_json
    from uavgram.views.log_summary import log_summary_lines

    summary = summarise_log(read_flight_log(file, positions_needed=False))
    if plot is not None:
        from uavgram.views.log_plot import log_plot_png

        replace_bytes(plot, log_plot_png(summary))
    _say(log_summary_json(summary)) if json else _say(*log_summary_lines(summary))
    return DONE


@app.command
def geotag(
    project: Path,
    /,
    *,
    output: Path | None = None,
    poses: Literal["seed", "refined"] = "refined",
    exif: bool = False,
) -> int:
    """Hand the photos' poses over: geo.txt (OpenDroneMap), pix4d.csv, and tagged copies.

    Parameters
    ----------
    project
        The project file (project.yaml).
    output
        Folder of the files; by default `geotag` in the project's output folder.
    poses
        As adjusted (refined), or as the log or the photos have them (seed).
    exif
        Also write copies of the photos with the pose in EXIF and XMP; the originals stay as they
        are.
    """
    from uavgram.pipeline.geotag import geotag as write_tags
    from uavgram.views.table import geotag_lines

    done = write_tags(project, output, poses, exif=exif, progress=_progress())
    _say(*geotag_lines(done.tags, done.messages), "", f"written:   {done.folder}")
    _say(*(f"           {name}" for name in done.files))
    return DONE


@app.command
def view(recording: Path, /) -> int:
    """Open a recording in the Rerun viewer.

    Parameters
    ----------
    recording
        A recording.rrd from an output folder.
    """
    from uavgram.views.viewer import open_viewer

    open_viewer(recording)
    return DONE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    0: done; 1: a problem that the user can solve, told in one message; 2: wrong usage. Anything
    else is a bug and keeps its traceback.
    """
    try:
        status = app(arguments)
    except cyclopts.CycloptsError as error:
        sys.stderr.write(f"uavgram: {error}\nTry: uavgram --help\n")
        return WRONG_USAGE
    except UavgramError as error:
        sys.stderr.write(f"uavgram: {error}\n")
        return PROBLEM
    except BrokenPipeError:  # who reads our output has left (head, less): the files are written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except KeyboardInterrupt:
        sys.stderr.write("uavgram: interrupted; earlier results are as they were\n")
        return INTERRUPTED
    return status if isinstance(status, int) else DONE


def _say(*lines: str) -> None:
    if isinstance(sys.stdout, io.TextIOWrapper):  # a terminal without ± is no reason to fail
        sys.stdout.reconfigure(errors="replace")
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def _log_to_stderr(*, verbose: bool) -> None:
    level = logging.INFO if verbose else logging.WARNING
    logging.basicConfig(stream=sys.stderr, level=level, format="%(message)s", force=True)


def _progress() -> Progress:
    """Progress bars on a terminal, nothing elsewhere."""
    from uavgram.pipeline.progress import silent

    if not sys.stderr.isatty():
        return silent
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)

    def bar(items: Iterable[Item], what: str, total: int, /) -> Iterable[Item]:
        return track(items, description=what, total=total, console=console, transient=True)

    return bar


if __name__ == "__main__":
    sys.exit(main())

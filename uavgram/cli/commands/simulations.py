"""Commands on surveys with known truth: `uavgram demo`, `simulate` and `study`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Flag, Seed, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_lines, print_written_files, progress
from uavgram.errors import UavgramError

if TYPE_CHECKING:
    from uavgram.model.camera import Calibration
    from uavgram.synthetic.scenario import Scenario


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
        Seed of the random errors; by default always the same survey.
    verbose
        Show the progress of the work.
    """
    from uavgram.synthetic.scenario import Scenario
    from uavgram.synthetic.scenario_file import read_world

    log_to_stderr(verbose=verbose)
    if scenario is not None:
        world = read_world(scenario, seed)
        return show_survey(output, world.scenario, world.calibration, verbose=verbose)
    survey = Scenario() if seed is None else Scenario().replace_seed(seed)
    return show_survey(output, survey, verbose=verbose)


def show_survey(
    output: Path, survey: Scenario, calibration: Calibration | None = None, *, verbose: bool
) -> int:
    """Write a simulated survey, run it, and compare with its truth.

    Parameters
    ----------
    output
        Folder of the survey.
    survey, calibration
        Simulated survey, and its camera if it is from a file.
    verbose
        Whether every message is shown.
    """
    from uavgram.synthetic.demo import run_demo
    from uavgram.views.terminal import findings_lines, truth_table

    result, truth, project = run_demo(output, survey, progress(), calibration)
    recording = project.parent / "out" / "recording.rrd"
    print_lines(truth_table(result, truth), *findings_lines(result, verbose=verbose))
    print_lines("", f"project:   {project}", f"results:   {recording.with_name('results.json')}")
    print_lines(
        f"report:    {recording.with_name('report.html')}", f"look:      uavgram view {recording}"
    )
    return DONE


if TYPE_CHECKING:
    from uavgram.synthetic.simulate import SimulationRequest
    from uavgram.synthetic.survey import World

Repetitions = Annotated[int, Parameter(validator=validators.Number(gte=2, lte=100_000))]


@app.command
def simulate(
    scenario: Path | None = None,
    /,
    *,
    from_: Annotated[Path | None, Parameter(name="--from")] = None,
    repetitions: Repetitions = 100,
    compare: Flag = False,
    photos: Flag = False,
    output: Path = Path("uavgram-simulation"),
    seed: Seed | None = None,
    verbose: Verbose = False,
) -> int:
    """Repeat a survey with known truth many times, to find the real size of its errors.

    Parameters
    ----------
    scenario
        The survey: an edited configs/demo.yaml. With --from optional additions to the real survey:
        name, seed, lines (name, start, end) between picked points, tape_m.
    from_
        Project of a real survey: its adjusted poses and points are the truth of the repetitions.
    repetitions
        Number of surveys that are drawn, each run as a real one.
    compare
        Also without the errors of the scenario, and with each of them alone.
    photos
        Instead write the scenario once, as a folder with photos and flight log, and run that.
    output
        Folder of the results, or of that survey.
    seed
        Seed of the draws, instead of the scenario's.
    verbose
        Show the progress of the work.
    """
    from uavgram.synthetic.resurvey import read_project_world
    from uavgram.synthetic.scenario_file import read_world
    from uavgram.synthetic.simulate import SimulationRequest

    log_to_stderr(verbose=verbose)
    asked = SimulationRequest(repetitions, compare)
    if from_ is not None:
        if photos:
            raise UavgramError("--photos is for scenarios: a real survey has its photos already")
        return _show(from_, read_project_world(from_, scenario, seed), asked, output)
    if scenario is None:
        raise UavgramError(
            "there is nothing to repeat: name a scenario file (uavgram simulate SCENARIO.yaml, "
            "such as an edited configs/demo.yaml), or a real survey by --from PROJECT.yaml"
        )
    world = read_world(scenario, seed)
    if photos:
        return show_survey(output, world.scenario, world.calibration, verbose=verbose)
    return _show(scenario, world, asked, output)


def _show(source: Path, world: World, asked: SimulationRequest, output: Path) -> int:
    """Repeat the survey, write the results, and show them."""
    from uavgram.synthetic.simulate import simulate_many, write_outputs
    from uavgram.views.simulation import simulation_lines

    found = simulate_many(source, world, asked, progress(), print_lines)
    written = write_outputs(found, output, source)
    print_lines("", *simulation_lines(found))
    print_written_files(output, written)
    return DONE


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

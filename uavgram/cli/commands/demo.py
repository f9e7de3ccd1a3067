"""Command `uavgram demo`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from uavgram.cli.application import DONE, Seed, Verbose, app
from uavgram.cli.terminal import log_to_stderr, print_lines, progress

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
    survey = Scenario() if seed is None else Scenario().with_seed(seed)
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

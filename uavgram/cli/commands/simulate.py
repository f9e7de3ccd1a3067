"""`uavgram simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators

from uavgram.cli.application import DONE, Flag, Seed, Verbose, app
from uavgram.cli.terminal import log_to_stderr, progress, say, say_written

Repetitions = Annotated[int, Parameter(validator=validators.Number(gte=2, lte=100_000))]


@app.command
def simulate(
    scenario: Path,
    /,
    *,
    repetitions: Repetitions = 100,
    compare: Flag = False,
    photos: Flag = False,
    output: Path = Path("uavgram-simulation"),
    seed: Seed | None = None,
    verbose: Verbose = False,
) -> int:
    """Repeat a survey with known truth many times: how large its errors really are.

    Parameters
    ----------
    scenario
        The survey: an edited configs/demo.yaml.
    repetitions
        How many surveys are drawn, each run as a real one.
    compare
        Also with nothing amiss, and with each thing alone that the scenario has amiss.
    photos
        Instead write one of them as a folder with photos and flight log, and run it.
    output
        Folder of the results, or of that survey.
    seed
        Of the draws, in place of the scenario's.
    verbose
        Say what is being done.
    """
    from uavgram.pipeline.simulate.run import Asked, simulate_many, write_outputs
    from uavgram.pipeline.simulate.scenario import read_world
    from uavgram.views.simulation.text import simulation_lines

    log_to_stderr(verbose=verbose)
    world = read_world(scenario, seed)
    if photos:
        from uavgram.cli.commands.demo import show_survey

        return show_survey(output, world.scenario, world.calibration, verbose=verbose)
    asked = Asked(repetitions, compare)
    found = simulate_many(scenario, world, asked, progress(), say)
    written = write_outputs(found, output, scenario)
    say("", *simulation_lines(found))
    say_written(output, written)
    return DONE

"""`uavgram simulate`: a survey many times over, and what came out in a folder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from uavgram.errors import InputError, UavgramError
from uavgram.estimation.repeated.accuracy import accuracy_of, running_ratio
from uavgram.io.outputs import staged_output
from uavgram.io.results.simulation_json import write_simulation
from uavgram.model.scenario.as_stated import unlike_stated
from uavgram.model.scenario.ground import GroundSpec
from uavgram.model.scenario.habits import HabitSpec
from uavgram.model.scenario.scenario import Scenario
from uavgram.model.simulation.repetitions import Repetitions, Simulation, Variant
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.simulate.repeat import Heard, repeat
from uavgram.pipeline.simulate.worlds import ScenarioWorld, World
from uavgram.views.simulation.page import write_simulation_page

JSON_FILE, PAGE_FILE = "simulation.json", "simulation.html"
CLEAN = "nothing amiss"


@dataclass(frozen=True)
class Asked:
    """What is asked for: how many repetitions, and whether they are compared with clean ones."""

    repetitions: int
    compare: bool = False


def simulate_many(
    source: Path,
    world: World,
    asked: Asked,
    progress: Progress = silent,
    heard: Heard | None = None,
) -> Simulation:
    """Repeat a survey, and the same without what is amiss where that is asked for.

    Parameters
    ----------
    source
        The file that the world comes from.
    world
        What is repeated.
    asked
        How often.
    progress, heard
        Show how far it is.

    Raises
    ------
    InputError
        Not even without noise the survey has a result, or there is nothing to compare.
    """
    others = _others(source, world) if asked.compare else {}
    try:
        found = repeat(world, asked.repetitions, progress, heard)
        compared = tuple(
            _variant(name, other, asked.repetitions, progress) for name, other in others.items()
        )
    except UavgramError as fault:
        raise InputError(source, f"has no result, not even without errors: {fault}") from fault
    name, seed = world.named()
    return Simulation(
        name=name,
        seed=seed,
        source=source.name,
        repetitions=found,
        accuracy=accuracy_of(found),
        variants=compared,
        running=tuple(_running(found)),
        unlike=unlike_stated(world.scenario) if isinstance(world, ScenarioWorld) else (),
        amiss=tuple(_apart(world.scenario)[1]) if isinstance(world, ScenarioWorld) else (),
    )


def write_outputs(simulation: Simulation, folder: Path, source: Path) -> tuple[str, ...]:
    """Write all of a simulation at once; names of the files.

    Parameters
    ----------
    simulation
        What came out.
    folder
        Where to.
    source
        Which no output may replace.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    with staged_output(folder, [source]) as hidden:
        write_simulation(simulation, hidden / JSON_FILE)
        write_simulation_page(simulation, hidden / PAGE_FILE)
    return JSON_FILE, PAGE_FILE


def _running(found: Repetitions) -> Iterator[tuple[int, float]]:
    """Spread over prediction after more and more repetitions."""
    count = len(found.number)
    steps = sorted({round(count ** (k / 40)) for k in range(41)} | {count})
    for step in steps:
        if step > 2:
            yield step, running_ratio(found, step)


def _others(source: Path, world: World) -> dict[str, World]:
    """The worlds to compare with, by what is amiss in them."""
    if not isinstance(world, ScenarioWorld):
        raise InputError(source, "comparing is for scenarios: a real survey has nothing amiss")
    others = {name: replace(world, scenario=one) for name, one in variants(world.scenario)}
    if not others:
        raise InputError(
            source,
            "has nothing amiss that could be compared: write something under habits, a shape or "
            "relief under ground, or errors.readout_ms or identification_m",
        )
    return dict(others)


def _variant(name: str, world: World, count: int, progress: Progress) -> Variant:
    """The same draws in another world."""
    found = repeat(world, count, progress, what=f"the same with {name}")
    return Variant(name=name, repetitions=found, accuracy=accuracy_of(found))


def variants(scenario: Scenario) -> Iterator[tuple[str, Scenario]]:
    """A scenario with nothing amiss, and with each thing that is amiss alone; nothing if clean.

    Parameters
    ----------
    scenario
        Whose habits, ground, readout and identification are taken apart.
    """
    clean, alone = _apart(scenario)
    if alone:
        yield CLEAN, clean
    if len(alone) > 1:
        yield from alone.items()


def _apart(scenario: Scenario) -> tuple[Scenario, dict[str, Scenario]]:
    """A scenario with nothing amiss, and with each thing alone, by its key."""
    errors, ground, habits = scenario.errors, scenario.ground, scenario.habits
    even = GroundSpec(height_sigma_m=ground.height_sigma_m, slope_sigma_deg=ground.slope_sigma_deg)
    clean = replace(
        scenario,
        errors=replace(errors, readout_ms=0.0, identification_m=0.0),
        ground=even,
        habits=HabitSpec(),
    )
    alone: dict[str, Scenario] = {}
    for name in ("slope_deg", "crown_percent", "slope_break_percent", "kerb_m", "relief_m"):
        if value := getattr(ground, name):
            shaped = replace(
                even,
                **{name: value},
                kerb_y_m=ground.kerb_y_m,
                relief_length_m=ground.relief_length_m,
            )
            alone[f"ground.{name}"] = replace(clean, ground=shaped)
    for name in ("readout_ms", "identification_m"):
        if value := getattr(errors, name):
            alone[f"errors.{name}"] = replace(clean, errors=replace(clean.errors, **{name: value}))
    for name in habits.names():
        alone[f"habits.{name}"] = replace(clean, habits=habits.only(name))
    return clean, alone

"""Repeat a survey many times: draw it, run it through the real stages, compare with its truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from uavgram.errors import InputError, UavgramError
from uavgram.estimation.repeated.accuracy import accuracy_of, running_ratio
from uavgram.io.outputs import staged_output
from uavgram.io.results.simulation_json import write_simulation
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.model.simulation import (
    Repetition,
    Repetitions,
    Simulation,
    Unlike,
    Variant,
)
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.parallel import in_processes
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.threads import one_blas_thread
from uavgram.synthetic.errors import HabitSpec
from uavgram.synthetic.inputs import Drawn, ScenarioWorld, World
from uavgram.synthetic.scenario import GroundSpec, Scenario
from uavgram.views.simulation.page import write_simulation_page

OF_THE_LOG = {
    "position_bias_m": "position_bias_sigma_m",
    "heading_bias_deg": "heading_bias_sigma_deg",
    "boresight_deg": "boresight_sigma_deg",
    "lever_arm_sigma_m": "lever_arm_sigma_m",
}
"""Keys of ``errors`` and of ``stated`` that are one thing, of which only a log's user asks."""

TAPE = {"tape_scale": "tape_scale_sigma"}
SAME = 1e-3
"""Shares of a sigma by which two are the same."""


def unlike_stated(scenario: Scenario) -> tuple[Unlike, ...]:
    """What a scenario draws otherwise than its project states it: its ± is wrong by that.

    Parameters
    ----------
    scenario
        Its errors, its site, its ground, and what it states.
    """
    errors, stated, site, ground = scenario.errors, scenario.stated, scenario.site, scenario.ground
    pairs = {
        f"errors.{key}": (getattr(errors, key), getattr(stated, other))
        for key, other in _keys(scenario).items()
    }
    if scenario.telemetry != "none":
        # Stated is level ground at the height of home; where it always lies is an error too.
        height = np.hypot(ground.height_sigma_m, site.ground_height_m)
        slope = np.hypot(ground.slope_sigma_deg, np.linalg.norm(site.ground_slope_deg) / np.sqrt(2))
        pairs["ground.height_sigma_m"] = float(height), stated.ground_height_sigma_m
        pairs["ground.slope_sigma_deg"] = float(slope), stated.ground_slope_sigma_deg
    found = (Unlike(key, _each(drawn), _each(says)) for key, (drawn, says) in pairs.items())
    return tuple(one for one in found if not np.allclose(one.drawn, one.stated, rtol=SAME))


def as_stated(scenario: Scenario) -> Scenario:
    """The scenario, with each thing drawn from what the project states of it.

    Parameters
    ----------
    scenario
        What is taken from `unlike_stated` is replaced.
    """
    errors, stated, ground = scenario.errors, scenario.stated, scenario.ground
    drawn = {key: getattr(stated, other) for key, other in _keys(scenario).items()}
    scenario = replace(scenario, errors=replace(errors, **drawn))
    if scenario.telemetry == "none":
        return scenario
    return replace(
        scenario,
        site=replace(scenario.site, ground_height_m=0.0, ground_slope_deg=(0.0, 0.0)),
        ground=replace(
            ground,
            height_sigma_m=stated.ground_height_sigma_m,
            slope_sigma_deg=stated.ground_slope_sigma_deg,
        ),
    )


def _keys(scenario: Scenario) -> dict[str, str]:
    return TAPE if scenario.telemetry == "none" else OF_THE_LOG | TAPE


def _each(value: float | tuple[float, ...]) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


Heard = Callable[[str], None]


def predicted_sigmas(world: World) -> tuple[tuple[str, ...], tuple[str, ...], Floats]:
    """Names, units and sigmas (M,) to expect: of the survey without noise, in the real likelihood.

    Parameters
    ----------
    world
        What is to be repeated.

    Raises
    ------
    UavgramError
        Not even without noise there is a result.
    """
    drawn = world.exact()
    with one_blas_thread():
        result = compute(drawn.inputs, posed=drawn.posed, curved=False).result
    _, sigma = _measured(result, drawn)
    return drawn.name, drawn.unit, sigma


def repeat(
    world: World,
    count: int,
    progress: Progress = silent,
    heard: Heard | None = None,
    *,
    what: str = "repeating the survey",
) -> Repetitions:
    """Repeat a survey with known truth.

    Parameters
    ----------
    world
        What is repeated; repetitions are numbered from 0.
    count
        How many times.
    progress
        Shows the loop.
    heard
        Is told now and then how far the simulation has come to rest.
    what
        Name of the loop.

    Raises
    ------
    UavgramError
        Not even without noise there is a result.
    """
    name, unit, sigma = predicted_sigmas(world)
    rows: list[Repetition] = []
    made = in_processes(partial(one_repetition, world), range(count))
    for row in progress(made, what, count):
        rows.append(row)
        if heard is not None and len(rows) in _milestones(count):
            heard(_standing(gathered(rows, name, unit, sigma)))
    return gathered(rows, name, unit, sigma)


def one_repetition(world: World, number: int) -> Repetition:
    """Draw a survey, run it, and compare; what has no result says why.

    Parameters
    ----------
    world, number
        What is drawn.
    """
    drawn = world.drawn(number)
    try:
        with one_blas_thread():
            result = compute(drawn.inputs, posed=drawn.posed, curved=False).result
    except UavgramError as fault:
        return Repetition(number=number, failure=str(fault))
    value, sigma = _measured(result, drawn)
    return Repetition(
        number=number,
        true=tuple(drawn.true.tolist()),
        value=tuple(value.tolist()),
        sigma=tuple(sigma.tolist()),
        level=result.verdict.level,
        converged=result.solution.converged,
        codes=tuple(sorted({m.code for m in result.messages if m.level != "info"})),
    )


def gathered(
    rows: Sequence[Repetition], name: tuple[str, ...], unit: tuple[str, ...], predicted: Floats
) -> Repetitions:
    """Repetitions as arrays.

    Parameters
    ----------
    rows
        In any order.
    name, unit, predicted
        (M,) of the values.
    """
    rows = sorted(rows, key=lambda row: row.number)
    nothing = (float("nan"),) * len(name)

    def column(values: Iterator[tuple[float, ...]]) -> Floats:
        return np.array([value or nothing for value in values]).reshape(-1, len(name))

    return Repetitions(
        name=name,
        unit=unit,
        predicted=predicted,
        number=np.array([row.number for row in rows], dtype=np.int64),
        true=column(row.true for row in rows),
        value=column(row.value for row in rows),
        sigma=column(row.sigma for row in rows),
        level=tuple(row.level for row in rows),
        failure=tuple(row.failure for row in rows),
        converged=np.array([row.converged for row in rows], dtype=np.bool_),
        codes=tuple(row.codes for row in rows),
    )


def _measured(result: Result, drawn: Drawn) -> tuple[Floats, Floats]:
    """Values and sigmas (M,) in the order of the truth; NaN where there is none.

    In a world that nothing ties to the earth coordinates mean nothing.
    """
    table, free = result.measurements, result.world.gauge == "plane"
    row = {name: i for i, name in enumerate(table.name)}
    found = [
        row[name] if name in row and not (free and table.kind[row[name]] == "coordinate") else -1
        for name in drawn.name
    ]
    value, sigma = np.append(table.value, np.nan), np.append(table.sigma, np.nan)
    return value[found], sigma[found]


def _milestones(count: int) -> set[int]:
    """After how many repetitions it is told how things stand."""
    steps = {first * 10**power for power in range(1, 7) for first in (1, 2, 5)}
    return {step for step in steps if step < count}


def _standing(repetitions: Repetitions) -> str:
    """How far a simulation has come to rest, in a line."""
    count = len(repetitions.number)
    ratio = running_ratio(repetitions, count)
    # Of one value's spread from n normal errors: sigma / sqrt(2 (n - 1)); values go together.
    sure = 1.96 / np.sqrt(2.0 * max(count - 1, 1))
    lost = repetitions.failed + repetitions.unsettled
    missing = f"; {lost} without a result" if lost else ""
    return f"{count} repetitions: spread {ratio:.2f} ± {sure:.2f} of what is predicted{missing}"


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

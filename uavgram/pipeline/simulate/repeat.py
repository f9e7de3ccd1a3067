"""Repetitions of a survey: each drawn, run through the real stages, and compared with its truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from uavgram.errors import UavgramError
from uavgram.estimation.repeated.accuracy import running_ratio
from uavgram.model.arrays import Floats
from uavgram.model.result.result import Result
from uavgram.model.simulation.repetitions import Repetition, Repetitions
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.parallel import in_processes
from uavgram.pipeline.progress import Progress, silent
from uavgram.pipeline.simulate.worlds import Drawn, World
from uavgram.pipeline.threads import one_blas_thread

Heard = Callable[[str], None]


def predicted(world: World) -> tuple[tuple[str, ...], tuple[str, ...], Floats]:
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
    name, unit, sigma = predicted(world)
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

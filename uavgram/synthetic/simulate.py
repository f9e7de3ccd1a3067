"""Repeated simulation of a survey: draw, run through the real stages, compare with the truth."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.special import betaincinv, chdtri, stdtrit

from uavgram.errors import InputError, UavgramError
from uavgram.io.json_codec import Record, encode, records
from uavgram.io.outputs import stage_output
from uavgram.model.arrays import Bools, Floats, Ints
from uavgram.model.result.result import Result
from uavgram.model.simulation import (
    COVERAGE_SIGMAS,
    Accuracy,
    Repetition,
    Repetitions,
    SigmaMismatch,
    Simulation,
    Variant,
)
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.parallel import Progress, run_in_processes, silent
from uavgram.pipeline.threads import one_blas_thread
from uavgram.synthetic.errors import FixedErrors
from uavgram.synthetic.scenario import GroundSpec, Scenario
from uavgram.synthetic.survey import DrawnSurvey, ScenarioWorld, World
from uavgram.views.simulation import render_simulation_page

TAIL_PROBABILITY = 0.025
"""Probability on each side of a confidence interval."""


def compute_accuracy(repetitions: Repetitions) -> Accuracy:
    """Compute the accuracy of each value from the repetitions.

    Bias by Student's t, spread and z by chi-square, shares by Clopper and Pearson (Biometrika 26,
    1934): all exact for normal errors.

    Parameters
    ----------
    repetitions
        Repetitions, whose counted values are used.
    """
    counted = repetitions.counted
    error = np.where(counted, repetitions.value - repetitions.true, np.nan)
    ratio = error / np.where(counted, repetitions.sigma, np.nan)
    count = counted.sum(axis=0)
    bias, spread = _moments(error, count)
    with np.errstate(invalid="ignore", divide="ignore"):
        half = stdtrit(np.maximum(count - 1, 1), 1.0 - TAIL_PROBABILITY) * spread / np.sqrt(count)
    z = compute_rms(ratio, counted)
    # Share of errors within k stated sigmas.
    within = np.stack([(np.abs(ratio) <= k).sum(axis=0) for k in COVERAGE_SIGMAS], axis=1)
    share, share_range = compute_share_intervals(within, count[:, None])
    return Accuracy(
        count=count,
        bias=bias,
        bias_range=np.stack([bias - half, bias + half], axis=1),
        spread=spread,
        spread_range=compute_sigma_interval(spread, count - 1),
        stated=compute_rms(repetitions.sigma, counted),
        coverage=share,
        coverage_range=share_range,
        z=z,
        z_range=compute_sigma_interval(z, count),
    )


def compute_running_ratio(repetitions: Repetitions, count: int) -> float:
    """Compute the RMS, over the values, of spread over predicted sigma after `count` repetitions.

    NaN as long as it is undetermined.
    """
    counted = repetitions.counted[:count]
    error = np.where(counted, (repetitions.value - repetitions.true)[:count], np.nan)
    _, spread = _moments(error, counted.sum(axis=0))
    ratio = spread / repetitions.predicted
    known = ratio[np.isfinite(ratio)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def compute_rms(value: Floats, counted: Bools) -> Floats:
    """Compute the (M,) RMS of the counted ones of (N, M); NaN if there is none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        total = np.where(counted, value, 0.0) ** 2
        return np.asarray(np.sqrt(total.sum(axis=0) / counted.sum(axis=0)))


def compute_sigma_interval(sigma: Floats, degrees: Ints) -> Floats:
    """Compute (..., 2) confidence intervals of the true sigma from estimates and their degrees.

    s sqrt(n / chi2(1 - p)) to s sqrt(n / chi2(p)); NaN without any.
    """
    known = degrees > 0
    free = np.maximum(degrees, 1).astype(np.float64)
    low = np.sqrt(free / chdtri(free, TAIL_PROBABILITY))
    high = np.sqrt(free / chdtri(free, 1.0 - TAIL_PROBABILITY))
    factor = np.stack([low, high], axis=-1)
    return np.where(known[..., None], sigma[..., None] * factor, np.nan)


def compute_share_intervals(within: Ints, count: Ints) -> tuple[Floats, Floats]:
    """Compute shares (...,) of counts, and the confidence intervals (..., 2) of the true shares."""
    n = np.broadcast_to(count, within.shape).astype(np.float64)
    k = within.astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(n > 0, k / n, np.nan)
    low = np.where(k > 0, betaincinv(np.maximum(k, 1.0), n - k + 1.0, TAIL_PROBABILITY), 0.0)
    high = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1.0), 1.0 - TAIL_PROBABILITY), 1.0)
    return share, np.where((n > 0)[..., None], np.stack([low, high], axis=-1), np.nan)


def _moments(error: Floats, count: Ints) -> tuple[Floats, Floats]:
    """Compute mean and standard deviation (M,) of (N, M) without NaN; NaN if there are too few."""
    known = np.isfinite(error)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(known, error, 0.0).sum(axis=0) / count
        squares = (np.where(known, error - mean, 0.0) ** 2).sum(axis=0)
        spread = np.sqrt(squares / (count - 1))
    return mean, np.where(count > 1, spread, np.nan)


SIMULATION_SCHEMA = 1
SHARES = ("68", "95", "99.7")


def write_simulation(simulation: Simulation, path: Path) -> None:
    """Write simulation.json.

    Parameters
    ----------
    simulation
        Simulation to write.
    path
        Output file.
    """
    path.write_text(json.dumps(simulation_as_json(simulation), indent=1) + "\n", encoding="utf-8")


def simulation_as_json(simulation: Simulation) -> Record:
    """Convert to plain data: metres and degrees; ranges are of 95 %; None for missing values."""
    found = simulation.repetitions
    return {
        "schema": SIMULATION_SCHEMA,
        "name": simulation.name,
        "source": simulation.source,
        "seed": simulation.seed,
        **_summary(found, simulation.accuracy),
        "drawn_unlike_stated": encode(simulation.unlike),
        "amiss": list(simulation.deviations),
        "variants": [
            {"name": one.name, **_summary(one.repetitions, one.accuracy)}
            for one in simulation.variants
        ],
        "draws": {
            "names": list(found.name),
            **{key: encode(getattr(found, key)) for key in DRAWN},
        },
    }


DRAWN = ("number", "true", "value", "sigma", "converged", "level", "failure", "codes")
"""Columns of the repetitions that are written."""


def _summary(found: Repetitions, accuracy: Accuracy) -> Record:
    verdicts = Counter(level for level in found.level if level is not None)
    shares = zip(accuracy.coverage, accuracy.coverage_range, strict=True)
    return {
        "repetitions": len(found.number),
        "failed": found.failed,
        "not_converged": found.unsettled,
        "verdicts": {level: verdicts.get(level, 0) for level in ("green", "amber", "red")},
        "measurements": records(
            name=found.name,
            unit=found.unit,
            count=accuracy.count,
            predicted_sigma=found.predicted,
            stated_sigma=accuracy.stated,
            bias=records(value=accuracy.bias, range=accuracy.bias_range),
            spread=records(value=accuracy.spread, range=accuracy.spread_range),
            z=records(value=accuracy.z, range=accuracy.z_range),
            coverage=[
                dict(zip(SHARES, records(value=share, range=ends), strict=True))
                for share, ends in shares
            ],
        ),
    }


LOG_KEYS = {
    "position_bias_m": "position_bias_sigma_m",
    "heading_bias_deg": "heading_bias_sigma_deg",
    "boresight_deg": "boresight_sigma_deg",
    "lever_arm_sigma_m": "lever_arm_sigma_m",
}
"""Keys of ``errors`` and the corresponding keys of ``stated``, for surveys with a log only."""

TAPE_KEYS = {"tape_scale": "tape_scale_sigma"}
MAX_RELATIVE_DIFFERENCE = 1e-3
"""Relative difference up to which two sigmas are equal."""


def find_unlike_stated(scenario: Scenario) -> tuple[SigmaMismatch, ...]:
    """Return the quantities that a scenario draws with another sigma than its project states.

    The ± of the results is wrong by these differences.

    Parameters
    ----------
    scenario
        Its errors, its site, its ground, and its stated sigmas.
    """
    errors, stated, site, ground = scenario.errors, scenario.stated, scenario.site, scenario.ground
    keys = TAPE_KEYS if scenario.telemetry == "none" else LOG_KEYS | TAPE_KEYS
    pairs = {
        f"errors.{key}": (getattr(errors, key), getattr(stated, other))
        for key, other in keys.items()
    }
    if scenario.telemetry != "none":
        # The project states level ground at the height of home; a fixed departure of the site from
        # that is an error too.
        height = np.hypot(ground.height_sigma_m, site.ground_height_m)
        slope = np.hypot(ground.slope_sigma_deg, np.linalg.norm(site.ground_slope_deg) / np.sqrt(2))
        pairs["ground.height_sigma_m"] = float(height), stated.ground_height_sigma_m
        pairs["ground.slope_sigma_deg"] = float(slope), stated.ground_slope_sigma_deg
    found = (SigmaMismatch(key, _each(drawn), _each(says)) for key, (drawn, says) in pairs.items())
    return tuple(
        one for one in found if not np.allclose(one.drawn, one.stated, rtol=MAX_RELATIVE_DIFFERENCE)
    )


def _each(value: float | tuple[float, ...]) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


ProgressHandler = Callable[[str], None]


def predict_sigmas(world: World) -> tuple[tuple[str, ...], tuple[str, ...], Floats]:
    """Return names, units and expected sigmas (M,) of the survey without noise.

    They are computed with the real likelihood.

    Parameters
    ----------
    world
        Survey to be repeated.

    Raises
    ------
    UavgramError
        There is no result even without noise.
    """
    drawn = world.exact()
    with one_blas_thread():
        result = compute(drawn.inputs, posed=drawn.posed, curved=False).result
    _, sigma = _collect_measured(result, drawn)
    return drawn.name, drawn.unit, sigma


def repeat_survey(
    world: World,
    count: int,
    progress: Progress = silent,
    heard: ProgressHandler | None = None,
    *,
    what: str = "repeating the survey",
) -> Repetitions:
    """Repeat a survey with known truth.

    Parameters
    ----------
    world
        Survey to be repeated; repetitions are numbered from 0.
    count
        Number of repetitions.
    progress
        Shows the loop.
    heard
        Receives a text on the convergence of the simulation now and then.
    what
        Name of the loop.

    Raises
    ------
    UavgramError
        There is no result even without noise.
    """
    name, unit, sigma = predict_sigmas(world)
    rows: list[Repetition] = []
    made = run_in_processes(partial(run_repetition, world), range(count))
    for row in progress(made, what, count):
        rows.append(row)
        if heard is not None and len(rows) in _milestones(count):
            heard(_describe_convergence(gather_repetitions(rows, name, unit, sigma)))
    return gather_repetitions(rows, name, unit, sigma)


def run_repetition(world: World, number: int) -> Repetition:
    """Draw a survey, run it, and compare; without a result, record the reason.

    Parameters
    ----------
    world, number
        Survey to be drawn, and number of the draw.
    """
    drawn = world.draw(number)
    try:
        with one_blas_thread():
            result = compute(drawn.inputs, posed=drawn.posed, curved=False).result
    except UavgramError as fault:
        return Repetition(number=number, failure=str(fault))
    value, sigma = _collect_measured(result, drawn)
    return Repetition(
        number=number,
        true=tuple(drawn.true.tolist()),
        value=tuple(value.tolist()),
        sigma=tuple(sigma.tolist()),
        level=result.verdict.level,
        converged=result.solution.converged,
        codes=tuple(sorted({m.code for m in result.messages if m.level != "info"})),
    )


def gather_repetitions(
    rows: Sequence[Repetition], name: tuple[str, ...], unit: tuple[str, ...], predicted: Floats
) -> Repetitions:
    """Collect repetitions in arrays.

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


def _collect_measured(result: Result, drawn: DrawnSurvey) -> tuple[Floats, Floats]:
    """Return values and sigmas (M,) in the order of the truth; NaN where there is none.

    Coordinates are NaN in a world that is not georeferenced.
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
    """Return the numbers of repetitions after which progress is reported."""
    steps = {first * 10**power for power in range(1, 7) for first in (1, 2, 5)}
    return {step for step in steps if step < count}


def _describe_convergence(repetitions: Repetitions) -> str:
    """Describe the convergence of a simulation in one line."""
    count = len(repetitions.number)
    ratio = compute_running_ratio(repetitions, count)
    # standard error of a sigma estimated from n normal errors: sigma / sqrt(2 (n - 1)); the values
    # are correlated, so their number does not reduce it
    sure = 1.96 / np.sqrt(2.0 * max(count - 1, 1))
    lost = repetitions.failed + repetitions.unsettled
    missing = f"; {lost} without a result" if lost else ""
    return f"{count} repetitions: spread {ratio:.2f} ± {sure:.2f} of the predicted one{missing}"


JSON_FILE, PAGE_FILE = "simulation.json", "simulation.html"
CLEAN_NAME = "nothing amiss"


@dataclass(frozen=True)
class SimulationRequest:
    """Requested number of repetitions, and whether to compare with clean ones."""

    repetitions: int
    compare: bool = False


def simulate_many(
    source: Path,
    world: World,
    asked: SimulationRequest,
    progress: Progress = silent,
    heard: ProgressHandler | None = None,
) -> Simulation:
    """Repeat a survey, and if requested its variants with fewer deviations from the project.

    Parameters
    ----------
    source
        The file that the world comes from.
    world
        Survey to be repeated.
    asked
        Number of repetitions.
    progress, heard
        Report the progress.

    Raises
    ------
    InputError
        The survey has no result even without noise, or has no deviation to compare.
    """
    others = _list_worlds(source, world) if asked.compare else {}
    try:
        found = repeat_survey(world, asked.repetitions, progress, heard)
        compared = tuple(
            _variant(name, other, asked.repetitions, progress) for name, other in others.items()
        )
    except UavgramError as fault:
        raise InputError(source, f"has no result, not even without errors: {fault}") from fault
    name, seed = world.get_name_and_seed()
    return Simulation(
        name=name,
        seed=seed,
        source=source.name,
        repetitions=found,
        accuracy=compute_accuracy(found),
        variants=compared,
        unlike=find_unlike_stated(world.scenario) if isinstance(world, ScenarioWorld) else (),
        deviations=tuple(_make_variants(world.scenario)[1])
        if isinstance(world, ScenarioWorld)
        else (),
    )


def write_outputs(simulation: Simulation, folder: Path, source: Path) -> tuple[str, ...]:
    """Write all files of a simulation at once; return their names.

    Parameters
    ----------
    simulation
        Simulation to write.
    folder
        Output folder.
    source
        Input file that must not be overwritten.

    Raises
    ------
    OutputError
        The folder cannot be written.
    """
    with stage_output(folder, [source]) as hidden:
        write_simulation(simulation, hidden / JSON_FILE)
        page = render_simulation_page(simulation)
        (hidden / PAGE_FILE).write_text(page, encoding="utf-8")
    return JSON_FILE, PAGE_FILE


def _list_worlds(source: Path, world: World) -> dict[str, World]:
    """Return the worlds to compare with, by the name of their deviation."""
    if not isinstance(world, ScenarioWorld):
        raise InputError(source, "comparing is for scenarios: a real survey has nothing amiss")
    others = {name: replace(world, scenario=one) for name, one in list_variants(world.scenario)}
    if not others:
        raise InputError(
            source,
            "has nothing amiss that could be compared: write something under habits, a shape or "
            "relief under ground, or errors.readout_ms or identification_m",
        )
    return dict(others)


def _variant(name: str, world: World, count: int, progress: Progress) -> Variant:
    """Repeat the same draws in another world."""
    found = repeat_survey(world, count, progress, what=f"the same with {name}")
    return Variant(name=name, repetitions=found, accuracy=compute_accuracy(found))


def list_variants(scenario: Scenario) -> Iterator[tuple[str, Scenario]]:
    """Iterate over the clean scenario, and those with one deviation each; none if it is clean.

    Parameters
    ----------
    scenario
        Whose habits, ground, readout and identification are separated.
    """
    clean, alone = _make_variants(scenario)
    if alone:
        yield CLEAN_NAME, clean
    if len(alone) > 1:
        yield from alone.items()


def _make_variants(scenario: Scenario) -> tuple[Scenario, dict[str, Scenario]]:
    """Return the scenario without deviations, and those with one deviation each, by its key."""
    errors, ground, habits = scenario.errors, scenario.ground, scenario.habits
    even = GroundSpec(height_sigma_m=ground.height_sigma_m, slope_sigma_deg=ground.slope_sigma_deg)
    clean = replace(
        scenario,
        errors=replace(errors, readout_ms=0.0, identification_m=0.0),
        ground=even,
        habits=FixedErrors(),
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

"""Missions read back from their files and flown many times: errors over what the plan predicts.

    python tests/benchmarks/study_missions.py --repetitions 200

Each mission file (.waypoints by pymavlink, .plan) of a plan with a log and of one
without is read back, and its photos are taken by the simulator: each time with a drone that departs
from the mission, a log, picks, tapes and a ground drawn from what the project states of them, and
adjusted by the whole program. Told is the root mean square of errors over the plan's ±, with the
range in which it lies with 95 %. A plan counts on those photos of a point that show it even if the
drone departs by `--deviation`; where others show it as well, errors are smaller than its ±.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from mission_files import by_plan, by_pymavlink, stations

from uavgram.model.planned import FlightPlanned
from uavgram.pipeline.parallel import run_in_processes
from uavgram.stages.products.planned_layers import flight_mission
from uavgram.synthetic.plan.plan import plan
from uavgram.synthetic.scenario import Scenario
from uavgram.synthetic.simulate import gather_repetitions, run_repetition
from uavgram.synthetic.single_photos import compute_ratio
from uavgram.synthetic.survey import ScenarioWorld

SCENARIO = """
telemetry: {telemetry}
site: {{ground_height_m: 0, ground_slope_deg: [0, 0]}}
plan:
  area: [[-14, -10], [14, -10], [14, 10], [-14, 10]]
  wanted:
    - {{name: width, points: [[-8, -6], [-8, 6]]}}
    - {{name: way, points: [[-8, -6], [8, 5]]}}
    - {{name: front, points: [[0, -7], [9, 0]]}}
    - {{name: back, points: [[-9, 7], [5, 8]]}}
  patterns: [{pattern}]
  heights_m: [40]
  pitches_deg: [-75]
  frames: [{frames}]
  lines: {lines}
  deviation_m: {deviation}
  deviation_deg: {deviation}
"""
FLIGHTS = {
    "single photo, 4 lines, consumer log": ("consumer", "single", 1, 4),
    "strip of 3, 3 lines, consumer log": ("consumer", "strip", 3, 3),
    "strip of 3, 4 lines, no log": ("none", "strip", 3, 4),
}
READERS = {".waypoints": by_pymavlink, ".plan": by_plan}


def planned(
    flight: tuple[str, str, int, int], folder: Path, deviation: float
) -> tuple[FlightPlanned, Scenario]:
    """A plan, and the scenario that flies it with errors as the project states them."""
    telemetry, pattern, frames, lines = flight
    path = folder / "yard.yaml"
    path.write_text(
        SCENARIO.format(
            telemetry=telemetry, pattern=pattern, frames=frames, lines=lines, deviation=deviation
        )
    )
    made, flown = plan(path)
    stated = flown.stated
    errors = replace(
        flown.errors,
        position_bias_m=stated.position_bias_sigma_m,
        heading_bias_deg=stated.heading_bias_sigma_deg,
        boresight_deg=stated.boresight_sigma_deg,
        lever_arm_sigma_m=stated.lever_arm_sigma_m,
        tape_scale=stated.tape_scale_sigma,
    )
    relief = made.assumptions.roughness_m  # of each point its own, as is stated
    ground = replace(
        flown.ground,
        relief_m=relief,
        relief_length_m=0.0,
        height_sigma_m=stated.ground_height_sigma_m,
        slope_sigma_deg=stated.ground_slope_sigma_deg,
    )
    site = replace(flown.site, ground_height_m=0.0, ground_slope_deg=(0.0, 0.0))
    stated = replace(stated, noise="stated")
    return made, replace(flown, errors=errors, site=site, ground=ground, stated=stated)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repetitions", type=int, default=200)
    parser.add_argument("--deviation", type=float, default=0.5, help="of the drone: m, degrees")
    parser.add_argument("--workers", type=int, default=0, help="0: one for each core")
    parser.add_argument("--flight", default="", help="part of the name of a flight")
    asked = parser.parse_args()
    for name, flight in FLIGHTS.items():
        if asked.flight not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            made, scenario = planned(flight, Path(folder), asked.deviation)
            mission = flight_mission(made)
            for k, (file, read_by) in enumerate(READERS.items()):
                poses = stations(read_by(mission, Path(folder)), scenario.site)
                there = replace(scenario, flight=replace(scenario.flight, poses=poses))
                repeat = partial(run_repetition, ScenarioWorld(there))
                numbers = range(k * asked.repetitions, (k + 1) * asked.repetitions)
                rows = list(run_in_processes(repeat, numbers, asked.workers))
                told(f"{name}, {file}", made, rows)


def told(name: str, made: FlightPlanned, rows: list) -> None:  # type: ignore[type-arg]
    """Print how the errors of repetitions compare with a plan."""
    wanted = made.measurements
    found = gather_repetitions(rows, wanted.name, wanted.unit, wanted.sigma)
    good = found.counted.all(axis=1)
    error = (found.value - found.true)[good]
    low, middle, high = compute_ratio(error / wanted.sigma)
    _, own, _ = compute_ratio(error / found.sigma[good])
    print(
        f"{name}: errors over the plan's ± {middle:.3f} ({low:.3f} to {high:.3f}); over the "
        f"survey's own {own:.3f}; {len(rows) - len(error)} of {len(rows)} without a result; each "
        f"{np.sqrt(np.mean((error / wanted.sigma) ** 2, axis=0)).round(2)}; ± "
        f"{(1e3 * wanted.sigma).round().tolist()} mm",
        flush=True,
    )


if __name__ == "__main__":
    main()

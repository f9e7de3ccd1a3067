"""Planned reference lines against random ones: predicted sigmas, and errors of simulated surveys.

    python tests/benchmarks/study_planning.py --scenes 200
    python tests/benchmarks/study_planning.py --scenes 0 --simulate 20 --draws 200
    python tests/benchmarks/study_planning.py --scenes 0 --beside 20
    python tests/benchmarks/study_planning.py --scenes 0 --margins 20

Scenes are those of tests/support/plan_scenes.py: 20 to 60 m long, 20 distances wanted, 3 to 6 lines
of 3 to 15 m, single photos and strips of 4 to 8. Beside each planned layout stand 100 random ones
of as many lines, of the same places and lengths. Simulated is the planned layout beside the random
one whose predicted sigma is the median: rms errors of surveys drawn from the priors and adjusted by
the real likelihood; also with relief and a tape's scale that the plan knows nothing of. `--beside`
asks what it costs to lay and fly beside the plan, `--margins` how many flights lose a line at the
edge of all photos as the drone departs from the plan by 2 m and 1.8 degrees in each axis.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from plan_draws import World, errors
from plan_scenes import STEADY, PlanCase, plan_case

from uavgram.geometry.camera.projection import project
from uavgram.geometry.motion.rotation import exp_so3
from uavgram.model.arrays import Floats
from uavgram.model.options import TapeOptions
from uavgram.model.planned import FlightPattern
from uavgram.synthetic.observations import EDGE_PX
from uavgram.synthetic.plan.accuracy import list_ends
from uavgram.synthetic.plan.layouts import compute_criterion, find_best_layout
from uavgram.synthetic.plan.scene import Deviation
from uavgram.synthetic.plan.survey import PossibleReferences, compute_possible, predict_values

RANDOM = 100
WRONG_M = 1.0
"""An error of a distance that tells of another minimum; such surveys are counted, not averaged."""

BARS: dict[FlightPattern, tuple[float, float]] = {"single": (0.8, 0.95), "strip": (0.9, 0.95)}


def lengths(case: PlanCase, laid: str) -> tuple[float, float] | None:
    """Between which lengths lines lie; None of plates."""
    return (3.0, case.longest_m) if laid == "lines" else None


def compared(pattern: FlightPattern, seed: int, roughness_m: float, laid: str) -> Floats:
    """Planned mean sigma over the median, and over the best tenth, of random layouts; seconds."""
    case = plan_case(pattern, seed, roughness_m=roughness_m)
    start = time.perf_counter()
    options = compute_possible(case.scene, case.cameras, case.wanted, lengths(case, laid))
    layout = find_best_layout(options.aim, options.candidates, case.lines)
    took = time.perf_counter() - start
    others = [
        compute_criterion(options.aim, options.candidates, lines)
        for lines in random_layouts(options, case.lines, seed)
    ]
    middle, tenth = np.quantile(others, (0.5, 0.1))
    return np.array([layout.criterion / middle, layout.criterion / tenth, took, case.lines])


def random_layouts(options: PossibleReferences, lines: int, seed: int) -> list[list[int]]:
    """Layouts of candidates that share no end."""
    rng = np.random.default_rng(seed)
    ends = options.candidates.ends
    found: list[list[int]] = []
    while len(found) < RANDOM:
        drawn = rng.choice(len(ends), lines, replace=False)
        if len(np.unique(ends[drawn])) == ends.shape[1] * lines:
            found.append(drawn.tolist())
    return found


def simulated(
    pattern: FlightPattern, seed: int, draws: int, world: World, known: tuple[float, float]
) -> Floats:
    """Planned over random: rms of the errors of wanted distances; rms of errors over sigmas.

    `known` is what the plan reckons with: the roughness of the ground [m], and a tape's scale.
    """
    case = plan_case(pattern, seed, roughness_m=known[0])
    case = replace(case, scene=replace(case.scene, tape=TapeOptions(scale_sigma=known[1])))
    options = compute_possible(case.scene, case.cameras, case.wanted, (3.0, case.longest_m))
    planned = find_best_layout(options.aim, options.candidates, case.lines).lines
    others = random_layouts(options, case.lines, seed)
    value = [compute_criterion(options.aim, options.candidates, lines) for lines in others]
    middle = others[int(np.argsort(value)[len(value) // 2])]
    flown = case.scene, case.cameras, case.wanted
    rms, z, lost = [], [], 0
    for lines in (planned, middle):
        ends = options.spot_m[options.candidates.ends[list(lines)]]
        rng = np.random.default_rng(seed)
        found = errors(flown, ends, draws, rng, world)
        found = found[np.abs(found).max(axis=1) < WRONG_M]
        lost += draws - len(found)
        sigma = predict_values(*flown, ends).sigma
        rms.append(np.sqrt(np.mean(found**2, axis=0)).mean())
        z.append(np.sqrt(np.mean((found / sigma) ** 2)))
    return np.array([rms[0] / rms[1], *z, lost])


WORLDS = {
    "as planned": (World(), (0.0, 0.0)),
    "5 cm of relief, reckoned with": (World(relief_m=0.05), (0.05, 0.0)),
    "5 cm of relief, unknown": (World(relief_m=0.05), (0.0, 0.0)),
    "tape scale 0.1 %, unknown": (World(tape_scale=0.001), (0.0, 0.0)),
    "tape scale 0.1 %, reckoned with": (World(), (0.0, 0.001)),  # its prior is drawn from
}


def laid_beside(pattern: FlightPattern, seed: int, laid: str) -> Floats:
    """(BESIDE, LAYINGS) mean sigma of a plan carried out roughly, over that of the plan."""
    deviation = Deviation()
    case = plan_case(pattern, seed, roughness_m=0.05, deviation=deviation)
    scene, cameras, wanted = case.scene, case.cameras, case.wanted
    options = compute_possible(scene, cameras, wanted, lengths(case, laid))
    ends = list_ends(options, find_best_layout(options.aim, options.candidates, case.lines).lines)
    scene = replace(scene, deviation=STEADY)  # photos are where they are, and show what they show
    as_planned = predict_values(scene, cameras, wanted, ends).sigma.mean()
    rng = np.random.default_rng(seed)
    found = np.empty((len(BESIDE), LAYINGS))
    for row, (shift_m, end_m, drone_m) in enumerate(BESIDE.values()):
        for turn in range(LAYINGS):
            moved = ends + directions(rng, (len(ends), 1), 2) * shift_m
            if laid == "lines":  # a plate stays a square
                moved += directions(rng, ends.shape[:2], 2) * end_m
            center = cameras.center_m + directions(rng, (len(cameras.center_m),), 3) * drone_m
            there = cameras._replace(center_m=center)
            sigma = predict_values(scene, there, wanted, moved).sigma.mean()
            found[row, turn] = sigma / as_planned
    return found


def flights_that_lose(pattern: FlightPattern, seed: int, planned_for: Deviation) -> float:
    """Share of flights in which a line of the plan is whole in no photo."""
    case = plan_case(pattern, seed, roughness_m=0.05, deviation=planned_for)
    scene = case.scene
    options = compute_possible(scene, case.cameras, case.wanted, (3.0, case.longest_m))
    lines = find_best_layout(options.aim, options.candidates, case.lines).lines
    point = scene.on_ground(list_ends(options, lines)).reshape(-1, 3)
    camera, rng, real = scene.calibration, np.random.default_rng(seed), Deviation()
    shape = (FLIGHTS, len(case.cameras.center_m), 3)
    center = case.cameras.center_m + real.position_m * rng.standard_normal(shape)
    turn = np.deg2rad(real.attitude_deg) * rng.standard_normal(shape)
    rotation = case.cameras.world_from_camera @ exp_so3(turn)
    in_camera = np.einsum("rfij,rfki->rfkj", rotation, point - center[:, :, None])
    pixel = project(camera.model, camera.parameters, in_camera)
    size = np.array([camera.width_px, camera.height_px]) - 1.0
    inside = np.all((pixel > EDGE_PX) & (pixel < size - EDGE_PX), axis=-1)
    whole = inside.reshape(*shape[:2], len(lines), 2).all(axis=-1)
    return 1.0 - float(whole.any(axis=1).all(axis=-1).mean())


FLIGHTS = 500


def directions(rng: np.random.Generator, shape: tuple[int, ...], size: int) -> Floats:
    """Random unit vectors."""
    drawn = rng.standard_normal((*shape, size))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=-1, keepdims=True))


BESIDE = {  # metres: whole lines moved, each end moved, each photo moved
    "laid half a metre beside": (0.5, 0.0, 0.0),
    "each end half a metre off": (0.0, 0.5, 0.0),
    "drone 1 m off": (0.0, 0.0, 1.0),
    "all three": (0.5, 0.5, 1.0),
    "laid 2 m beside": (2.0, 0.0, 0.0),
}
LAYINGS = 10


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--roughness", type=float, default=0.0)
    parser.add_argument("--simulate", type=int, default=0)
    parser.add_argument("--draws", type=int, default=200)
    parser.add_argument("--beside", type=int, default=0, metavar="SCENES")
    parser.add_argument("--lay", choices=("lines", "plates"), default="lines")
    parser.add_argument("--margins", type=int, default=0, metavar="SCENES")
    parser.add_argument("--world", default="", help="part of the name of a world")
    asked = parser.parse_args()
    if asked.scenes:
        predict(asked)
    for pattern in BARS if asked.beside else ():
        ratio = np.array([laid_beside(pattern, seed, asked.lay) for seed in range(asked.beside)])
        for row, what in enumerate(BESIDE):
            share = ratio[:, row]
            print(
                f"{pattern}, {what}: sigma over the planned one, mean {share.mean():.3f}, "
                f"95 % below {np.quantile(share, 0.95):.3f}, worst {share.max():.3f}"
            )
    for pattern in BARS if asked.margins else ():
        for what, deviation in (("with", Deviation()), ("without", STEADY)):
            lose = [flights_that_lose(pattern, seed, deviation) for seed in range(asked.margins)]
            print(f"{pattern}, {what} margins: {np.mean(lose):.3f} of flights lose a line")
    for name, (world, known) in WORLDS.items() if asked.simulate else ():
        if asked.world not in name:
            continue
        for pattern in BARS:
            found = np.array(
                [
                    simulated(pattern, seed, asked.draws, world, known)
                    for seed in range(asked.simulate)
                ]
            )
            ratio, z = found[:, 0], np.sqrt(np.mean(found[:, 1:3] ** 2, axis=0))
            print(
                f"{name}, {pattern}: planned over median mean {ratio.mean():.3f}, worst "
                f"{ratio.max():.3f} (seed {ratio.argmax()}); errors over sigmas {z[0]:.2f} "
                f"(planned), {z[1]:.2f} (random); {found[:, 3].sum():.0f} lost"
            )


def predict(asked: argparse.Namespace) -> None:
    """Print how planned layouts compare by their predicted sigmas."""
    for pattern, bars in BARS.items():
        seeds = range(asked.first, asked.first + asked.scenes)
        found = np.array([compared(pattern, seed, asked.roughness, asked.lay) for seed in seeds])
        print(f"{pattern}, {len(found)} scenes, {found[:, 2].mean():.2f} s each")
        for column, (name, bar) in enumerate(zip(("median", "best tenth"), bars, strict=True)):
            share = found[:, column]
            print(
                f"  over the {name}: mean {share.mean():.3f}, worst {share.max():.3f} "
                f"(seed {asked.first + int(share.argmax())}); above {bar}: "
                f"{np.count_nonzero(share > bar)}"
            )
        for lines in np.unique(found[:, 3]):
            some = found[found[:, 3] == lines]
            print(
                f"  {lines:.0f} lines: {some[:, :2].mean(axis=0).round(3)}",
                some[:, :2].max(axis=0).round(3),
            )


if __name__ == "__main__":
    main()

"""Planned reference lines against random ones: predicted sigmas, and errors of simulated surveys.

    python tests/benchmarks/study_planning.py --scenes 200

Scenes are those of tests/support/plan_scenes.py: 20 to 60 m long, 20 distances wanted, 3 to 6 lines
of 3 to 15 m, single photos and strips of 4 to 8. Beside each planned layout stand 100 random ones
of as many lines, of the same places and lengths.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))

from plan_scenes import plan_case

from uavgram.estimation.planning.layouts import best_layout, criterion_of
from uavgram.model.arrays import Floats
from uavgram.model.planned.request import FlightPattern
from uavgram.pipeline.plan.possible import possible

RANDOM = 100
BARS = {"single": (0.8, 0.95), "strip": (0.9, 0.95)}


def compared(pattern: FlightPattern, seed: int, roughness_m: float) -> Floats:
    """Planned mean sigma over the median, and over the best tenth, of random layouts; seconds."""
    case = plan_case(pattern, seed, roughness_m=roughness_m)
    start = time.perf_counter()
    options = possible(case.scene, case.cameras, case.wanted, (3.0, case.longest_m))
    layout = best_layout(options.aim, options.candidates, case.lines)
    took = time.perf_counter() - start
    rng = np.random.default_rng(seed)
    ends = options.candidates.ends
    others = []
    while len(others) < RANDOM:
        lines = rng.choice(len(ends), case.lines, replace=False)
        if len(np.unique(ends[lines])) == 2 * case.lines:
            others.append(criterion_of(options.aim, options.candidates, lines.tolist()))
    middle, tenth = np.quantile(others, (0.5, 0.1))
    return np.array([layout.criterion / middle, layout.criterion / tenth, took, case.lines])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--roughness", type=float, default=0.0)
    asked = parser.parse_args()
    for pattern, bars in BARS.items():
        seeds = range(asked.first, asked.first + asked.scenes)
        found = np.array([compared(pattern, seed, asked.roughness) for seed in seeds])
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

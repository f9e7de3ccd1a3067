"""What free heights cost: a mapping flight with 20,000 free points, and with them on the ground.

    python tests/benchmarks/bench_free_points.py [FRAMES] [PICKS PER FRAME]

Every point is picked in five frames. Ends of known lengths stay on the ground, all others are free;
the observations are the same. Seconds of processor time to the end of the adjustment with its tests
and with the covariance of every pose and every point, by turns, the best of two.
"""

from __future__ import annotations

import os
import sys
import time
from dataclasses import replace

import numpy as np
from large_survey import large_survey

from uavgram.model.options import SolveOptions
from uavgram.model.survey import Survey
from uavgram.stages.refine import refine

REPEATS = 2


def seconds(survey: Survey) -> tuple[float, int]:
    """Of the whole adjustment, and its steps."""
    start = time.process_time()
    adjustment = refine(survey, SolveOptions())[0].adjustment
    adjustment.frame_covariance()
    adjustment.points()
    return time.process_time() - start, adjustment.minimum.iterations


def main() -> None:
    frames, per_frame = (*map(int, sys.argv[1:3]), *(500, 208)[len(sys.argv) - 1 :])
    ground = large_survey(frames, per_frame)
    ends = np.concatenate([ground.line_start, ground.line_end])
    on_ground = np.isin(np.arange(len(ground.label)), ends)
    free = replace(ground, is_free=~on_ground)
    spent: dict[str, list[float]] = {"ground": [], "free": []}
    for _ in range(REPEATS):
        for name, survey in (("ground", ground), ("free", free)):
            took, steps = seconds(survey)
            spent[name].append(took)
            print(f"  {name}: {took:.1f} s, {steps} steps", flush=True)
    flat, high = min(spent["ground"]), min(spent["free"])
    print(
        f"{frames} frames, {(~on_ground).sum()} free points of {len(on_ground)}: {high:.1f} s, on "
        f"the ground {flat:.1f} s: {high / flat:.2f} times (bar 3)"
    )


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()

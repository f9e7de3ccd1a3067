"""The joint survey side by side with Ceres: 500 frames of 20 picks, every point in five frames.

    python tests/benchmarks/bench_joint_survey.py [FRAMES]

Both start from the same first values; seconds of the wall clock. Like with like is the whole task
with one thread each: to the minimum, and the covariance of every pose and of every point with the
plane, which is what the package hands over (ours with the test of every observation on top). Beside
it stand the way to the minimum alone, and Ceres with two threads against one of ours (the package
gives itself one). Ceres' cost functions of the picks are in Python, see joint_survey_ceres.py: what
they cost is left out of the last ratio, which is that of Ceres' compiled linear solver and
covariance alone to the whole of ours.

Ours is timed right before and right after each run of Ceres, so that what else the machine does
falls on both.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path


def side_by_side(frames: int, threads: int) -> None:
    import numpy as np
    import pyceres
    from joint_survey_ceres import ceres
    from large_survey import large_survey

    from uavgram.estimation.survey.adjustment import Adjustment
    from uavgram.model.options import SolveOptions
    from uavgram.stages.refine import refine
    from uavgram.stages.refine.minima import Participants, find_best_minima

    survey = large_survey(frames)
    picks, lines = np.ones(len(survey.pick_frame), bool), np.zeros(len(survey.line_start), bool)

    def timed() -> tuple[float, float, Adjustment]:
        """Seconds with all covariances and without, each the best of three; and the result."""
        spent, without = [], []
        for _ in range(3):
            started = time.perf_counter()
            find_best_minima(Participants(survey, picks, lines, {}))
            without.append(time.perf_counter() - started)
            started = time.perf_counter()
            adjustment = refine(survey, SolveOptions())[0].adjustment
            adjustment.frame_covariance()
            adjustment.points()
            spent.append(time.perf_counter() - started)
        return min(spent), min(without), adjustment

    *before, adjustment = timed()
    print(
        f"{frames} frames, {adjustment.minimum.iterations} steps; Ceres with {threads} thread(s):"
    )
    shift = np.random.default_rng(0).normal(0, 1.0, (len(adjustment.state.point), 2))
    first = adjustment.state.point[:, :2] + shift
    solvers = pyceres.LinearSolverType
    for solver in (solvers.SPARSE_SCHUR, solvers.SPARSE_NORMAL_CHOLESKY):
        seconds, summary, joint, found = ceres(adjustment, first, solver, threads)
        *after, _ = timed()
        own, bare = (0.5 * (a + b) for a, b in zip(before, after, strict=True))
        before = after
        moved, sigmas = joint.difference(*found)
        linear = summary.linear_solver_time_in_seconds
        print(
            f"  ours {own:.2f} s with all covariances, {bare:.2f} s without; Ceres {solver.name}: "
            f"built {seconds[0]:.2f}, solved {seconds[1]:.2f} ({summary.num_successful_steps} "
            f"steps; linear solver {linear:.2f}), covariance {seconds[2]:.2f} s: "
            f"{sum(seconds) / own:.1f} times ours (bar 10), both without covariance "
            f"{sum(seconds[:2]) / bare:.1f}, its compiled part alone "
            f"{(linear + seconds[2]) / own:.1f}; minimum within {moved:.1e} sigma, sigmas within "
            f"{sigmas:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    if len(sys.argv) == 4 and sys.argv[1] == "--one":
        side_by_side(int(sys.argv[2]), int(sys.argv[3]))
    else:
        for threads in ("1", "2"):
            subprocess.run(
                [sys.executable, __file__, "--one", *(sys.argv[1:2] or ["500"]), threads],
                check=True,
                env={
                    **os.environ,
                    "OPENBLAS_NUM_THREADS": "1",
                    "OMP_NUM_THREADS": threads,
                    "PYTHONPATH": str(Path(__file__).parent),
                },
            )

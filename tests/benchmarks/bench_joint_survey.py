"""The joint survey side by side with Ceres: 500 frames of 20 picks, every point in five frames.

    python tests/benchmarks/bench_joint_survey.py [FRAMES]

Both from the same first values, once to the minimum alone and once to the covariance of every pose
and of every point with the plane too (ours with the test of every observation); seconds of the wall
clock. Ours has one BLAS thread, as the program gives itself; Ceres has one and two threads. Its
cost functions of the picks are in Python (see joint_survey_ceres.py): what they cost is stated
apart, so that the last column compares with the compiled part of Ceres alone: its linear solver and
its covariance.
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

    from uavgram.model.options import SolveOptions
    from uavgram.stages.refine import refine
    from uavgram.stages.refine.misplaced import adjust

    survey = large_survey(frames)
    picks, lines = np.ones(len(survey.pick_frame), bool), np.zeros(len(survey.line_start), bool)
    spent, without = [], []
    for _ in range(3):
        started = time.perf_counter()
        adjust(survey, picks, lines, {})
        without.append(time.perf_counter() - started)
        started = time.perf_counter()
        adjustment = refine(survey, SolveOptions())[0].adjustment
        adjustment.frame_covariance()
        adjustment.points()
        spent.append(time.perf_counter() - started)
    own, bare = min(spent), min(without)
    state = adjustment.state
    shift = np.random.default_rng(0).normal(0, 1.0, (len(state.point), 2))
    print(
        f"{frames} frames: {own:.2f} s with all covariances, {bare:.2f} s without, "
        f"{adjustment.minimum.iterations} steps; Ceres with {threads} thread(s):"
    )
    solvers = pyceres.LinearSolverType
    for solver in (solvers.SPARSE_SCHUR, solvers.SPARSE_NORMAL_CHOLESKY):
        seconds, summary, joint, found = ceres(
            adjustment, state.point[:, :2] + shift, solver, threads
        )
        moved, sigmas = joint.difference(*found)
        compiled = summary.linear_solver_time_in_seconds + seconds[2]
        print(
            f"  Ceres {solver.name}: built {seconds[0]:.2f}, solved {seconds[1]:.2f} "
            f"({summary.num_successful_steps} steps; linear solver "
            f"{summary.linear_solver_time_in_seconds:.2f}), covariance {seconds[2]:.2f} s: "
            f"{sum(seconds) / own:.1f} times ours, both without covariance "
            f"{sum(seconds[:2]) / bare:.1f}, its compiled part alone {compiled / own:.1f}; minimum "
            f"within {moved:.1e} sigma, sigmas within {sigmas:.1e}",
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

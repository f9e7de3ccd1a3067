"""How the adjustment of a survey grows with its size: time per frame, and peak memory.

    python tests/benchmarks/bench_adjustment.py [FRAMES ...]

Each size runs in a process of its own; times are of the processor, so that what else the machine
does matters little. Points lie in five frames each, 20 picks a frame; covariances of all poses and
points, and the fit of every observation, are included.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from pathlib import Path

SIZES = (500, 5000)


def one(frames: int) -> None:
    from large_survey import large_survey

    from uavgram.model.options import SolveOptions
    from uavgram.stages.judge import judge_groups
    from uavgram.stages.refine import refine

    survey = large_survey(frames)
    started = time.process_time()
    refined, _ = refine(survey, SolveOptions())
    refined.adjustment.frame_covariance()
    refined.adjustment.points()
    judge_groups(refined.adjustment, 0.001)
    spent = time.process_time() - started
    minimum = refined.adjustment.minimum
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{frames} frames, {len(survey.label)} points, {len(survey.pick_frame)} picks: "
        f"{spent:.1f} s, {1e3 * spent / frames:.2f} ms a frame, {minimum.iterations} iterations, "
        f"converged {minimum.converged}, peak {peak:.0f} MB"
    )


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "--one":
        one(int(sys.argv[2]))
    else:
        for size in [int(a) for a in sys.argv[1:]] or SIZES:
            subprocess.run(
                [sys.executable, Path(__file__), "--one", str(size)],
                check=True,
                cwd=Path(__file__).parent,
                env={"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parent)},
            )

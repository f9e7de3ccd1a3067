"""How the adjustment of a survey grows with its size, and what limits each of its parts.

    python tests/benchmarks/bench_adjustment.py [FRAMES ...]

Each size runs in a process of its own; times are of the processor, the best of three, so that what
else the machine does matters little. Points lie in five frames each, 20 picks a frame; covariances
of all poses and points, and the fit of every observation, are included. Memory is what the process
holds at its peak beyond what it held before the survey was made. The rates of the parts stand
beside what the machine reaches: bandwidth by copying an array larger than its caches (as STREAM
does), arithmetic by a large matrix product.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from uavgram.estimation.solver.normal_equations import NormalEquations
    from uavgram.estimation.solver.sparse.block_matrix import BlockMatrix
    from uavgram.estimation.solver.sparse.cholesky import Multifrontal
    from uavgram.estimation.survey.adjustment import Adjustment
    from uavgram.model.arrays import Floats

Answer = TypeVar("Answer")
SIZES = (500, 2000, 5000)


def peak_mb() -> float:
    """Largest memory of this process alone (what ru_maxrss says starts with the parent's)."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def best(action: Callable[[], Answer], times: int = 3) -> tuple[float, Answer]:
    """Shortest processor time of several runs, and the last result."""
    spent = []
    for _ in range(times):
        started = time.process_time()
        result = action()
        spent.append(time.process_time() - started)
    return min(spent), result


def one(frames: int) -> None:
    from large_survey import large_survey

    from uavgram.estimation.reliability.redundancy import compute_group_fit
    from uavgram.model.options import SolveOptions
    from uavgram.stages.refine import refine

    def whole() -> Adjustment:
        refined, _ = refine(survey, SolveOptions())
        adjustment = refined.adjustment
        minimum = adjustment.minimum
        adjustment.frame_covariance()
        adjustment.points()
        for name, block in minimum.blocks.items():
            if name != "gauge":
                compute_group_fit(block, minimum.factor, adjustment.covariance)
        return adjustment

    before = peak_mb()
    survey = large_survey(frames)
    first, adjustment = best(whole, 1)
    held = peak_mb() - before
    spent = min(first, best(whole, 2)[0])
    minimum = adjustment.minimum
    print(
        f"{frames} frames, {len(survey.label)} points, {len(survey.pick_frame)} picks: "
        f"{spent:.1f} s, {1e3 * spent / frames:.2f} ms a frame, {minimum.iterations} iterations, "
        f"converged {minimum.converged}, {held:.0f} MB, {1e3 * held / frames:.0f} kB a frame"
    )
    parts(adjustment)
    print(1e3 * spent / frames, 1e3 * held / frames)  # for the process that compares the sizes


def parts(adjustment: Adjustment) -> None:
    """Time, and rate of memory and arithmetic, of what one iteration and the end consist of."""
    from uavgram.estimation.reliability.redundancy import compute_reliability
    from uavgram.estimation.solver.normal_equations import NormalEquations, Plan
    from uavgram.estimation.solver.sparse.block_matrix import BlockMatrix
    from uavgram.estimation.solver.sparse.cholesky import Multifrontal

    problem, layout = adjustment.problem, adjustment.problem.layout
    evaluate, blocks = best(lambda: problem.evaluate(adjustment.state))
    assert blocks is not None
    given = list(blocks.values())
    first = NormalEquations(given, layout.size, layout.structure)
    first.factor()
    plan = first.plan
    assert isinstance(plan, Plan)

    def normal() -> tuple[NormalEquations, Floats | BlockMatrix]:
        equations = NormalEquations(given, layout.size, layout.structure, plan)
        return equations, equations.normal

    assemble, (equations, matrix) = best(normal)
    assert isinstance(matrix, BlockMatrix)
    factorise, factor = best(equations.factor)
    inner: list[float] = []
    factorised = Multifrontal._factorise

    def timed(self: Multifrontal, values: Floats, smallest: float) -> None:
        started = time.process_time()
        factorised(self, values, smallest)
        inner.append(time.process_time() - started)

    Multifrontal._factorise = timed  # type: ignore[method-assign]  # to time it
    best(equations.factor)
    Multifrontal._factorise = factorised  # type: ignore[method-assign]  # as it was
    fronts = plan.symbolic.ordering.fronts
    own = np.array([front.own for front in fronts], dtype=float)
    edge = np.array([len(front.boundary) for front in fronts], dtype=float)
    flops = float(np.sum(own**3 / 3 + own**2 * edge + own * edge**2))
    moved = 8 * float(np.sum(4 * own * (own + edge) + 3 * edge**2))
    jacobian = sum(b.jacobian.nbytes + b.residual.nbytes for b in given)
    entries = sum(table.nbytes for table in (*matrix.tables, *matrix.coupling))
    solve, _ = best(lambda: factor.solve(equations.gradient))
    stored = 8 * float(np.sum(own**2 / 2 + own * edge))
    covariance = factor.covariance()
    selected, _ = best(lambda: covariance.blocks(layout.frame_columns(np.arange(1))), 1)
    fit, _ = best(
        lambda: compute_reliability(replace(blocks["pixels"]), covariance)
    )  # none is kept
    gathered = blocks["pixels"].jacobian.shape[2] ** 2 * len(blocks["pixels"].jacobian) * 8
    rows = (
        ("residuals and Jacobians", evaluate, jacobian, 0),
        ("normal matrix", assemble, jacobian + entries, 0),
        ("points eliminated", factorise - min(inner), 3 * entries, 0),
        ("fronts", min(inner), moved, flops),
        ("one solution", solve, 2 * stored, 0),
        ("selected inverse", selected, 3 * moved, 3 * flops),
        ("reliability of the picks", fit, 2 * gathered, 0),
    )
    for name, seconds, size, work in rows:
        print(
            f"  {name:24s} {1e3 * seconds:8.1f} ms  at least {size / seconds / 1e9:5.2f} GB/s"
            + (f"  {work / seconds / 1e9:5.1f} GFLOP/s" if work else "")
        )
    print(f"  factor: {flops / 1e9:.2f} GFLOP, {stored / 1e6:.0f} MB; fronts: {len(fronts)}")


def machine() -> None:
    array = np.ones(30_000_000)
    target = np.empty_like(array)
    copy, _ = best(lambda: np.copyto(target, array), 5)
    square = np.ones((1200, 1200))
    product, _ = best(lambda: square @ square, 5)
    print(
        f"this machine, one thread: copy {2 * array.nbytes / copy / 1e9:.1f} GB/s, "
        f"matrix product {2 * 1200**3 / product / 1e9:.1f} GFLOP/s"
    )


def compare(sizes: Sequence[int]) -> None:
    """Each size in a process of its own, and the smallest beside the others."""
    found = []
    for size in sizes:
        done = subprocess.run(
            [sys.executable, Path(__file__), "--one", str(size)],
            check=True,
            capture_output=True,
            text=True,
            cwd=Path(__file__).parent,
            env={"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parent)},
        )
        *lines, last = done.stdout.splitlines()
        print(*lines, sep="\n", flush=True)
        found.append([float(number) for number in last.split()])
    for size, here in zip(sizes[1:], found[1:], strict=True):
        time_ratio, memory_ratio = (a / b for a, b in zip(here, found[0], strict=True))
        print(
            f"{size} frames beside {sizes[0]}: {time_ratio:.2f} times the time per frame "
            f"(bar 1.5), {memory_ratio:.2f} times the memory per frame"
        )


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "--one":
        one(int(sys.argv[2]))
    else:
        machine()
        compare([int(a) for a in sys.argv[1:]] or SIZES)

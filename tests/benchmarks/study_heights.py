"""How honest are free heights, and distances in three dimensions?

Makes surveys with known truth in which cars, walls and kerbs stand, with 2 to 12 photos from above,
aslant or both (`tests/support/hostile_things.py`), and runs each as a user would. The picks of
points off the ground state `free`. Two lines for each condition: heights over the ground of all
these points, and distances between one of them and a point of the ground.

    z        root mean square of error over sigma; 1 is honest, 0.9 to 1.1 is the bar
    < >      its 95 % interval, surveys drawn anew with replacement
    >3s      share of errors beyond three sigmas, per cent
    ratio    mean of |error| over mean sigma: 0.8 where errors are normal
    error, sigma  medians [m]
    none     share without a value, per cent: of the heights of points picked once at least
    wrong    surveys without any result

With `--heights unstated` the picks say nothing of heights, and a third line tells how many points
higher than 0.3 m, of those that two photos see at a base to height of 0.2 or more, are found and
named, with their height within three sigmas (bar 98 %); and how many of the ground (bar 0.1 %).

    python tests/benchmarks/study_heights.py street street_no_log --surveys 200 --seed 0
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from height_errors import Errors, Named, distance_errors, height_errors, named
from hostile_conditions import CONDITIONS
from hostile_project import Heights, write_project
from hostile_surveys import make_survey

from uavgram.errors import UavgramError
from uavgram.pipeline.measure.compute import compute
from uavgram.pipeline.measure.inputs import read_inputs
from uavgram.pipeline.threads import limit_blas_threads

STREETS = tuple(name for name, condition in CONDITIONS.items() if condition.cars)
DRAWS = 2000


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One survey; failure is empty text."""

    condition: str
    seed: int
    photos: int
    heights: Errors = field(default_factory=Errors)
    distances: Errors = field(default_factory=Errors)
    named: Named = field(default_factory=Named)
    variance_factor: float = float("nan")
    codes: tuple[str, ...] = ()
    cpu_s: float = 0.0
    failure: str = ""


@limit_blas_threads
def run_survey(job: tuple[str, int], options: Mapping[str, object], heights: Heights) -> Outcome:
    """Make, run and judge the survey of a condition and a seed."""
    condition, seed = job
    survey = make_survey(CONDITIONS[condition], seed)
    own = partial(Outcome, condition=condition, seed=seed, photos=len(survey.photo))
    with TemporaryDirectory(prefix="heights") as folder:
        project = write_project(survey, Path(folder), options, heights)
        start = time.process_time()
        try:
            result = compute(read_inputs(project), curved=False).result
        except (UavgramError, np.linalg.LinAlgError) as fault:  # the latter is the program's own
            return own(failure=str(fault))
    return own(
        cpu_s=time.process_time() - start,
        heights=height_errors(survey, result.points),
        distances=distance_errors(survey, result.measurements),
        named=named(survey, result.points),
        variance_factor=result.solution.variance_factor,
        codes=tuple(m.code for m in result.messages if m.level != "info"),
    )


def interval(squares: Sequence[np.ndarray]) -> tuple[float, float]:
    """Of the pooled z at 95 %; surveys are what is drawn."""
    total = np.array([one.sum() for one in squares])
    count = np.array([len(one) for one in squares])
    drawn = np.random.default_rng(0).integers(len(total), size=(DRAWS, len(total)))
    pooled = np.sqrt(total[drawn].sum(axis=1) / count[drawn].sum(axis=1))
    low, high = np.quantile(pooled, [0.025, 0.975])
    return float(low), float(high)


def row(errors: Sequence[Errors], failed: int) -> str:
    """The table's line of one kind of errors."""
    if not any(one.error for one in errors):
        return f"no values; {failed} failed"
    z = [np.array(one.error) / np.array(one.sigma) for one in errors]
    low, high = interval([np.square(one) for one in z])
    pooled = np.concatenate(z)
    error = np.abs(np.concatenate([one.error for one in errors]))
    sigma = np.concatenate([one.sigma for one in errors])
    none = sum(len(one.without_value) for one in errors)
    return (
        f"{np.sqrt(np.mean(pooled**2)):6.2f} {low:6.2f} {high:6.2f} "
        f"{100 * np.mean(np.abs(pooled) > 3):6.2f} {error.mean() / sigma.mean():6.2f} "
        f"{np.median(error):6.3f} {np.median(sigma):6.3f} "
        f"{100 * none / (none + len(error)):6.1f} {failed:6d}"
    )


def named_row(outcomes: Sequence[Outcome]) -> str:
    """Which points were named, all surveys together."""
    due, found, right, ground, accused = (
        sum(len(getattr(one.named, part)) for one in outcomes)
        for part in ("due", "found", "right", "ground", "accused")
    )
    surveys = sum(bool(one.named.accused) for one in outcomes)
    return (
        f"  of {due} points off the ground {100 * found / max(due, 1):.2f} % named, "
        f"{100 * right / max(due, 1):.2f} % with their height; of {ground} on it "
        f"{100 * accused / max(ground, 1):.2f} % ({accused} in {surveys} surveys)"
    )


def common_codes(outcomes: Sequence[Outcome]) -> str:
    """The commonest codes, with the number of surveys that have them."""
    count = Counter(code for one in outcomes for code in set(one.codes))
    return ", ".join(f"{code} {number}" for code, number in count.most_common(6))


def study(
    names: Sequence[str],
    seeds: Sequence[int],
    judge: partial[Outcome],
    workers: int,
) -> Iterator[tuple[str, list[Outcome]]]:
    """Outcomes of every condition, one after another."""
    with ProcessPoolExecutor(workers) as pool:
        for name in names:
            yield name, list(pool.map(judge, [(name, seed) for seed in seeds], chunksize=4))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("condition", nargs="*", choices=[[], *STREETS])
    parser.add_argument("--surveys", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0, help="of the first survey")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--heights", choices=["free", "unstated", "stated"], default="free")
    parser.add_argument("--option", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--json", type=Path, help="every outcome, to look closer")
    parser.add_argument("--each", action="store_true", help="a line for each survey too")
    given = parser.parse_args()
    options = {key: yaml.safe_load(value) for key, value in (o.split("=", 1) for o in given.option)}
    seeds = range(given.seed, given.seed + given.surveys)
    judge = partial(run_survey, options=options, heights=given.heights)
    heads = ("z", "<", ">", ">3s", "ratio", "error", "sigma", "none%", "wrong")
    print(f"{'':28s}" + " ".join(f"{head:>6s}" for head in heads))
    everything = []
    for name, outcomes in study(given.condition or STREETS, seeds, judge, given.workers):
        good = [one for one in outcomes if not one.failure]
        failed = len(outcomes) - len(good)
        print(f"{name + ' heights':28s}{row([one.heights for one in good], failed)}")
        print(f"{name + ' distances':28s}{row([one.distances for one in good], failed)}")
        if given.heights == "unstated":
            print(named_row(good))
        cpu = np.mean([one.cpu_s for one in good]) if good else 0.0
        print(f"  cpu {cpu:.2f} s each; {common_codes(good)}", flush=True)
        for one in outcomes if given.each else ():
            z = np.abs(one.heights.z)
            print(
                f"  {one.seed:5d} photos {one.photos:2d} factor {one.variance_factor:6.2f} "
                f"largest z {z.max(initial=0):5.1f} without {len(one.heights.without_value):2d} "
                f"named {len(one.named.right):2d} of {len(one.named.due):2d}, wrongly "
                f"{len(one.named.accused):2d} "
                f"{one.failure[:90]}"
            )
        everything += outcomes
    if given.json:
        given.json.write_text(json.dumps([asdict(one) for one in everything]))


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    main()
